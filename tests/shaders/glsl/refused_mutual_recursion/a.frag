#version 450
layout(location = 0) out vec4 colour;
float g(float x);
float f(float x) { return g(x); }
float g(float x) { return f(x); }
void main() { colour = vec4(f(1.0)); }
