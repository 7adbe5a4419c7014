// A varnish over everything. KHR_materials_clearcoat.

import lib::environment::{dominant_direction, ggx_scale_bias, specular_radiance};
import lib::material::{mapped_normal, TangentFrame, texture_coordinate};
@if(occlusion) import lib::material::specular_occlusion;
import super::base::filtered_roughness;
@if(inspect) import super::inspect::{cover, seen};
import super::interface::{material, Varying};

@group(1) @binding(11) var clearcoat_texture: texture_2d<f32>;
@group(1) @binding(12) var clearcoat_sampler: sampler;
@group(1) @binding(13) var clearcoat_roughness_texture: texture_2d<f32>;
@group(1) @binding(14) var clearcoat_roughness_sampler: sampler;
@group(1) @binding(15) var clearcoat_normal_texture: texture_2d<f32>;
@group(1) @binding(16) var clearcoat_normal_sampler: sampler;

struct Coat {
    weight: f32,
    perceptual_roughness: f32,
    normal: vec3f,
}

fn coat(in: Varying, geometric_normal: vec3f, facing: f32) -> Coat {
    let uv = texture_coordinate(material.clearcoat_uv_u, material.clearcoat_uv_v, in.uv0, in.uv1);
    let weight = material.clearcoat_factor * textureSample(clearcoat_texture, clearcoat_sampler, uv).r;
    let roughness_uv = texture_coordinate(material.clearcoat_roughness_uv_u, material.clearcoat_roughness_uv_v, in.uv0, in.uv1);
    let texel = textureSample(clearcoat_roughness_texture, clearcoat_roughness_sampler, roughness_uv);
    let roughness = saturate(material.clearcoat_roughness_factor * texel.g);
    let normal_uv = texture_coordinate(material.clearcoat_normal_uv_u, material.clearcoat_normal_uv_v, in.uv0, in.uv1);
    let normal_texel = textureSample(clearcoat_normal_texture, clearcoat_normal_sampler, normal_uv);
    let mapped = mapped_normal(TangentFrame(in.normal, in.tangent), normal_texel.xyz, material.clearcoat_normal_scale);
    return Coat(saturate(weight), filtered_roughness(roughness, geometric_normal), facing * mapped);
}

// The coat is a dielectric of ior 1.5. It takes from what lies below just what it reflects itself, its
// Fresnel term averaged over its lobe: Schlick's term at n·v when smooth, less at grazing views when rough.
fn under_coat(below: vec3f, coat: Coat, view: vec3f, occlusion: f32) -> vec3f {
    let roughness = coat.perceptual_roughness;
    let n_dot_v = saturate(dot(coat.normal, view));
    let scale_bias = ggx_scale_bias(n_dot_v, roughness);
    let albedo = coat.weight * (0.04 * scale_bias.x + scale_bias.y);
    let direction = dominant_direction(coat.normal, reflect(-view, coat.normal), roughness);
    var radiance = albedo * specular_radiance(direction, roughness);
    @if(occlusion) radiance *= specular_occlusion(n_dot_v, occlusion, roughness * roughness);
    @if(inspect) {
        cover(1.0 - albedo);
        seen.lobes.clearcoat = radiance;
    }
    return below * (1.0 - albedo) + radiance;
}
