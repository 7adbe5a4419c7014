#version 450
layout(location = 0) out vec4 colour;
struct Light { vec3 position; float range; vec4 colour; };
uniform struct Sun { vec3 direction; float power; } sun;
uniform Light lights[3];
uniform float weights[5];
uniform vec2 offsets[2];
uniform bool on;
uniform bool switches[3];
uniform bvec3 mask;
uniform int count;
uniform mat3 turn;
uniform mat4 bones[2];
uniform float unused;
uniform float exposure = 1.0;
uniform vec4 base_color_factor, sheen_tint;
uniform vec4 normal_uv_u;
float weight(int i) { return weights[i + int(offsets[1].x)]; }
void main() {
    vec3 on_axis = turn * sun.direction;
    float sum = weight(1) * weights[count] * weights[int(weights[0])];
    for (int on = 0; on < 2; on++) { sum += float(on) * lights[on].range; }
    if (on && !switches[1] && any(mask)) sum *= exposure;
    colour = bones[1] * (base_color_factor * sheen_tint * sum) + vec4(on_axis, sun.power) + normal_uv_u;
}
