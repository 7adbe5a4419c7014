#version 330
uniform int mode;
out vec4 color;
void main() {
    float a = 0.0;
    switch (mode) {
    case 0:
        a = 1.0;
        if (gl_FragCoord.x > 3.0) { a = 2.0; break; }
    case 1:
        for (int i = 0; i < 3; i++) { a += 1.0; if (a > 4.0) break; }
    case 2: { a += 0.5; { break; } }
    case 3:
        if (a > 1.0) { break; } else { a = 3.0; break; }
    default:
        if (a > 2.0) { a = 7.0; break; }
    }
    color = vec4(a);
}
