#version 450
layout(local_size_x = 1) in;
struct Part { mat4 m; };
layout(std140, row_major, binding = 0) uniform Frame { mat4 clip_from_world; };
layout(std140, row_major, binding = 1) uniform Parts { Part part; mat4 many[2]; vec4 v; };
layout(std430, row_major, binding = 2) buffer Data { mat4 stored; layout(offset = N) float data[]; };
layout(std430, row_major, binding = 3) readonly buffer Flat { mat4 rows[]; } flat_;
layout(row_major) uniform mat4 loose;
layout(offset = 16) uniform vec4 far;
mat4 first(mat4 list[2]) { return list[0]; }
void main() { data[0] = clip_from_world[0].x + first(many)[0].x + loose[0].x + far.x; }
