#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `LOD(i, uv, 0.0)` => `LOD((i + 1) % 3, uv, 0.0)`
#ifdef KILN
layout(set = 1, binding = 0) uniform sampler2D t[3];
vec4 through(sampler2D given[3], int i, vec2 uv) { return textureLod(given[i], uv, 1.0) + textureLod(given[2], uv, 0.0); }
#define LOD(i, uv, level) textureLod(t[i], uv, level)
#define LOD_OFFSET(i, uv, level) textureLodOffset(t[i], uv, level, ivec2(1, -1))
#define GRAD(i, uv, dx, dy) textureGrad(t[i], uv, dx, dy)
#define FETCH(i, p, level) texelFetch(t[i], p, level)
#define SIZE(i, level) textureSize(t[i], level)
#define THROUGH(i, uv) through(t, i, uv)
#else
layout(set = 1, binding = 0) uniform texture2D t0;
layout(set = 1, binding = 1) uniform texture2D t1;
layout(set = 1, binding = 2) uniform texture2D t2;
layout(set = 1, binding = 5) uniform sampler s;
vec4 LOD(int i, vec2 uv, float level) {
    if (i == 0) return textureLod(sampler2D(t0, s), uv, level);
    if (i == 1) return textureLod(sampler2D(t1, s), uv, level);
    return textureLod(sampler2D(t2, s), uv, level);
}
vec4 LOD_OFFSET(int i, vec2 uv, float level) {
    if (i == 0) return textureLodOffset(sampler2D(t0, s), uv, level, ivec2(1, -1));
    if (i == 1) return textureLodOffset(sampler2D(t1, s), uv, level, ivec2(1, -1));
    return textureLodOffset(sampler2D(t2, s), uv, level, ivec2(1, -1));
}
vec4 GRAD(int i, vec2 uv, vec2 dx, vec2 dy) {
    if (i == 0) return textureGrad(sampler2D(t0, s), uv, dx, dy);
    if (i == 1) return textureGrad(sampler2D(t1, s), uv, dx, dy);
    return textureGrad(sampler2D(t2, s), uv, dx, dy);
}
vec4 FETCH(int i, ivec2 p, int level) {
    if (i == 0) return texelFetch(sampler2D(t0, s), p, level);
    if (i == 1) return texelFetch(sampler2D(t1, s), p, level);
    return texelFetch(sampler2D(t2, s), p, level);
}
ivec2 SIZE(int i, int level) { return textureSize(sampler2D(t0, s), level); }
vec4 THROUGH(int i, vec2 uv) { return LOD(i, uv, 1.0) + LOD(2, uv, 0.0); }
#endif
float sum(vec4 v) { return dot(v, vec4(1.0, 2.0, 4.0, 8.0)); }
void main() {
    int id = int(gl_GlobalInvocationID.x);
    int base = id * 16;
    int i = abs(ints[base]) % 3;
    vec2 uv = vec2(floats[base], floats[base + 1]) * 0.37 + 0.11;
    ivec2 p = abs(ivec2(ints[base + 1], ints[base + 2])) & ivec2(1);
    floats[base] = sum(LOD(0, uv, 0.0));
    floats[base + 1] = sum(LOD(1, uv, 0.25));
    floats[base + 2] = sum(LOD(i, uv, 0.0));
    floats[base + 3] = sum(LOD(i, uv, 1.0));
    floats[base + 4] = sum(FETCH(2, p, 0));
    floats[base + 5] = sum(FETCH(i, p, 1));
    floats[base + 6] = sum(GRAD(1, uv, vec2(0.5, 0.0), vec2(0.0, 0.5)));
    floats[base + 7] = sum(GRAD(i, uv, vec2(0.25, 0.0), vec2(0.0, 0.25)));
    floats[base + 8] = sum(LOD_OFFSET(i, uv, 0.0));
    floats[base + 9] = sum(THROUGH(i, uv));
    float all = 0.0;
    for (int k = 0; k < 3; k++) all = all * 3.0 + sum(LOD(k, uv, float(k & 1)));
    floats[base + 10] = all;
    ints[base] = SIZE(i, 0).x * 10 + SIZE(1, 1).y;
}
