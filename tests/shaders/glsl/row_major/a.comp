#version 450
layout(local_size_x = 1) in;
layout(row_major) uniform;
layout(std140, binding = 0) uniform Turned { mat4 turn; layout(column_major) mat4 plain; vec4 v; mat3 many[2]; } u;
layout(std140, column_major, binding = 1) uniform Other { layout(row_major) mat4x3 wide; mat3 square; };
layout(std430, row_major, binding = 2) readonly buffer Source { mat3x4 rows[]; };
layout(std430, binding = 3) buffer Data { vec4 data[]; };
vec4 use(mat4 m) { return m * u.v; }
void main() {
    data[0] = u.turn * u.v + u.turn[1] + vec4(u.turn[2][3]) + u.plain * u.v + use(u.turn);
    data[1] = vec4(u.many[1] * u.v.xyz + wide * u.v + wide[3] + square[0], u.many[0][1].y);
    data[2] = rows[1] * u.v.xyz + rows[0][1];
}
