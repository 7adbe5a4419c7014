#version 330
struct S { float a; };
out vec2 v_uv;
out vec3 v_normal;
out S whole;
void main() { v_uv = vec2(0.0); v_normal = vec3(0.0); gl_Position = vec4(0.0); }
