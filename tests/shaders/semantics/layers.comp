#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `vec3(uv, 1.9)` => `vec3(uv, 1.4)`
#ifdef KILN
layout(set = 1, binding = 3) uniform sampler2DArray layers;
layout(set = 1, binding = 4) uniform sampler2DArrayShadow shadows;
#define LAYERS layers
#define SHADOWS shadows
#else
layout(set = 1, binding = 3) uniform texture2DArray layers;
layout(set = 1, binding = 4) uniform texture2DArray shadows;
layout(set = 1, binding = 5) uniform sampler s;
layout(set = 1, binding = 6) uniform samplerShadow compared;
#define LAYERS sampler2DArray(layers, s)
#define SHADOWS sampler2DArrayShadow(shadows, compared)
#endif
float sum(vec4 v) { return dot(v, vec4(1.0, 2.0, 4.0, 8.0)); }
void main() {
    int id = int(gl_GlobalInvocationID.x);
    int base = id * 16;
    // Never halfway between layers, where the specifications of OpenGL and Vulkan differ; some lie before the first and
    // some behind the last.
    float layer = float(id) * 0.7 - 0.6 + 0.03;
    vec2 uv = vec2(floats[base], floats[base + 1]) * 0.37 + 0.11;
    floats[base] = sum(textureLod(LAYERS, vec3(uv, layer), 0.0));
    floats[base + 1] = sum(textureLod(LAYERS, vec3(uv, 1.0), 1.0));
    floats[base + 2] = sum(textureLod(LAYERS, vec3(uv, 1.9), 0.5));
    floats[base + 3] = sum(textureGrad(LAYERS, vec3(uv, layer), vec2(0.5, 0.0), vec2(0.0, 0.5)));
    floats[base + 4] = sum(textureLodOffset(LAYERS, vec3(uv, layer), 0.0, ivec2(1, 2)));
    floats[base + 5] = sum(textureGradOffset(LAYERS, vec3(uv, layer), vec2(0.2), vec2(0.1), ivec2(-1, 1)));
    floats[base + 6] = sum(texture(LAYERS, vec3(uv, layer + 0.4)));
    floats[base + 7] = sum(texelFetch(LAYERS, ivec3(1, 2, clamp(id, 0, 3)), 0));
    float lit = 0.0;
    for (int k = 0; k < 8; k++) lit = lit * 2.0 + texture(SHADOWS, vec4(uv + float(k) * 0.26, layer, 0.5));
    floats[base + 8] = lit;
    ints[base] = textureSize(LAYERS, 0).z;
}
