// Leaves, paper, wax: light that comes through diffusely. KHR_materials_diffuse_transmission.

import lib::material::texture_coordinate;
import super::interface::{base_color_sampler, material, Varying};

@group(1) @binding(31) var diffuse_transmission_texture: texture_2d<f32>;
@group(1) @binding(32) var diffuse_transmission_color_texture: texture_2d<f32>;

// The share of light that scatters to the other side, and its colour there.
struct Scattering {
    share: f32,
    color: vec3f,
}

fn scattering(in: Varying) -> Scattering {
    let uv = texture_coordinate(material.diffuse_transmission_uv_u, material.diffuse_transmission_uv_v, in.uv0, in.uv1);
    let texel = textureSample(diffuse_transmission_texture, base_color_sampler, uv);
    let color_uv = texture_coordinate(
        material.diffuse_transmission_color_uv_u,
        material.diffuse_transmission_color_uv_v,
        in.uv0,
        in.uv1,
    );
    let color_texel = textureSample(diffuse_transmission_color_texture, base_color_sampler, color_uv);
    let share = saturate(material.diffuse_transmission_factor * texel.a);
    return Scattering(share, saturate(material.diffuse_transmission_color_factor * color_texel.rgb));
}
