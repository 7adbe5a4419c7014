#version 450
uniform sampler2DArray layers;
layout(location = 0) out vec4 colour;
void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    colour = texture(layers, vec2(0.5)) + vec4(texel, 0.0, 1.0);
}
