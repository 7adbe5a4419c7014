#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
layout(std140, binding = 1) uniform Lights { vec4 at[2]; } lights;
struct Part { float a; };
struct Inner { ivec2 pair; float list[3]; };
struct Outer { Part parts[2]; Inner more[2]; vec2 grid[2][2]; };
Inner make(float a) { return Inner(ivec2(1), float[3](a, 2.0, 3.0)); }
void main() {
    Part there[2] = Part[2](Part(1.0), Part(2.0));
    Outer outer;
    outer.parts = there;
    outer.more = Inner[2](make(1.0), make(2.0));
    float list[3] = outer.more[1].list;
    vec2 grid[2][2] = outer.grid;
    outer.grid[1] = grid[0];
    vec4 at[2] = lights.at;
    data[0] = float(outer.more[0] == outer.more[1]) + float(list == float[3](1.0, 2.0, 3.0)) + at[1].x + grid[1][1].y;
}
