#version 450
layout(location = 0) out vec4 colour;
subroutine vec4 Shade(vec3 n);
subroutine uniform Shade shade;
void main() { colour = shade(vec3(0.0)); }
