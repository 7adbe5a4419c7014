#ifndef GUARDED
#define GUARDED
#include "guarded.glsl"
float guarded() { return 1.0; }
#endif
