// The metallic-roughness material of glTF 2.0 under image-based light, with the effects that a scene calls
// for. Docs: docs/shader-interface.md. Every effect stands under its feature, so a variant declares, reads
// and computes nothing that its scene does not use. `unlit` needs no other effect than those of colour and alpha.

@if(!unlit) import lib::brdf::alpha2_filtered;
@if(specular && !unlit) import lib::brdf::f0_of_ior;
import lib::colour::within_f16;
import lib::frame::frame;
import lib::material::texture_coordinate;
@if((normal_map || clearcoat) && !unlit) import lib::material::{mapped_normal, TangentFrame};
import lib::vector::normalize_or;
@if(!unlit) import super::lobes::{Base, base_radiance};
@if(clearcoat && !unlit) import super::lobes::{Coat, under_coat};
@if(sheen && !unlit) import super::lobes::{Sheen, under_sheen};

struct Material {
    base_color_factor: vec4f,
    base_color_uv_u: vec4f,
    base_color_uv_v: vec4f,
    @if(alpha_mask) alpha_cutoff: f32,
    @if(!unlit) metallic_roughness_uv_u: vec4f,
    @if(!unlit) metallic_roughness_uv_v: vec4f,
    @if(!unlit) metallic_factor: f32,
    @if(!unlit) roughness_factor: f32,
    @if(normal_map && !unlit) normal_uv_u: vec4f,
    @if(normal_map && !unlit) normal_uv_v: vec4f,
    @if(normal_map && !unlit) normal_scale: f32,
    @if(occlusion && !unlit) occlusion_uv_u: vec4f,
    @if(occlusion && !unlit) occlusion_uv_v: vec4f,
    @if(occlusion && !unlit) occlusion_strength: f32,
    @if(emission && !unlit) emissive_uv_u: vec4f,
    @if(emission && !unlit) emissive_uv_v: vec4f,
    @if(emission && !unlit) emissive_factor: vec3f,
    @if((specular || transmission) && !unlit) ior: f32,
    @if(specular && !unlit) specular_uv_u: vec4f,
    @if(specular && !unlit) specular_uv_v: vec4f,
    @if(specular && !unlit) specular_color_uv_u: vec4f,
    @if(specular && !unlit) specular_color_uv_v: vec4f,
    @if(specular && !unlit) specular_color_factor: vec3f,
    @if(specular && !unlit) specular_factor: f32,
    @if(clearcoat && !unlit) clearcoat_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_roughness_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_roughness_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_normal_uv_u: vec4f,
    @if(clearcoat && !unlit) clearcoat_normal_uv_v: vec4f,
    @if(clearcoat && !unlit) clearcoat_factor: f32,
    @if(clearcoat && !unlit) clearcoat_roughness_factor: f32,
    @if(clearcoat && !unlit) clearcoat_normal_scale: f32,
    @if(sheen && !unlit) sheen_color_uv_u: vec4f,
    @if(sheen && !unlit) sheen_color_uv_v: vec4f,
    @if(sheen && !unlit) sheen_roughness_uv_u: vec4f,
    @if(sheen && !unlit) sheen_roughness_uv_v: vec4f,
    @if(sheen && !unlit) sheen_color_factor: vec3f,
    @if(sheen && !unlit) sheen_roughness_factor: f32,
    @if(transmission && !unlit) transmission_uv_u: vec4f,
    @if(transmission && !unlit) transmission_uv_v: vec4f,
    @if(transmission && !unlit) transmission_factor: f32,
}

struct Draw {
    world_from_object: mat4x4f,
    @if(!unlit) world_from_object_normal: mat4x4f,
}

