#pragma once
struct Light { vec3 at; int on; };
uniform Light lights[2];
uniform float gains[2];
const float BASE = 2.0;
float helper();
float twice(float x) { return BASE * x * helper(); }
float gain(int i) { return gains[i]; }
