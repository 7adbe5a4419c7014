#include "c.inc.glsl"
