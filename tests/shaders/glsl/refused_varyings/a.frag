#version 330
in vec2 v_vu;
in vec4 v_normal;
out vec4 c;
uniform float scale;
void main() { c = v_normal * v_vu.x; }
