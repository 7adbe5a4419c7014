#version 450
layout(location = 0) out vec4 colour;
layout(std430) buffer Flags { bool on; };
layout(rgba8) uniform image2D both;
uniform imageCube cube;
void main() { imageStore(both, ivec2(0), imageLoad(both, ivec2(1))); colour = vec4(on); }
