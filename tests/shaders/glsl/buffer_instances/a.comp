#version 450
layout(local_size_x = 64) in;
struct Light { vec4 color; vec3 at; float range; };
layout(std430, binding = 1) readonly buffer Lights { int count; Light all[]; } lights;
layout(std430, binding = 2) buffer Sums { int count; vec4 last; float sums[]; } result;
layout(std430, binding = 3) buffer Fixed { int first; float four[4]; } plain;
float half_of(float lights) { return lights * 0.5; }
void add(inout int a) { a += 1; }
void main() {
    uint at = gl_GlobalInvocationID.x;
    for (int i = 0; i < lights.count; i++) {
        result.sums[at] += lights.all[i].range * half_of(lights.all[i].color.x);
        result.last = lights.all[i].color;
    }
    result.count += lights.count;
    result.last.xy *= 2.0;
    add(result.count);
    plain.first = lights.count;
    plain.four[2] = result.sums[at];
}
