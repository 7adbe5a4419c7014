#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
uniform texture2D map;
uniform sampler plain;
uniform samplerShadow compare;
void main() {
    colour = texture(sampler2D(map, plain), x.xy) + texture(sampler2DShadow(map, compare), x);
}
