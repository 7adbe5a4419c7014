#version 300 es
precision highp float;
in vec3 position;
in vec3 normal;
uniform mat4 clip_from_world;
out mediump vec3 v_normal;
flat out int v_index;
void main() {
    v_normal = normal;
    v_index = gl_VertexID + gl_InstanceID;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
