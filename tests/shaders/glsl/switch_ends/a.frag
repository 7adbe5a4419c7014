#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
float pick(int kind) {
    switch (kind) {
        case 0: return 1.0;
        case 1: { float y = 2.0; if (x.x > 0.0) break; return y; }
        case 2: if (x.y > 1.0) { return 3.0; } else { return 4.0; }
        default: discard;
    }
    switch (kind) { default: switch (kind) { case 7: case 8: { break; } } }
    return 5.0;
}
void main() { colour = vec4(pick(int(x.z))); }
