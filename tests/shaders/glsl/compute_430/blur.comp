#version 430
layout(local_size_x = 8, local_size_y = 4) in;
layout(binding = 0, rgba8) uniform readonly image2D source;
layout(binding = 1, rgba16f) uniform image2D target;
layout(std430, binding = 2) buffer Sums { uint total; float values[]; };
shared vec4 tile[8][4];
uniform int radius;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    tile[gl_LocalInvocationID.x][gl_LocalInvocationID.y] = imageLoad(source, at);
    memoryBarrierShared();
    barrier();
    imageStore(target, at, tile[0][0] * float(radius));
    values[gl_LocalInvocationIndex] = float(gl_WorkGroupSize.x * gl_WorkGroupID.y + gl_NumWorkGroups.z);
    total = uint(imageSize(source).x);
}
