#version 450
layout(location = 0) out vec4 colour;

#include <shade.glsl>
uniform vec4 NAME;
void main() {
    colour = tint * float(SAMPLES) * shared_scale();
#if FEATURE_SHEEN && FEATURE_ALPHA_MASK
    colour += sheen();
#endif
#ifdef FEATURE_CLEARCOAT
    colour += missing();
#endif
}
