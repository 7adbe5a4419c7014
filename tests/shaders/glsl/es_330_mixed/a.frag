#version 450
layout(location = 0) out vec4 colour;
#define highp
#define lowp
uniform sampler2D a_texture;
in vec2 uv;
void main() { highp vec4 x = texture(a_texture, uv, 0.5); colour = x; }
