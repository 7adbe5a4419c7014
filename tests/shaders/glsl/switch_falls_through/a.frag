#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
void main() {
    float sum = 0.0;
    switch (int(x.x)) {
        case 0: sum += 1.0;
        case 1: sum += 2.0; break;
        case 2:
        case 3: sum += 4.0;
        default: sum += 8.0;
    }
    colour = vec4(sum);
}
