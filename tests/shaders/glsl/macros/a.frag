#version 450
layout(location = 0) out vec4 colour;
#define PI 3.14159
#define SQUARE(x) ((x) * (x))
#define JOIN(a, b) a##b
#define LIGHT(n) JOIN(light_, n)
#define SELF SELF
#define EMPTY
#define MULTI(a, \
              b) (a + \
                  b)
uniform vec4 light_0, light_1;
float SELF = float(__LINE__) * float(__VERSION__);
/* a comment
   over lines */ void main() {
    colour = LIGHT(0) + LIGHT(1) * SQUARE(PI + EMPTY 1.0) + MULTI(SQUARE(SQUARE(2.0)), SELF);
#undef PI
#ifdef PI
#error never
#elif defined(SQUARE) && (1 + 2 * 3 == 7) && (0x10 >> 2) == 4 && !defined UNKNOWN && (-1 < 0 || 1 / 1 != 0)
    colour *= 2.0; // kept \
    colour *= 1000.0;
#else
    colour *= 3.0;
#endif
#line 200
}