@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var base_color_texture: texture_2d<f32>;
@group(1) @binding(2) var base_color_sampler: sampler;
@if(!unlit) @group(1) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@if(!unlit) @group(1) @binding(4) var metallic_roughness_sampler: sampler;
@if(normal_map && !unlit) @group(1) @binding(5) var normal_texture: texture_2d<f32>;
@if(normal_map && !unlit) @group(1) @binding(6) var normal_sampler: sampler;
@if(occlusion && !unlit) @group(1) @binding(7) var occlusion_texture: texture_2d<f32>;
@if(occlusion && !unlit) @group(1) @binding(8) var occlusion_sampler: sampler;
@if(emission && !unlit) @group(1) @binding(9) var emissive_texture: texture_2d<f32>;
@if(emission && !unlit) @group(1) @binding(10) var emissive_sampler: sampler;
@if(clearcoat && !unlit) @group(1) @binding(11) var clearcoat_texture: texture_2d<f32>;
@if(clearcoat && !unlit) @group(1) @binding(12) var clearcoat_sampler: sampler;
@if(clearcoat && !unlit) @group(1) @binding(13) var clearcoat_roughness_texture: texture_2d<f32>;
@if(clearcoat && !unlit) @group(1) @binding(14) var clearcoat_roughness_sampler: sampler;
@if(clearcoat && !unlit) @group(1) @binding(15) var clearcoat_normal_texture: texture_2d<f32>;
@if(clearcoat && !unlit) @group(1) @binding(16) var clearcoat_normal_sampler: sampler;
@if(sheen && !unlit) @group(1) @binding(17) var sheen_color_texture: texture_2d<f32>;
@if(sheen && !unlit) @group(1) @binding(18) var sheen_color_sampler: sampler;
@if(sheen && !unlit) @group(1) @binding(19) var sheen_roughness_texture: texture_2d<f32>;
@if(sheen && !unlit) @group(1) @binding(20) var sheen_roughness_sampler: sampler;
@if(specular && !unlit) @group(1) @binding(21) var specular_texture: texture_2d<f32>;
@if(specular && !unlit) @group(1) @binding(22) var specular_sampler: sampler;
@if(specular && !unlit) @group(1) @binding(23) var specular_color_texture: texture_2d<f32>;
@if(specular && !unlit) @group(1) @binding(24) var specular_color_sampler: sampler;
@if(transmission && !unlit) @group(1) @binding(25) var transmission_texture: texture_2d<f32>;
@if(transmission && !unlit) @group(1) @binding(26) var transmission_sampler: sampler;

@group(2) @binding(0) var<uniform> draw: Draw;

struct Vertex {
    @location(0) position: vec3f,
    @if(!unlit) @location(1) normal: vec3f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
    @if((normal_map || clearcoat) && !unlit) @location(4) tangent: vec4f,
    @if(vertex_color) @location(5) color: vec4f,
}

struct Varying {
    @builtin(position) clip_position: vec4f,
    @location(0) world_position: vec3f,
    @if(!unlit) @location(1) normal: vec3f,
    @location(2) uv0: vec2f,
    @location(3) uv1: vec2f,
    @if((normal_map || clearcoat) && !unlit) @location(4) tangent: vec4f,
    @if(vertex_color) @location(5) color: vec4f,
}

@vertex
fn vs_main(vertex: Vertex) -> Varying {
    var out: Varying;
    let world_position = draw.world_from_object * vec4f(vertex.position, 1.0);
    out.clip_position = frame.clip_from_world * world_position;
    out.world_position = world_position.xyz;
    @if(!unlit) out.normal = normalize_or((draw.world_from_object_normal * vec4f(vertex.normal, 0.0)).xyz, vec3f(0.0));
    out.uv0 = vertex.uv0;
    out.uv1 = vertex.uv1;
    @if((normal_map || clearcoat) && !unlit) {
        // A mesh without tangents has zeros here, and keeps its normal.
        let tangent = (draw.world_from_object * vec4f(vertex.tangent.xyz, 0.0)).xyz;
        out.tangent = vec4f(normalize_or(tangent, vec3f(0.0)), vertex.tangent.w);
    }
    @if(vertex_color) out.color = vertex.color;
    return out;
}

fn base_color(in: Varying) -> vec4f {
    let uv = texture_coordinate(material.base_color_uv_u, material.base_color_uv_v, in.uv0, in.uv1);
    var color = material.base_color_factor * textureSample(base_color_texture, base_color_sampler, uv);
    @if(vertex_color) color *= in.color;
    return color;
}

@if(!unlit)
fn metallic_roughness(in: Varying) -> vec2f {
    let uv = texture_coordinate(material.metallic_roughness_uv_u, material.metallic_roughness_uv_v, in.uv0, in.uv1);
    let texel = textureSample(metallic_roughness_texture, metallic_roughness_sampler, uv);
    return saturate(vec2f(material.metallic_factor * texel.b, material.roughness_factor * texel.g));
}

// Perceptual roughness that also covers how the normal turns within the pixel.
@if(!unlit)
fn filtered_roughness(perceptual_roughness: f32, geometric_normal: vec3f) -> f32 {
    let alpha = perceptual_roughness * perceptual_roughness;
    return sqrt(sqrt(alpha2_filtered(alpha * alpha, geometric_normal)));
}

@if(normal_map && !unlit)
fn base_normal(in: Varying) -> vec3f {
    let uv = texture_coordinate(material.normal_uv_u, material.normal_uv_v, in.uv0, in.uv1);
    let texel = textureSample(normal_texture, normal_sampler, uv);
    return mapped_normal(TangentFrame(in.normal, in.tangent), texel.xyz, material.normal_scale);
}

@if(occlusion && !unlit)
fn ambient_occlusion(in: Varying) -> f32 {
    let uv = texture_coordinate(material.occlusion_uv_u, material.occlusion_uv_v, in.uv0, in.uv1);
    let texel = textureSample(occlusion_texture, occlusion_sampler, uv);
    return mix(1.0, texel.r, material.occlusion_strength);
}

