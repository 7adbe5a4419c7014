#version 450
layout(local_size_x = 1) in;
layout(std140, binding = 0) uniform Early { layout(offset = 16) vec4 a; };
layout(std140, binding = 1) uniform Odd { vec4 b; layout(offset = 24) vec4 c; };
layout(std140, binding = 2) uniform Over { vec4 d; layout(offset = 8) float e; };
layout(std140, binding = 3) uniform Skewed { vec4 f; layout(align = 24) float g; };
layout(std430, binding = 4) buffer Data { float data[]; };
void main() { data[0] = a.x + b.x + c.x + d.x + e + f.x + g; }
