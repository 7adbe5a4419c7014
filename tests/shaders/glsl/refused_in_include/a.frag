#version 450
layout(location = 0) out vec4 colour;
#include "lib/a.inc.glsl"
void main() { colour = vec4(shade(1.0)); }
