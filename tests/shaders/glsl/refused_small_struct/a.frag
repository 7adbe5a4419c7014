#version 450
layout(location = 0) out vec4 colour;
struct Pair { float a; float b; };
uniform Pair pairs[3];
void main() { Pair p = Pair(1.0, 2.0); colour = vec4(p.a + pairs[1].b); }
