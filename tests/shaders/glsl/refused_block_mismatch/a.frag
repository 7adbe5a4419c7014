#version 330
uniform Tint { vec4 tint; };
out vec4 c;
void main() { c = tint; }
