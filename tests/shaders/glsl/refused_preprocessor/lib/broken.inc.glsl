#pragma once
#include "deeper.inc.glsl"
