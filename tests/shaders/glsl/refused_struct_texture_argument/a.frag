#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
uniform sampler2D a, b;
vec4 both(sampler2D maps[2]) { return texture(maps[0], x.xy); }
void main() { sampler2D c = a; colour = texture(x.x > 0.0 ? a : b, x.xy); }
