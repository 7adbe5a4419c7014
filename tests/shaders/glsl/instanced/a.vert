#version 330
layout(location = 0) in vec3 position;
layout(location = 3) in mat4 world_of_instance;
in mat3x2 odd;
out mat2 turn;
uniform mat4 clip_from_world;
void main() {
    turn = mat2(odd[0], odd[1]);
    gl_Position = clip_from_world * world_of_instance * vec4(position, 1.0);
    if (position.x > 0.0) return;
    turn[1] = vec2(0.0);
}
