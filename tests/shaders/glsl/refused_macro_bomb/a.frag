#version 450
layout(location = 0) out vec4 colour;
#define A x x x x x x x x x x
#define B A A A A A A A A A A
#define C B B B B B B B B B B
#define D C C C C C C C C C C
#define E D D D D D D D D D D
#define G E E E E E E E E E E
void main() { G }
