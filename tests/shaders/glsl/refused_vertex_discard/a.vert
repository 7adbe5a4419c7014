#version 330
in vec3 position;
void main() { if (position.x > 0.0) discard; gl_Position = vec4(dFdx(position.x)); }
