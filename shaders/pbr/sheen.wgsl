// Fibres over the base. KHR_materials_sheen.

import lib::environment::{dominant_direction, specular_radiance};
import lib::material::texture_coordinate;
import lib::sheen::charlie_albedo;
import lib::vector::max_component;
import super::interface::{material, Varying};

@group(1) @binding(17) var sheen_color_texture: texture_2d<f32>;
@group(1) @binding(18) var sheen_color_sampler: sampler;
@group(1) @binding(19) var sheen_roughness_texture: texture_2d<f32>;
@group(1) @binding(20) var sheen_roughness_sampler: sampler;

struct Sheen {
    color: vec3f,
    perceptual_roughness: f32,
}

fn sheen(in: Varying) -> Sheen {
    let uv = texture_coordinate(material.sheen_color_uv_u, material.sheen_color_uv_v, in.uv0, in.uv1);
    let color = material.sheen_color_factor * textureSample(sheen_color_texture, sheen_color_sampler, uv).rgb;
    let roughness_uv = texture_coordinate(material.sheen_roughness_uv_u, material.sheen_roughness_uv_v, in.uv0, in.uv1);
    let texel = textureSample(sheen_roughness_texture, sheen_roughness_sampler, roughness_uv);
    return Sheen(saturate(color), saturate(material.sheen_roughness_factor * texel.a));
}

// Approximate until the environment has a Charlie chain: the GGX chain stands in for it. Charlie's lobe
// sits at the horizon and is wide for every roughness, so the chain is read from its middle upwards; at the
// bottom it would mirror like lacquer. What makes it velvet, the bright rim, is the directional albedo.
fn under_sheen(below: vec3f, sheen: Sheen, normal: vec3f, view: vec3f, occlusion: f32) -> vec3f {
    let n_dot_v = saturate(dot(normal, view));
    let albedo = charlie_albedo(n_dot_v, sheen.perceptual_roughness);
    let roughness = 0.5 + 0.5 * sheen.perceptual_roughness;
    let direction = dominant_direction(normal, reflect(-view, normal), roughness);
    let radiance = sheen.color * albedo * specular_radiance(direction, roughness) * occlusion;
    return radiance + below * (1.0 - max_component(sheen.color) * albedo);
}
