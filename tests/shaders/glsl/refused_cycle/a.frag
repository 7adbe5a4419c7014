#version 450
layout(location = 0) out vec4 colour;
#include "b.inc.glsl"
void main() {}
