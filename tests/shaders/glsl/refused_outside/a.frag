#version 450
layout(location = 0) out vec4 colour;
#include "../../etc/passwd"
#include "/etc/passwd"
void main() {}
