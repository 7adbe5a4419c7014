#version 330
in vec3 position;
uniform sampler2D heights;
void main() {
    gl_PointSize = 4.0;
    gl_Position = vec4(position + texture(heights, position.xy).xyz + textureProj(heights, position).xyz, 1.0);
}
