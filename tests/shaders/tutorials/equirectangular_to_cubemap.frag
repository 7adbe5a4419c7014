#version 330 core
out vec4 FragColor;
in vec3 WorldPos;

uniform sampler2D equirectangularMap;

// 1 / 2π and 1 / π, to the four digits everybody types.
const vec2 invAtan = vec2(0.1591, 0.3183);

vec2 SampleSphericalMap(vec3 direction)
{
    vec2 angles = vec2(atan(direction.z, direction.x), asin(direction.y));
    return angles * invAtan + 0.5;
}

void main()
{
    vec2 uv = SampleSphericalMap(normalize(WorldPos));
    // The level is stated: implicit derivatives jump where the map wraps around.
    FragColor = vec4(textureLod(equirectangularMap, uv, 0.0).rgb, 1.0);
}
