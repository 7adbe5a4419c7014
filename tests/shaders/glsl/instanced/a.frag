#version 330
in mat2 turn;
out vec4 c;
void main() { c = vec4(turn[0], turn[1]); }
