#version 450
layout(location = 0) out vec4 colour;
layout(std430) readonly buffer Data { float values[]; } data;
void main() { colour = vec4(data.values.length()); }
