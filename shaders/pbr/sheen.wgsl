// Fibres over the base. KHR_materials_sheen.

import lib::environment::{sheen_albedo, sheen_radiance};
import lib::material::texture_coordinate;
import lib::vector::max_component;
@if(inspect) import super::inspect::{cover, seen};
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

// The sheen's light, and what it leaves of the layers below: the albedo scaling of KHR_materials_sheen. Charlie's lobe is
// as wide as the hemisphere, which lies around the normal: looked up in the mirror direction, as the Khronos sample viewer
// does, it would show the sun's horizon as a ring on the cloth.
fn under_sheen(below: vec3f, sheen: Sheen, normal: vec3f, view: vec3f, occlusion: f32) -> vec3f {
    let albedo = sheen_albedo(saturate(dot(normal, view)), sheen.perceptual_roughness);
    let incoming = sheen_radiance(normal, sheen.perceptual_roughness);
    @if(inspect) {
        cover(1.0 - max_component(sheen.color) * albedo);
        seen.lobes.sheen = sheen.color * albedo * incoming * occlusion;
    }
    return sheen.color * albedo * incoming * occlusion + below * (1.0 - max_component(sheen.color) * albedo);
}
