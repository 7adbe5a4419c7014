#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
int at;
int next() { return at++; }
void main() {
    float arr[4] = float[4](1.0, 2.0, 3.0, 4.0);
    vec2 pairs[4];
    int idx = 0;
    arr[next()] += 1.0;
    arr[idx++] *= 2.0;
    pairs[idx++].x++;
    ++arr[next()];
    arr[idx++] = 3.0;
    data[0] = arr[0] + pairs[0].x;
}
