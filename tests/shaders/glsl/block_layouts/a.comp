#version 450
layout(local_size_x = 1) in;
layout(std140) uniform;
layout(std430) buffer;
struct Particle { vec4 at; vec3 velocity; float age; };
layout(std140, binding = 0) buffer Particles { vec4 sum; Particle all[]; };
layout(std430, binding = 1) buffer Values { float values[]; };
layout(packed, column_major) uniform Settings { mat4 turn; float scale; };
layout(shared) uniform Others { vec4 tint; };
layout(constant_id = 4) const float SPEED = 2.0;
void main() {
    sum = turn * all[0].at * scale + tint * SPEED;
    values[1] = all[1].age;
}
