#version 420
struct DrawData { mat4 world_from_object; };
layout(std140) uniform Frame { mat4 clip_from_world; float time_s; };
uniform DrawData draw;
in vec3 position;
out vec3 at;
void main() { at = position * time_s; gl_Position = clip_from_world * draw.world_from_object * vec4(position, 1.0); }