@if(emission && !unlit)
fn emission(in: Varying) -> vec3f {
    let uv = texture_coordinate(material.emissive_uv_u, material.emissive_uv_v, in.uv0, in.uv1);
    return material.emissive_factor * textureSample(emissive_texture, emissive_sampler, uv).rgb;
}

// Reflectance of the dielectric at normal incidence (xyz) and at grazing views (w). KHR_materials_specular.
@if(specular && !unlit)
fn dielectric_reflectance(in: Varying) -> vec4f {
    let uv = texture_coordinate(material.specular_uv_u, material.specular_uv_v, in.uv0, in.uv1);
    let weight = material.specular_factor * textureSample(specular_texture, specular_sampler, uv).a;
    let color_uv = texture_coordinate(material.specular_color_uv_u, material.specular_color_uv_v, in.uv0, in.uv1);
    let texel = textureSample(specular_color_texture, specular_color_sampler, color_uv);
    let f0 = min(f0_of_ior(material.ior) * material.specular_color_factor * texel.rgb, vec3f(1.0));
    return vec4f(f0 * weight, weight);
}
@elif(!unlit)
fn dielectric_reflectance(in: Varying) -> vec4f {
    return vec4f(0.04, 0.04, 0.04, 1.0);
}

@if(clearcoat && !unlit)
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

@if(sheen && !unlit)
fn sheen(in: Varying) -> Sheen {
    let uv = texture_coordinate(material.sheen_color_uv_u, material.sheen_color_uv_v, in.uv0, in.uv1);
    let color = material.sheen_color_factor * textureSample(sheen_color_texture, sheen_color_sampler, uv).rgb;
    let roughness_uv = texture_coordinate(material.sheen_roughness_uv_u, material.sheen_roughness_uv_v, in.uv0, in.uv1);
    let texel = textureSample(sheen_roughness_texture, sheen_roughness_sampler, roughness_uv);
    return Sheen(saturate(color), saturate(material.sheen_roughness_factor * texel.a));
}

@if(transmission && !unlit)
fn transmission(in: Varying) -> f32 {
    let uv = texture_coordinate(material.transmission_uv_u, material.transmission_uv_v, in.uv0, in.uv1);
    return saturate(material.transmission_factor * textureSample(transmission_texture, transmission_sampler, uv).r);
}

// The metallic-roughness base under the environment. `facing` is -1 on back faces.
@if(!unlit)
fn base_layer(in: Varying, color: vec3f, geometric_normal: vec3f, facing: f32, view: vec3f) -> Base {
    let metallic_roughness = metallic_roughness(in);
    let metallic = metallic_roughness.x;
    let dielectric = dielectric_reflectance(in);
    var base: Base;
    base.diffuse_color = color * (1.0 - metallic);
    base.f0 = mix(dielectric.xyz, color, metallic);
    base.f90 = mix(dielectric.w, 1.0, metallic);
    base.perceptual_roughness = filtered_roughness(metallic_roughness.y, geometric_normal);
    base.normal = facing * geometric_normal;
    @if(normal_map && !unlit) base.normal = facing * base_normal(in);
    base.view = view;
    base.occlusion = 1.0;
    @if(occlusion && !unlit) base.occlusion = ambient_occlusion(in);
    @if(transmission && !unlit) base.transmission = transmission(in);
    @if(transmission && !unlit) base.ior = material.ior;
    return base;
}

@if(!unlit)
fn shade(in: Varying, color: vec3f, facing: f32) -> vec3f {
    // A triangle whose normals cancel has no direction of its own; up is as good as any.
    let geometric_normal = normalize_or(in.normal, vec3f(0.0, 1.0, 0.0));
    let view = normalize_or(frame.camera_position - in.world_position, geometric_normal);
    let base = base_layer(in, color, geometric_normal, facing, view);
    var radiance = base_radiance(base);
    @if(sheen && !unlit) radiance = under_sheen(radiance, sheen(in), base.normal, view, base.occlusion);
    @if(emission && !unlit) radiance += emission(in);
    @if(clearcoat && !unlit) radiance = under_coat(radiance, coat(in, geometric_normal, facing), view, base.occlusion);
    return radiance;
}
@else
fn shade(in: Varying, color: vec3f, facing: f32) -> vec3f {
    return color;
}

@fragment
fn fs_main(in: Varying, @builtin(front_facing) front_facing: bool) -> @location(0) vec4f {
    let color = base_color(in);
    let radiance = shade(in, color.rgb, select(-1.0, 1.0, front_facing));
    // After all derivatives: a discarded fragment no longer takes part in them.
    @if(alpha_mask) {
        if color.a < material.alpha_cutoff {
            discard;
        }
    }
    var alpha = 1.0;
    @if(alpha_blend) alpha = color.a;
    return vec4f(within_f16(radiance), alpha);
}
