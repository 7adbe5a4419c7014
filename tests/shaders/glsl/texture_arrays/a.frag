#version 450
const int COUNT = 1 + 1;
layout(location = 0) in vec3 x;
layout(location = 1) flat in int chosen;
layout(location = 0) out vec4 colour;
uniform sampler2D maps[3];
layout(set = 3, binding = 7) uniform sampler2D detail_texture[COUNT];
layout(binding = 20) uniform samplerCube skies[2];
uniform sampler2DShadow shadows[2];
uniform sampler2DArray stacks[2];
uniform sampler2DArrayShadow cascades[2];
uniform usampler3D counts[2];
uniform sampler1D ramps[2];
uniform sampler2DMS many[2];
uniform samplerCubeArray probes[2];
uniform int at;
vec4 one(sampler2D map, vec2 uv) { return texture(map, uv); }
vec4 any(sampler2D all[3], int which, vec2 uv) { return texture(all[which], uv) + texture(all[0], uv) * float(all.length()); }
void main() {
    // Constant.
    colour = texture(maps[1], x.xy) + texture(detail_texture[COUNT - 1], x.xy) + texture(skies[0], x);
    colour += one(maps[2], x.xy) + any(maps, chosen, x.xy) + texture(shadows[1], x);
    // Chosen by a loop, a uniform, an input.
    for (int i = 0; i < maps.length(); i++) colour += texture(maps[i], x.xy) + texture(maps[i], x.xy, 1.5);
    colour += texture(skies[at], x) + texture(stacks[at], x) + texture(probes[at], vec4(x, 1.0));
    colour += texture(shadows[at], x) + texture(cascades[chosen & 1], vec4(x, 0.5));
    colour += texture(ramps[at], x.x) + textureLod(maps[chosen], x.xy, 2.0);
    colour += textureGrad(maps[at], x.xy, dFdx(x.xy), dFdy(x.xy)) + textureProj(maps[at], x) + textureProj(maps[at], vec4(x, 1.0));
    colour += textureOffset(maps[at], x.xy, ivec2(1, -1)) + textureLodOffset(maps[at], x.xy, 0.0, ivec2(COUNT, 0));
    colour += vec4(texelFetch(counts[at], ivec3(x), 0)) + texelFetch(many[at], ivec2(0), 1);
    colour += texelFetch(maps[at + 1], ivec2(x.xy), textureQueryLevels(maps[at]) - 1);
    colour += vec4(textureSize(maps[at], 0), textureSize(skies[at], 0)) + vec4(textureSize(stacks[at], 0), 1.0);
}
