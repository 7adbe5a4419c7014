#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { int data[]; };
struct Part { float list[3]; };
void main() {
    Part part;
    float list[3];
    data[0] = int(part.list == list);
}
