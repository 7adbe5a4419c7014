#version 330
out vec4 c;
void main() {
    vec3 d = vec3(1.0);
    c = d;
}
