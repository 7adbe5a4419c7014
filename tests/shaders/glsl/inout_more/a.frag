#version 330
struct Part { float weight; };
out vec4 color;
int count;
Part global;
bool lights(float a) { return a > 0.5; }
void inc(inout float a) { a += 1.0; }
void inc_all(inout float a, inout vec2 b) { a += b.x; b += 1.0; }
int step_of(inout int i) { return i++; }
void chain(inout float a) { inc(a); }
bool either(bool a, inout float b) { return a || (b++ > 2.0); }
void main() {
    float a[2] = float[2](0.0, 1.0);
    float b = 0.0;
    int i = 0;
    vec2 uv = vec2(0.0);
    chain(a[i]);
    inc(global.weight);
    inc_all(b, uv);
    inc_all(b, uv.yx);
    inc_all(uv.x, uv);
    int lights = step_of(i);
    for (int j = 0; j < 3 && either(j > 1, a[j]); j++) {
        for (int k = 0; k < 2; k++) { inc(a[k]); if (k > 0 || either(false, b)) continue; b += 1.0; }
    }
    float c = b > 1.0 && either(true, b) ? a[0] : a[1];
    switch (i) { case 0: if (c > 1.0 && either(true, c)) break; case 1: inc(a[1]); break; default: inc(uv.y); }
    color = vec4(a[0], b, c, global.weight + uv.y + float(lights));
}
