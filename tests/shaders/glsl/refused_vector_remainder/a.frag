#version 450
layout(location = 0) out vec4 colour;
void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) % 8;
    colour = vec4(texel, 0.0, 1.0);
}
