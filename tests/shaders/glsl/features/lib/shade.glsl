#pragma once
#include "inner/sheen.glsl"
#include "inner/guarded.glsl"
#include "../lib/inner/guarded.glsl"
#include <shade.glsl>
