#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { uint count; float data[]; };
layout(std430, binding = 1) readonly buffer More { vec4 values[]; } more;
struct Lamp { vec4 at[2]; vec3 color; };
layout(std430, binding = 2) readonly buffer Lamps { Lamp lamps[]; };
void main() {
    for (int i = 0; i < data.length(); ++i) data[i] = float(more.values.length());
    count = uint(lamps.length() + lamps[0].at.length());
}
