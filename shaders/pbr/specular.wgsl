// Strength and colour of the dielectric's reflection. KHR_materials_specular, KHR_materials_ior.

import lib::brdf::f0_of_ior;
import lib::material::texture_coordinate;
import super::interface::{material, Varying};

@group(1) @binding(21) var specular_texture: texture_2d<f32>;
@group(1) @binding(22) var specular_sampler: sampler;
@group(1) @binding(23) var specular_color_texture: texture_2d<f32>;
@group(1) @binding(24) var specular_color_sampler: sampler;

// Reflectance of the dielectric at normal incidence (xyz) and at grazing views (w).
fn dielectric_reflectance(in: Varying) -> vec4f {
    let uv = texture_coordinate(material.specular_uv_u, material.specular_uv_v, in.uv0, in.uv1);
    let weight = material.specular_factor * textureSample(specular_texture, specular_sampler, uv).a;
    let color_uv = texture_coordinate(material.specular_color_uv_u, material.specular_color_uv_v, in.uv0, in.uv1);
    let texel = textureSample(specular_color_texture, specular_color_sampler, color_uv);
    let f0 = min(f0_of_ior(material.ior) * material.specular_color_factor * texel.rgb, vec3f(1.0));
    return vec4f(f0 * weight, weight);
}
