#version 330
uniform Tint { vec3 tint; };
void main() { gl_Position = vec4(tint, 1.0); }
