#version 330
out vec2 v_uv;
const vec2 corners[3] = vec2[3](vec2(-1.0, -1.0), vec2(3.0, -1.0), vec2(-1.0, 3.0));
void main() {
    vec2 corner = corners[gl_VertexID];
    v_uv = corner * vec2(0.5, -0.5) + 0.5;
    gl_Position = vec4(corner, 1.0, 1.0);
}
