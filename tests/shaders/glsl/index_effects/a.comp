#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
struct Part { vec2 pair[2]; };
int at;
int next() { return at++; }
void main() {
    float arr[4] = float[4](1.0, 2.0, 3.0, 4.0);
    int ints[4] = int[4](0, 1, 2, 3);
    vec2 pairs[4];
    Part parts[2];
    uint idx = 0u;
    arr[next()] += 1.0;
    arr[idx++] *= 2.0, arr[3] = 1.0;
    pairs[idx++].x++;
    if (idx > 1u) ++arr[next()]; else --arr[next()];
    parts[next() & 1].pair[idx & 1u].y -= idx > 2u ? 1.0 : 2.0;
    arr[ints[next()]++] += 1.0;
    float f = arr[0] > 1.0 && arr[idx--]++ > 1.0 ? arr[idx++] += 2.0 : 3.0;
    arr[idx++] = 3.0;
    arr[idx] += float(idx++);
    data[0] = arr[0] + pairs[0].x + f + parts[0].pair[0].y;
}
