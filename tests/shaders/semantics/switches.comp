#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `sum += 100; // one` => `sum += 101; // one`
int fall(int x) {
    int sum = 0;
    switch (x & 7) {
    case 0:
        sum += 1;
    case 1:
    case 2:
        sum += 10;
        if ((x & 8) != 0) break;
        sum += 100; // one
    default:
        sum += 1000;
        break;
    case 4: {
        sum += 5;
        break;
    }
    case 5:
        return -x;
    case 6:
        sum -= 7;
    }
    return sum;
}
int inner(int x) {
    int sum = 0;
    for (int i = 0; i < 9; i++) {
        switch ((x + i) % 4) {
        case 0: continue;
        case 1: sum += i; break;
        case 2:
            switch (i & 1) { case 0: sum += 50; default: sum += 3; }
            break;
        default:
            if (i > 6) return sum * 1000 + i;
        }
        sum += 100;
    }
    return sum;
}
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    for (int i = 0; i < 12; i++) ints[base + i] = fall(abs(ints[base + i]) + i);
    for (int i = 12; i < 16; i++) ints[base + i] = inner(abs(ints[base + i]) % 16);
}
