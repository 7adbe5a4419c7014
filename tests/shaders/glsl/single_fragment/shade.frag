#version 460
#include "local.glsl"
#include <common/shared.glsl>
layout(location = 2) in vec3 normal;
in vec2 free;
layout(location = 0) out vec4 colour;
layout(location = 1) out uvec2 ids;
layout(early_fragment_tests) in;
void main() { colour = vec4(normal * local() * shared_value(), 1.0) + free.xyxy; ids = uvec2(1u, 2u); }
