#version 330
uniform vec4 tint;
out vec4 c;
void main() { c = tint; }
