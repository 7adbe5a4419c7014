#version 420
struct Surface { vec4 base_color_factor; float metallic_factor; };
uniform Surface material;
layout(std140) uniform Frame { mat4 clip_from_world; float time_s; };
layout(binding = 0) uniform sampler2D first;
layout(binding = 0, std140) uniform Own { vec4 tint; } own;
in vec3 at;
layout(location = 0) out vec4 c;
float helper() { return 1.0; }
void main() { c = material.base_color_factor * own.tint * texture(first, at.xy) * time_s * helper(); }
