#version 450
layout(local_size_x = 1) in;
layout(std140) buffer;
struct Small { float a; float b; };
struct Holder { vec4 a; float b[3]; };
layout(std140, binding = 0) buffer Values { float values[]; };
layout(std140, binding = 1) buffer Smalls { Small smalls[]; };
layout(std140, binding = 2) buffer Holders { Holder holders[]; };
layout(std140, binding = 3) buffer Matrix { mat2 turned; };
layout(scalar, binding = 4) buffer Tight { vec3 tight[]; };
layout(std430, binding = 5) uniform Weights { float weights[4]; };
void main() {
    values[0] = weights[1];
}
