#version 330
#pragma shader_stage(fragment)
out vec4 c;
void main() { c = vec4(1.0); }
