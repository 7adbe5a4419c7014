#version 450
layout(location = 0) out vec4 colour;
void main() { int i = 0; do { if (i == 1) continue; i++; } while (i < 3); colour = vec4(i); }
