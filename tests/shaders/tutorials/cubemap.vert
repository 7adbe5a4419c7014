#version 330 core
// A cube around the camera: what is seen through a point of it lies in that point's direction.
layout (location = 0) in vec3 aPos;

out vec3 WorldPos;

uniform mat4 projection;
uniform mat4 view;

void main()
{
    WorldPos = aPos;
    gl_Position = projection * view * vec4(aPos, 1.0);
}
