#version 330
out vec4 c;
float own(vec2 a) { return a.x; }
void main() {
    vec3 d = vec3(1.0);
    float e = dot(d, c.xy);
    float f = own(d);
    c = vec4(e);
}
