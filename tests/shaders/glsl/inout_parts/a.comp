#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
struct Part { float weight; vec3 at[2]; };
void inc(inout float a) { a += 1.0; }
void two(out float a, inout float b) { a = 1.0; b += a; }
void both(inout float a, inout float b) { a += 1.0; b += 2.0; }
float grow(inout vec3 a) { a *= 2.0; return a.x; }
void deep(inout Part part) { inc(part.weight); inc(part.at[1].y); }
void main() {
    vec4 v = vec4(data[0]);
    float a[3] = float[3](1.0, 2.0, 3.0);
    mat2 m = mat2(1.0);
    Part part;
    int n = int(data[1]);
    two(v.x, v.z);
    inc(a[n]);
    inc(a[1]);
    inc(m[1][0]);
    inc(data[n]);
    deep(part);
    both(v.w, v.w);
    float g = grow(part.at[n]);
    if (n > 1 && grow(part.at[0]) > 1.0) inc(part.weight);
    data[0] = v.x + v.z + a[0] + a[1] + m[1][0] + part.weight + part.at[1].y + g;
}
