#error from below
#define JOIN(a, b) a ## b
float y = JOIN(1., +);
