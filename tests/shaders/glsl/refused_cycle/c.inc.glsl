#include "b.inc.glsl"
