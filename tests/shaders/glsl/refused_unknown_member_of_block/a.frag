#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in Surface { vec2 uv; vec3 normal; } surface;
uniform Own { vec4 tint; } own;
void main() { colour = own.tnt * surface.nromal.xyzz; }
