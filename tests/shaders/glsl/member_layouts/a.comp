#version 450
layout(local_size_x = 1) in;
const int FAR = 128;
layout(std140, binding = 0) uniform Moved {
    layout(offset = 0) float first;
    layout(offset = 32) vec4 second;
    layout(align = 64) vec3 third;
    float fourth;
    layout(offset = FAR, align = 16) float list[2];
    vec2 last;
} moved;
layout(std140, binding = 1, align = 32) uniform Spread { vec2 a; float b; bool c; };
layout(std430, binding = 2) buffer Data { float head; layout(offset = 32) vec2 pair; layout(align = 16) float data[]; };
void main() {
    data[0] = moved.first + moved.second.x + moved.third.x + moved.fourth + moved.list[1] + moved.last.x;
    data[1] = a.x + b + (c ? 1.0 : 0.0) + pair.x + head;
}
