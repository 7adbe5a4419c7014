#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `list[i++] += value(10);` => `list[++i & 7] += value(10);`
int state = 3;
int value(int step) { state = state * 3 + step; return state & 31; }
int three(int a, int b, int c) { return a + b * 10 + c * 100; }
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    state += ints[base] & 7;
    int list[8];
    for (int n = 0; n < 8; n++) list[n] = n + ints[base + n];
    int i = 0;
    list[i++] += value(10);
    list[i++]++;
    --list[value(1) & 7];
    list[value(2) & 7] *= 2;
    ivec2 pairs[3] = ivec2[3](ivec2(1), ivec2(2), ivec2(3));
    pairs[i++].x -= value(3);
    pairs[(i--) % 3].yx += ivec2(value(4), 5);
    list[list[i++] & 7]++;
    list[i += 1] |= i;
    int x = i++ + i * 2 + value(5) * value(6) - value(7);
    int y = three(value(1), value(2), i++ + i);
    int z = (i = 5, i++, i + value(8));
    x += y -= z *= 2;
    int w = list[0] > 3 && list[i--]++ > 1 ? list[i] -= 2 : -list[1];
    vec3 v = vec3(value(1), value(2), value(3));
    for (int n = 0; n < 8; n++) ints[base + n] = list[n];
    ints[base + 8] = i; ints[base + 9] = x; ints[base + 10] = y; ints[base + 11] = z; ints[base + 12] = w;
    ints[base + 13] = pairs[0].x + pairs[0].y * 3 + pairs[1].x * 5 + pairs[1].y * 7 + pairs[2].x * 11 + pairs[2].y * 13;
    ints[base + 14] = state;
    floats[base] = v.x + v.y * 2.0 + v.z * 4.0;
}
