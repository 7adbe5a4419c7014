#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
layout(location = 1) flat in uint bits;
void swap(inout float a, inout float b) { float t = a; a = b; b = t; }
float pick(bool first, float a, float b) { return first ? a : b; }
void parts(out vec2 xy, out float z) { xy = x.xy; z = x.z; }
float fade(float a); // announced
void main() {
    precise float a = x.x, b = 2.0;
    swap(a, b);
    vec2 xy; float z;
    parts(xy, z);
    int i = 0;
    while (true) { if (++i > 5) break; if (i == 2) continue; a += 1.0; }
    do { a *= 0.5; for (int k = 0; k < 3; k++) { if (k == 1) continue; b -= 1.0; } } while (a > 1.0);
    uint u = bits & 0xFFu; u ^= 3u; u = ~u; u %= 7u;
    vec4 v = vec4(xy, z, fade(a)); v.zw *= vec2(2.0); v.x = v.y++;
    mat4 m = mat4(1.0); m[3] = v; m[1][2] = 3.0;
    bvec4 lt = lessThan(v, vec4(0.5));
    colour = mix(m * v, vec4(pick(all(lt), a, b)), lt) + float(u) + float(1 << 3) + .5 + 1.f + 2e-3;
    if (colour.a < 0.1) discard;;
}
float fade(float a) { return smoothstep(0.0, 1.0, a); }
