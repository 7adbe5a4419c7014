// The metallic-roughness material of glTF 2.0 under image-based light, punctual lights and the sun, with the effects that a scene calls
// for. Docs: docs/shader-interface.md. Every effect stands under its feature, so a variant declares, reads
// and computes nothing that its scene does not use. `unlit` needs no other effect than those of colour and alpha.

import lib::colour::within_f16;
import lib::frame::frame;
@if(inspect) import lib::inspect::mip_level;
import lib::material::texture_coordinate;
@if(normal_map && !unlit) import lib::material::{mapped_normal, TangentFrame};
import lib::vector::normalize_or;
@if(anisotropy && !unlit) import super::anisotropy::{brush, brushed_normal};
@if(!unlit) import super::base::{Base, base_radiance, filtered_roughness};
@if(inspect && (punctual_lights || sun) && !unlit) import super::base::Direct;
@if(clearcoat && !unlit) import super::clearcoat::{coat, under_coat};
@if(instancing) import super::deform::instanced;
@if(morph) import super::deform::morphed;
@if(skin) import super::deform::skinned;
@if(diffuse_transmission && !unlit) import super::diffuse_transmission::scattering;
@if(inspect) import super::inspect::{inspected, seen};
import super::interface::{base_color_sampler, draw, material, Varying, Vertex};
@if(iridescence && !unlit) import super::iridescence::film;
@if((punctual_lights || sun) && !unlit) import super::punctual::{direct_light, LitPoint};
@if(clearcoat && (punctual_lights || sun) && !unlit) import super::punctual::direct_coat;
@if((punctual_lights || sun) && sheen && !unlit) import super::punctual::direct_sheen;
@if(sheen && !unlit) import super::sheen::{sheen, under_sheen};
@if(specular && !unlit) import super::specular::dielectric_reflectance;
@if(sun && !unlit) import super::sun::sunlight;
@if(transmission && !unlit) import super::transmission::transmission;
@if((diffuse_transmission || transmission) && volume && !unlit) import super::volume::{medium_depth, medium_transmittance};

@group(1) @binding(1) var base_color_texture: texture_2d<f32>;
@if(!unlit) @group(1) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@if(!unlit) @group(1) @binding(4) var metallic_roughness_sampler: sampler;
@if(normal_map && !unlit) @group(1) @binding(5) var normal_texture: texture_2d<f32>;
@if(normal_map && !unlit) @group(1) @binding(6) var normal_sampler: sampler;
@if(occlusion && !unlit) @group(1) @binding(7) var occlusion_texture: texture_2d<f32>;
@if(occlusion && !unlit) @group(1) @binding(8) var occlusion_sampler: sampler;
@if(emission && !unlit) @group(1) @binding(9) var emissive_texture: texture_2d<f32>;
@if(emission && !unlit) @group(1) @binding(10) var emissive_sampler: sampler;

@vertex
fn vs_main(source: Vertex) -> Varying {
    var vertex = source;
    @if(morph) vertex = morphed(vertex);
    @if(skin) vertex = skinned(vertex);
    @if(instancing) vertex = instanced(vertex);
    var out: Varying;
    let world_position = draw.world_from_object * vec4f(vertex.position, 1.0);
    out.clip_position = frame.clip_from_world * world_position;
    out.world_position = world_position.xyz;
    @if(!unlit) out.normal = normalize_or((draw.world_from_object_normal * vec4f(vertex.normal, 0.0)).xyz, vec3f(0.0));
    out.uv0 = vertex.uv0;
    out.uv1 = vertex.uv1;
    @if((anisotropy || clearcoat || normal_map) && !unlit) {
        let linear = mat3x3f(draw.world_from_object[0].xyz, draw.world_from_object[1].xyz, draw.world_from_object[2].xyz);
        // What an animation turns inside out has its bitangent on the other side.
        let side = select(1.0, -1.0, determinant(linear) < 0.0);
        // A mesh without tangents has zeros here, and keeps its normal.
        out.tangent = vec4f(normalize_or(linear * vertex.tangent.xyz, vec3f(0.0)), side * vertex.tangent.w);
    }
    @if(vertex_color) out.color = vertex.color;
    @if(instancing && (diffuse_transmission || transmission) && volume && !unlit) out.instance = vertex.instance;
    return out;
}

fn base_color(in: Varying) -> vec4f {
    let uv = texture_coordinate(material.base_color_uv_u, material.base_color_uv_v, in.uv0, in.uv1);
    var color = material.base_color_factor * textureSample(base_color_texture, base_color_sampler, uv);
    @if(vertex_color) color *= in.color;
    @if(inspect) {
        let size = textureDimensions(base_color_texture);
        seen.mip = mip_level(uv, size, textureNumLevels(base_color_texture));
        seen.base_color = color;
    }
    return color;
}

