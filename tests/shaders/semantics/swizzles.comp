#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `v.zx = v.xy;` => `v.xz = v.xy;`
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    vec4 v = vec4(floats[base], floats[base + 1], floats[base + 2], floats[base + 3]);
    ivec3 n = ivec3(ints[base], ints[base + 1], ints[base + 2]);
    v.xy = v.yx;
    v.zx = v.xy;
    v.wzyx.xy += vec2(1.0, 2.0);
    v.a *= 3.0; v.st -= v.pq;
    n.yz = n.zy * 2;
    n[abs(n.x) % 3] = 7;
    n.zyx = n;
    v[n.x & 3] += 0.5;
    v.yzw = vec3(v.x, v.xx);
    v.x++; --v.w;
    n.xy++;
    vec2 pair = (v.zw = v.xy) * 2.0;
    vec2 list[2] = vec2[](v.xy, v.zw);
    list[n.z & 1].yx = pair;
    floats[base] = v.x; floats[base + 1] = v.y; floats[base + 2] = v.z; floats[base + 3] = v.w;
    floats[base + 4] = list[0].x; floats[base + 5] = list[0].y; floats[base + 6] = list[1].x; floats[base + 7] = list[1].y;
    ints[base] = n.x; ints[base + 1] = n.y; ints[base + 2] = n.z;
    floats[base + 8] = vec3(1.0, 2.0, 3.0).zyx[n.x & 1] + vec4(pair, v.xy).wzyx.yx.y;
}
