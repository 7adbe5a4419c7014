#version 330 core
in vec3 position;
uniform sampler2D heights[2];
uniform int at;
void main() {
    gl_Position = vec4(position + texture(heights[at], position.xy).rgb + texture(heights[0], position.xy).rgb, 1.0);
}
