#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `a -= b; // from` => `b -= a; // from`
void swap(inout int a, inout int b) { int old = a; a = b; b = old; }
void split(in float x, out float whole, out float rest) { whole = floor(x); rest = x - whole; x = 0.0; }
void take(inout int a, int b) { a -= b; // from
}
int twice(inout int a, inout int b) { a += 1; b += 10; return a * 100 + b; }
void nest(inout vec3 v) { float part = v.y; split(part, v.x, v.z); }
void fill(out int list[3], int first) { for (int i = 0; i < 3; i++) list[i] = first + i; }
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int list[4] = int[4](ints[base], ints[base + 1], ints[base + 2], ints[base + 3]);
    swap(list[0], list[3]);
    swap(list[ints[base] & 3], list[1]);
    take(list[2], list[0]);
    int same = ints[base + 4];
    int seen = twice(same, list[1]);
    ivec3 v = ivec3(1, 2, 3);
    swap(v.x, v.z);
    take(v.y, v.x);
    vec3 f = vec3(floats[base], floats[base + 1], 0.0);
    nest(f);
    float whole, rest;
    split(floats[base + 2], whole, rest);
    int filled[3];
    fill(filled, list[3]);
    for (int i = 0; i < 4; i++) ints[base + i] = list[i];
    ints[base + 4] = same; ints[base + 5] = seen;
    ints[base + 6] = v.x; ints[base + 7] = v.y; ints[base + 8] = v.z;
    ints[base + 9] = filled[0] + filled[1] * 3 + filled[2] * 7;
    floats[base] = f.x; floats[base + 1] = f.y; floats[base + 2] = f.z; floats[base + 3] = whole; floats[base + 4] = rest;
}