@if(!unlit)
fn metallic_roughness(in: Varying) -> vec2f {
    let uv = texture_coordinate(material.metallic_roughness_uv_u, material.metallic_roughness_uv_v, in.uv0, in.uv1);
    let texel = textureSample(metallic_roughness_texture, metallic_roughness_sampler, uv);
    return saturate(vec2f(material.metallic_factor * texel.b, material.roughness_factor * texel.g));
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

// Reflectance of the dielectric at normal incidence (xyz) and at grazing views (w) of index 1.5, unless the material says.
@if(!specular && !unlit)
fn dielectric_reflectance(in: Varying) -> vec4f {
    return vec4f(0.04, 0.04, 0.04, 1.0);
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
    @if(anisotropy) let brush = brush(in, base.normal);
    @if(anisotropy) base.mirror_normal = brushed_normal(brush, view, base.perceptual_roughness);
    @if(anisotropy && (punctual_lights || sun)) base.brush = brush;
    base.view = view;
    base.occlusion = 1.0;
    @if(occlusion && !unlit) base.occlusion = ambient_occlusion(in);
    @if(transmission && !unlit) base.transmission = transmission(in);
    @if(transmission && !unlit) base.ior = material.ior;
    @if(transmission) {
        base.entry.position = in.world_position;
        base.entry.normal = base.normal;
        base.entry.view = view;
        base.entry.perceptual_roughness = base.perceptual_roughness;
    }
    @if((diffuse_transmission || transmission) && volume) {
        let depth = medium_depth(in, base.normal);
        base.transmittance = medium_transmittance(depth);
        @if(transmission) base.entry.depth = depth;
    }
    @if(diffuse_transmission) base.metallic = metallic;
    @if(diffuse_transmission) base.scattering = scattering(in);
    @if(iridescence) base.film = film(in);
    @if(inspect) {
        seen.roughness = metallic_roughness.y;
        seen.metalness = metallic;
        seen.f0 = base.f0;
        seen.occlusion = base.occlusion;
        seen.geometric_normal = facing * geometric_normal;
        seen.shading_normal = base.normal;
        @if(anisotropy || clearcoat || normal_map) seen.tangent = in.tangent.xyz;
    }
    return base;
}

// What the base radiates without the scene's own lights and the sun.
@if(inspect && (punctual_lights || sun) && !unlit)
fn environment_radiance(base: Base) -> vec3f {
    var unlit = base;
    var no_light: Direct;
    unlit.direct = no_light;
    return base_radiance(unlit);
}

@if(!unlit)
fn shade(in: Varying, color: vec3f, facing: f32) -> vec3f {
    // A triangle whose normals cancel has no direction of its own; up is as good as any.
    let geometric_normal = normalize_or(in.normal, vec3f(0.0, 1.0, 0.0));
    let view = normalize_or(frame.camera_position - in.world_position, geometric_normal);
    var base = base_layer(in, color, geometric_normal, facing, view);
    @if(punctual_lights || sun) var point: LitPoint;
    @if(punctual_lights || sun) point.position = in.world_position;
    @if(sun) point.sunlight = sunlight(in.world_position, facing * geometric_normal);
    @if(punctual_lights || sun) base.direct = direct_light(base, point);
    @if(inspect && (punctual_lights || sun)) let environment_alone = environment_radiance(base);
    var radiance = base_radiance(base);
    @if(inspect && (punctual_lights || sun)) seen.lobes.punctual = radiance - environment_alone;
    @if(sheen && !unlit) {
        let sheen = sheen(in);
        radiance = under_sheen(radiance, sheen, base.normal, view, base.occlusion);
        @if(punctual_lights || sun) {
            let direct = direct_sheen(sheen, base.normal, view, point);
            radiance += direct;
            @if(inspect) seen.lobes.sheen += direct;
            @if(inspect) seen.lobes.punctual += direct;
        }
    }
    @if(emission && !unlit) {
        let emission = emission(in);
        radiance += emission;
        @if(inspect) seen.lobes.emission = emission;
    }
    @if(clearcoat && !unlit) {
        let coat = coat(in, geometric_normal, facing);
        radiance = under_coat(radiance, coat, view, base.occlusion);
        @if(punctual_lights || sun) {
            let direct = direct_coat(coat, view, point);
            radiance += direct;
            @if(inspect) seen.lobes.clearcoat += direct;
            @if(inspect) seen.lobes.punctual += direct;
        }
    }
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
    @if(inspect) {
        seen.uv0 = in.uv0;
        seen.uv1 = in.uv1;
        return inspected(radiance, alpha, in.clip_position.xy);
    }
    @else return vec4f(within_f16(radiance), alpha);
}
