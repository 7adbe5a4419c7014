#version 450
layout(location = 0) out vec4 colour;
struct Surface { sampler2D map; float shine; };
struct Lamp { bool on; float table[3]; vec3 at; };
uniform sampler2D maps[4];
uniform Lamp lamp;
uniform Lamp lamps[2];
uniform float grid[2][2];
uniform float weights[3];
layout(set = 1, binding = 1) uniform sampler2D first;
layout(set = 1, binding = 1) uniform sampler2D second;
layout(binding = N) uniform sampler2D third;
layout(std140, binding = 3, component = 1) uniform Block { float a; } blocks[2];
layout(std140, bindng = 3) uniform Other { float b; };
layout(buffer_reference) buffer Pointer { float c; };
float all(float values[3]) { return values[0]; }
void main() { colour = vec4(lamp.at, all(weights)) + texture(maps[1], vec2(0.0)) + first; }
