#version 450
layout(location = 0) out vec4 colour;
float a;
float a() { return 1.0; }
void main() { float b = 1.0; float b = 2.0; colour = vec4(b); }
