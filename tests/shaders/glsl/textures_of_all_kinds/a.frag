#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
uniform sampler1D t1;
uniform sampler2D t2;
uniform sampler3D t3;
uniform samplerCube tc;
uniform sampler2DArray t2a;
uniform samplerCubeArray tca;
uniform sampler2DShadow s2;
uniform sampler2DArrayShadow s2a;
uniform samplerCubeShadow sc;
uniform isampler2D i2;
uniform usampler3D u3;
uniform sampler2DMS ms;
layout(set = 3, binding = 30) uniform texture2D separate;
layout(set = 3, binding = 31) uniform sampler separate_sampler;
vec4 one(const in sampler2D map, vec2 at) { return texture(map, at); }
float two(in sampler2DShadow map, samplerCube other) { return texture(map, x) + texture(other, x).x; }
vec4 nested(vec2 at, sampler2D map) { return one(map, at) + one(t2, one(map, at).xy); }
void main() {
    colour = texture(t1, x.x) + texture(t2, x.xy) + texture(t3, x) + texture(tc, x);
    colour += texture(t2a, x) + texture(tca, vec4(x, 1.0));
    colour += texture(s2, x) + texture(s2a, vec4(x, 0.5)) + texture(sc, vec4(x, 0.5));
    colour += vec4(texelFetch(i2, ivec2(x.xy), 0)) + vec4(texelFetch(u3, ivec3(x), 0)) + texelFetch(ms, ivec2(0), 1);
    colour += nested(x.xy, t2) + two(s2, tc) + vec4(textureSize(t2, 0), textureQueryLevels(tc), 1);
    colour += textureLod(tc, x, 1.0) + textureGrad(t2, x.xy, dFdx(x.xy), dFdy(x.xy)) + textureProj(t2, x);
    colour += textureOffset(t2, x.xy, ivec2(1, 0)) + texture(sampler2D(separate, separate_sampler), x.xy);
}
