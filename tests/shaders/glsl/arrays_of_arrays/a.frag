#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
float grid[2][3];
const float[2][2] SMALL = float[2][2](float[2](1.0, 2.0), float[2](3.0, 4.0));
struct Row { float cells[4][5]; };
float last(const float values[2][3]) { return values[1][2]; }
void main() {
    int i = int(x.x);
    vec2 local[4][3], single;
    local[3][2] = vec2(x);
    Row row;
    row.cells[3][4] = 1.0;
    grid[1][2] = row.cells[i][4] + SMALL[i][1];
    colour = vec4(last(grid), local[i][2], single.x);
}
