#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `total += k - 2;` => `total += k - 1;`
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int n = abs(ints[base]) % 9 + 2, total = 0;
    for (int i = 0, j = n; i < j; i++, j -= 1) {
        if (i == 3) continue;
        { int i = j * 2; total += i; }
        if (total > 200) break;
    }
    int k = n;
    do { total += k - 2; k--; } while (k > 0);
    while (true) { if (++k > n) break; total += (k % 2 == 0) ? k : -1; }
    ints[base] = total; ints[base + 1] = k;
    int steps = 0;
    for (;;) {
        int j = steps;
        while (j-- > 0) { if (j == 2) continue; total ^= j << 2; if (j == 5) break; }
        if (steps++ >= n) break;
    }
    ints[base + 2] = total; ints[base + 3] = steps;
    float x = floats[base];
    for (float t = 0.0; t < 1.0; t += 0.25) x = x * 0.5 + t;
    floats[base] = x;
    bool done = false;
    uint u = uint(n);
    do { u = u * 3u + 1u; done = u > 1000u; } while (!done);
    ints[base + 4] = int(u);
    for (int a = 0; a < 3; a++) for (int b = a; b < 3; b++) if ((a + b) % 2 == 0) { ints[base + 5 + a] += b; } else ints[base + 8 + b] -= a;
}
