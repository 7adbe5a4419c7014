#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
uniform sampler2D texture_map;
uniform float target, loop, fn, var, self, mod2;
layout(set = 3, binding = 9) uniform Block { vec4 ref; float final; } private;
float let(float type) { float match = type; return match * distance(x, x); }
void main() {
    float storage = let(target) + loop + fn + var + self + mod2;
    colour = texture(texture_map, x.xy) * private.ref * private.final * storage;
}
