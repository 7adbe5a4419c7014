#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { int data[]; };
struct Part { float a; };
void main() {
    Part here = Part(1.0);
    data[0] = int(here < here);
}
