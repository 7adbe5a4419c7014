#version 450
const int N = 2;
struct Part { float a; ivec2 b; mat3 m; };
struct Whole { Part parts[N]; bool on; float grid[2][3]; };
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { int data[]; };
layout(std140, binding = 1) uniform Block { vec4 v; vec4 w[2]; } block;
Part global;
Part make(float a) { return Part(a, ivec2(1), mat3(a)); }
bool same(Part one, Part[N] more) { return one == more[0] && more[1] != one; }
void main() {
    Part here = make(1.0), there[2] = Part[2](make(1.0), make(2.0));
    Whole whole;
    whole.parts[1] = there[0];
    float list[3] = float[](1.0, 2.0, 3.0);
    data[0] = int(here == there[0]);
    data[1] = int(whole == whole) + int(make(2.0) != there[1]) + int(make(3.0) == Part(3.0, ivec2(1), mat3(3.0)));
    if (global == (data[1] > 1 ? here : there[1])) data[2] = 1;
    data[3] = int(list == float[3](1.0, 2.0, 3.0)) + int(list != float[N + 1](1.0, 2.0, 4.0)) + int(same(here, there));
    data[4] = int((here == global) == (there == Part[2](here, here))) + int(block.w[0] == block.v);
    { int here = 3; data[5] = int(here == data[0]); }
}
