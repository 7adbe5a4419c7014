#version 450
layout(location = 0) out vec4 colour;
uniform sampler2D unsized[];
uniform sampler2D grid[2][2];
uniform sampler2D none[0];
uniform sampler2D lots[17];
uniform sampler2D clash[2];
uniform float clash_1;
void main() {
    colour = vec4(clash_1);
}
