#version 330 core
layout (location = 0) in vec3 position;
layout (location = 1) in vec3 normal;
layout (location = 2) in vec2 uv0;

out vec3 world_position;
out vec3 world_normal;
out vec2 uv;

uniform mat4 clip_from_world;
uniform mat4 world_from_object;
uniform mat4 world_from_object_normal;

void main()
{
    vec4 world = world_from_object * vec4(position, 1.0);
    world_position = world.xyz;
    world_normal = mat3(world_from_object_normal) * normal;
    uv = uv0;
    gl_Position = clip_from_world * world;
}
