#version 330
#include "common.inc.glsl"
uniform mat4 bones[2];
float helper() { return 2.0; }
in vec3 position;
void main() { gl_Position = bones[1] * vec4(position * twice(helper()) * gain(1), float(lights[0].on)); }
