#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
void main() { colour = vec4(normalise(x), 1.0); }
