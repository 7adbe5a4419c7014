#version 330 core
out vec4 colour;
uniform float wetness = 0.5; // @slider(0, 1) how wet
uniform float bias = -0.25; // @slider(-1, 1)
uniform vec3 tint = vec3(1.0, 0.5, 2e-1); // @color(0.1, 0.2, 0.3)
uniform vec3 plain = vec3(1, -2, 3.5f), grey = vec3(0.5);
uniform vec2 size = vec2(64, 32);
uniform int count = 0x10;
uniform bool on = true;
uniform float computed = sqrt(2.0);
uniform float exposure = 2.0;
uniform float weights[2] = float[2](1.0, 2.0);
void main() {
    colour = vec4(tint * plain + grey, wetness + bias + size.x + float(count) + exposure + weights[1] + computed);
    if (on) colour.x = 0.0;
}
