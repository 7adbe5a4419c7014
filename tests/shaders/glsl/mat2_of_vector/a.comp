#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { float data[]; };
const vec4 CORNERS = vec4(1.0, 2.0, 3.0, 4.0);
const mat2 TURN = mat2(CORNERS);
mat2 other = mat2(vec4(1.0));
void main() {
    mat2 a = mat2(cos(data[0] + vec4(0, 33, 11, 0)));
    mat3 m = mat3(2.0);
    mat2 b = mat2(m) * mat2(2.0) * mat2(data[1]) * mat2(m * 2.0) * mat2x2(a[0].xyxy);
    data[0] = a[0].x + b[1].y + TURN[1].x + other[0].x;
}
