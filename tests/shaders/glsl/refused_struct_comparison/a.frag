#version 330
struct Part { float a; };
out vec4 c;
void main() {
    Part a = Part(1.0);
    Part b = Part(2.0);
    if (a == b) c = vec4(1.0);
}
