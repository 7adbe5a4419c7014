#version 450
layout(location = 0) out vec4 colour;
vec5 wrong;
void main() { colour = vec4(1.0); }
