#version 450
layout(location = 0) out vec4 colour;
#define
#define 3 x
#define __LINE__ 7
#define F(a b) a
#define G(a
#define PASTE ## a
#undef
#ifdef
#endif
#else
#endif
#if 09
#elif 1.5
#endif
#if 1
#else
#else
#elif 1
#endif
#extension
#pragma unknown to kiln
#version
void main() {}
