#version 450
layout(location = 0) out vec4 colour;
uniform image2D picture;
void main() { colour = imageLoad(picture, ivec2(0)); }
