#version 450
#extension GL_ARB_separate_shader_objects : enable
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 uv0;
layout(location = 0) out vec2 v_uv;
layout(set = 0, binding = 0) uniform Frame { mat4 clip_from_world; } frame;
layout(push_constant) uniform Push { mat4 world_from_object; } push;
void main() {
    v_uv = uv0;
    gl_Position = frame.clip_from_world * push.world_from_object * vec4(position, 1.0);
}
