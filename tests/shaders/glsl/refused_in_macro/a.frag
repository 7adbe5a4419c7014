#version 450
layout(location = 0) out vec4 colour;
#define SCALE(x) ((x) * scael)
uniform float scale;
void main() {
    colour = vec4(1.0,
                  SCALE(2.0), 0.0, 0.0);
}
