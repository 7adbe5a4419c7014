#version 450
layout(location = 0) out vec4 colour;
uniform mat2 turn;
void main() { colour = vec4(turn[0], turn[1]); }
