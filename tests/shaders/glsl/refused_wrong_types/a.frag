#version 450
layout(location = 0) out vec4 colour;
void main() {
    vec3 a = vec3(1.0);
    colour = a * mat4(1.0);
}
