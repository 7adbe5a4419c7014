#version 330
#include "common.inc.glsl"
uniform vec3 tint;
float helper() { return 3.0; }
out vec4 c;
void main() { c = vec4(tint * twice(helper()) * lights[1].at * gain(0), 1.0); }
