#version 450
layout(location = 0) out vec4 colour;
const vec2 CORNERS[] = vec2[](vec2(0.0), vec2(1.0, 0.0), vec2(1.0));
const float[] KERNEL = float[](0.25, 0.5, 0.25);
const int N = 2, M = N * 2;
float table[M], scale = 2.0;
vec3 up = normalize(vec3(0.0, 1.0, 1.0));
const vec3 SIDE = normalize(vec3(1.0, 1.0, 0.0));
const vec3 BOTH = SIDE + vec3(1.0);
float sum(const float values[3]) { float s = 0.0; for (int i = 0; i < values.length(); i++) s += values[i]; return s; }
void main() {
    float local[2], single = 1.0;
    const float a[2] = float[](1.0, 2.0), b = 3.0;
    vec2 list[] = { vec2(1.0), vec2(2.0) };
    local[1] = a[1] + b + single;
    table[3] = scale;
    colour = vec4(up + BOTH, sum(KERNEL) + local[1] + table[3]) + CORNERS[2].xyxy + list[1].xyxy + float(KERNEL.length());
}
