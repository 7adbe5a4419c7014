#version 450
layout(local_size_x = 1) in;
uniform sampler2DShadow one;
uniform sampler2DArrayShadow many;
uniform samplerCubeShadow cube;
uniform sampler2DArray layers;
layout(std430, binding = 0) buffer Out { float result[]; };
void main() {
    vec4 p = vec4(0.5);
    // No stage without derivatives chooses a level: these read the first.
    result[0] = texture(one, p.xyz) + texture(many, p) + texture(cube, p);
    result[1] = textureLod(one, p.xyz, 0.0) + textureProj(one, p);
    result[2] = textureOffset(layers, p.xyz, ivec2(1, 0)).x;
    // What WGSL has not is said.
    result[3] = textureLod(one, p.xyz, 2.0);
    result[4] = textureGrad(one, p.xyz, vec2(1.0), vec2(1.0));
}
