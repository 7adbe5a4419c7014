#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
float late(float v);
vec3 late(vec3 v);
float early(float v) { return v * 2.0; }
vec3 twice(vec3 v) { return vec3(late(v.x), late(v).yz); }
float late(float v) { return early(v); }
vec3 late(vec3 v) { return vec3(late(v.x), late(v.y), early(v.z)); }
void main() { colour = vec4(twice(x), 1.0); }
