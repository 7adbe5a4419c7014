#version 330
#include "x.inc.glsl"
void main() { }
