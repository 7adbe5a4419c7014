#version 330
in vec2 v_uv;
in vec3 declared_but_not_read;
out vec4 display;
uniform sampler2D hdr_color;
uniform float exposure;
void main() { display = vec4(pow(texture(hdr_color, v_uv).rgb * exposure, vec3(1.0 / 2.2)), 1.0); }
