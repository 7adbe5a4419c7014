#version 330 core
out vec4 colour;

in vec2 uv;
in vec3 world_position;
in vec3 world_normal;

// material
uniform sampler2D base_color_texture;
uniform sampler2D metallic_roughness_texture;
uniform vec4 base_color_factor;
uniform float roughness_factor;
uniform float metallic_factor;

// environment
uniform samplerCube env_irradiance;
uniform samplerCube env_specular;
uniform sampler2D lut_ggx;
uniform float specular_level_max;

uniform vec3 light_positions[4];
uniform vec3 light_radiances[4];
uniform vec3 camera_position;
uniform bool use_lights;

const float PI = 3.14159265359;

float radical_inverse(uint bits)
{
    bits = (bits << 16u) | (bits >> 16u);
    bits = ((bits & 0x55555555u) << 1u) | ((bits & 0xAAAAAAAAu) >> 1u);
    bits = ((bits & 0x33333333u) << 2u) | ((bits & 0xCCCCCCCCu) >> 2u);
    bits = ((bits & 0x0F0F0F0Fu) << 4u) | ((bits & 0xF0F0F0F0u) >> 4u);
    bits = ((bits & 0x00FF00FFu) << 8u) | ((bits & 0xFF00FF00u) >> 8u);
    return float(bits) * 2.3283064365386963e-10;
}

vec2 hammersley(uint i, uint count)
{
    return vec2(float(i) / float(count), radical_inverse(i));
}

float distribution(vec3 n, vec3 h, float roughness)
{
    float a2 = pow(roughness, 4.0);
    float n_dot_h = max(dot(n, h), 0.0);
    float d = n_dot_h * n_dot_h * (a2 - 1.0) + 1.0;
    return a2 / (PI * d * d);
}

vec3 fresnel(float cosine, vec3 f0)
{
    return f0 + (1.0 - f0) * pow(clamp(1.0 - cosine, 0.0, 1.0), 5.0);
}

vec4 fetch(sampler2D map, vec2 at)
{
    return texture(map, at);
}

void main()
{
    vec4 base = fetch(base_color_texture, uv) * base_color_factor;
    vec2 mr = texture(metallic_roughness_texture, uv).bg * vec2(metallic_factor, roughness_factor);
    vec3 n = normalize(world_normal);
    vec3 v = normalize(camera_position - world_position);
    vec3 f0 = mix(vec3(0.04), base.rgb, mr.x);
    vec3 sum = vec3(0.0);
    if (use_lights) {
        for (int i = 0; i < 4; ++i) {
            vec3 to_light = light_positions[i] - world_position;
            vec3 l = normalize(to_light);
            vec3 h = normalize(v + l);
            vec3 radiance = light_radiances[i] / dot(to_light, to_light);
            vec3 f = fresnel(max(dot(h, v), 0.0), f0);
            sum += (base.rgb / PI + f * distribution(n, h, mr.y)) * radiance * max(dot(n, l), 0.0);
        }
    }
    const uint COUNT = 16u;
    float jitter = 0.0;
    for (uint i = 0u; i < COUNT; ++i) {
        jitter += hammersley(i, COUNT).y;
    }
    vec3 diffuse = texture(env_irradiance, n).rgb * base.rgb;
    vec3 r = reflect(-v, n);
    vec3 specular = textureLod(env_specular, r, mr.y * specular_level_max).rgb;
    vec2 brdf = texture(lut_ggx, vec2(max(dot(n, v), 0.0), mr.y)).rg;
    sum += diffuse + specular * (f0 * brdf.x + brdf.y);
    colour = vec4(sum + jitter * 0.0, base.a);
}
