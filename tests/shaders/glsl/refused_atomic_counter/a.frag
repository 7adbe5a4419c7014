#version 450
layout(location = 0) out vec4 colour;
layout(binding = 0) uniform atomic_uint counter;
void main() { colour = vec4(atomicCounterIncrement(counter)); }
