#version 450
layout(location = 0) out vec4 colour;
uniform usampler2D ids;
void main() { colour = vec4(texture(ids, vec2(0.5))); }
