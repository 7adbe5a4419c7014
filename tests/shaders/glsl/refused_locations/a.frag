#version 450
layout(location = 0) out vec4 colour;
layout(location = 1) in mat4 a;
layout(location = 4) in vec2 b;
layout(location = 70) in vec2 c;
in float many[N];
layout(component = 1, location = 9) in float part;
void main() { colour = a[0] + b.xyxy + c.xyxy + many[0] + part; }
