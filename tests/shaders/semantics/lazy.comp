#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `< 0 || touch(2)` => `< 0 && touch(2)`
int log_ = 1;
bool touch(int digit) { log_ = log_ * 5 + digit; return (log_ & 4) != 0; }
int note(int digit) { log_ = log_ * 7 + digit; return digit; }
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int a = ints[base], b = ints[base + 1], c = ints[base + 2];
    bool first = a < 0 || touch(2);
    bool second = b < 0 && touch(3) || c < 0 && !touch(4);
    bool third = (a < b ? touch(1) : touch(0)) && (b < c ? true : touch(2));
    ints[base] = int(first) + 2 * int(second) + 4 * int(third);
    ints[base + 1] = log_;
    int chosen = a < b ? note(3) : b < c ? note(4) + note(5) : note(6);
    ints[base + 2] = chosen;
    ints[base + 3] = log_;
    int count = 0;
    while (count < 5 && touch(count)) count++;
    for (int i = 0; i < 3 && (touch(i) || a > 0); i++) count += 10;
    if (a != 0 && ints[base + 4] / (a == 0 ? 1 : a) > 1) count += 100;
    ints[base + 4] = count;
    ints[base + 5] = log_;
    bool both = a > 0 ^^ touch(1);
    ints[base + 6] = int(both) + log_ * 2;
}
