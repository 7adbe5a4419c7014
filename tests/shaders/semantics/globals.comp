#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `counter + 2;` => `counter + 3;`
const int SIZE = 2 * 2;
const float TABLE[SIZE] = float[](0.5, 1.5, -2.0, 8.0);
const vec2 HALF = vec2(1.0, 2.0) / 2.0;
int counter = 5;
int next = counter + 2;
float scale = sqrt(TABLE[3] * 2.0);
float pick(int i);
float pick(float x) { return x * 2.0; }
float pick(vec2 v) { return v.x - v.y; }
int bump() { return ++counter; }
float pick(int i) { return TABLE[i & (SIZE - 1)] * scale; }
shared int board[8];
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int me = int(gl_LocalInvocationIndex);
    board[me] = ints[base] * 2;
    barrier();
    ints[base] = board[7 - me] + int(gl_WorkGroupSize.x);
    int counter_ = bump() * 10 + bump();
    ints[base + 1] = counter_ + counter + next;
    floats[base] = pick(ints[base + 2]) + pick(floats[base]) + pick(HALF.yx);
    { int counter = 40; counter++; ints[base + 2] = counter; }
    float pick_ = 3.0;
    for (int bump = 0; bump < 3; bump++) pick_ += float(bump);
    floats[base + 1] = pick_ + float(SIZE);
    floats[base + 2] = TABLE[(ints[base + 3] & 0x7fffffff) % SIZE];
}
