#version 450
layout(location = 0) out vec4 colour;
float f(float x) { return x > 1.0 ? f(x - 1.0) : 0.0; }
void main() { colour = vec4(f(2.0)); }
