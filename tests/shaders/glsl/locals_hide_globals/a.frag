#version 450
layout(location = 0) out vec4 colour;
uniform sampler2D albedo;
uniform bool lit;
uniform float weights[2];
layout(location = 0) in vec2 uv;
float shade(float lit, vec2 weights) { return lit * weights.x; }
vec3 read(sampler2D texture_at) { vec3 albedo = texture(texture_at, uv).rgb; return albedo * albedo; }
void main() {
    vec3 albedo = texture(albedo, uv).rgb * read(albedo);
    { float lit = 1.0; albedo *= lit; }
    if (lit) albedo += shade(weights[1], vec2(0.5));
    colour = vec4(albedo, 1.0);
}
