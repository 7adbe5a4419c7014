#version 450
layout(location = 0) out vec4 colour;
struct Pair { float a; vec2 b; };
struct Outer { Pair inner; float c; };
struct Turned { float angle; mat3x4 m; };
uniform float before;
uniform Pair pair;
uniform float between;
uniform Pair pairs[3];
uniform Outer outer;
uniform Turned turned;
layout(std140) uniform Own { float first; Pair second; float third; } own;
void main() {
    Pair local = pairs[1];
    colour = vec4(before + pair.a + between, local.b, outer.inner.a + outer.c) + turned.m[0] * own.second.a * own.third;
}
