#version 450
layout(location = 0) out vec4 colour;
struct S { float shine; };
void main() {
    S s = S(1.0);
    colour = vec4(s.shyne) + colour.xyq;
}
