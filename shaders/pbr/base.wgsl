// The metallic-roughness base under the environment and direct light, with what shines through it. glTF 2.0, appendix B.

import lib::brdf::alpha2_filtered;
import lib::environment::{dominant_direction, ggx_albedo, ggx_scale_bias, irradiance_over_pi, specular_radiance};
@if(occlusion) import lib::material::specular_occlusion;
import lib::vector::max_component;
@if(anisotropy && (punctual_lights || sun)) import super::anisotropy::Brush;
@if(diffuse_transmission) import super::diffuse_transmission::Scattering;
@if(transmission && dispersion) import super::dispersion::dispersed_radiance;
@if(inspect) import super::inspect::seen;
@if(iridescence) import super::iridescence::{Film, iridescent_f0};
@if(transmission && !dispersion) import super::transmission::transmitted_radiance;
@if(transmission) import super::transmission::Entry;

// Directions have unit length and point away from the surface.
struct Base {
    diffuse_color: vec3f,
    f0: vec3f,
    f90: f32,
    perceptual_roughness: f32,
    normal: vec3f,
    // What mirror directions are taken at.
    @if(anisotropy) mirror_normal: vec3f,
    @if(anisotropy && (punctual_lights || sun)) brush: Brush,
    view: vec3f,
    occlusion: f32,
    @if(transmission) entry: Entry,
    @if(transmission) transmission: f32,
    @if(transmission) ior: f32,
    // What is left of light that passes the medium.
    @if((diffuse_transmission || transmission) && volume) transmittance: vec3f,
    @if(diffuse_transmission) metallic: f32,
    @if(diffuse_transmission) scattering: Scattering,
    @if(iridescence) film: Film,
    @if(punctual_lights || sun) direct: Direct,
}

// What punctual lights and the sun make of the base, before its colours.
@if(punctual_lights || sun)
struct Direct {
    // What a white Lambert surface radiates: irradiance over π.
    irradiance_over_pi: vec3f,
    // The same from behind.
    @if(diffuse_transmission) behind_over_pi: vec3f,
    // Radiance that the specular layer reflects, its Fresnel term included.
    specular: vec3f,
    // Radiance that a clear wall lets through from behind.
    @if(transmission) through: vec3f,
}

// Perceptual roughness that also covers how the normal turns within the pixel.
fn filtered_roughness(perceptual_roughness: f32, geometric_normal: vec3f) -> f32 {
    let alpha = perceptual_roughness * perceptual_roughness;
    return sqrt(sqrt(alpha2_filtered(alpha * alpha, geometric_normal)));
}

fn base_radiance(base: Base) -> vec3f {
    let roughness = base.perceptual_roughness;
    let n_dot_v = saturate(dot(base.normal, base.view));
    @if(iridescence) let f0 = iridescent_f0(base.film, base.f0, base.f90, n_dot_v);
    @else let f0 = base.f0;
    let albedo = ggx_albedo(f0, base.f90, ggx_scale_bias(n_dot_v, roughness));
    @if(anisotropy) let r = reflect(-base.view, base.mirror_normal);
    @else let r = reflect(-base.view, base.normal);
    let direction = dominant_direction(base.normal, r, roughness);
    var specular = albedo.single * specular_radiance(direction, roughness);
    @if(occlusion) specular *= specular_occlusion(n_dot_v, base.occlusion, roughness * roughness);
    var irradiance = irradiance_over_pi(base.normal) * base.occlusion;
    @if(punctual_lights || sun) {
        specular += base.direct.specular;
        irradiance += base.direct.irradiance_over_pi;
    }
    // What the specular layer left over. Its strongest channel counts, so that a coloured specular does
    // not tint the diffuse with its complement (KHR_materials_specular).
    let left = 1.0 - max_component(albedo.single + albedo.multiple);
    let below = base.diffuse_color * left;
    var diffuse = below * irradiance;
    @if(diffuse_transmission) {
        var irradiance_behind = irradiance_over_pi(-base.normal);
        @if(punctual_lights || sun) irradiance_behind += base.direct.behind_over_pi;
        var behind = left * (1.0 - base.metallic) * base.scattering.color * irradiance_behind;
        @if(volume) behind *= base.transmittance;
        diffuse = mix(diffuse, behind, base.scattering.share);
    }
    @if(transmission) {
        @if(dispersion) var behind = dispersed_radiance(base.entry, base.ior);
        @else var behind = transmitted_radiance(base.entry, base.ior);
        @if(punctual_lights || sun) behind += base.direct.through;
        @if(volume) let through = behind * base.transmittance;
        @else let through = behind;
        diffuse = mix(diffuse, below * through, base.transmission);
    }
    @if(inspect) {
        seen.lobes.specular = specular + albedo.multiple * irradiance;
        seen.lobes.diffuse = below * irradiance;
        @if(diffuse_transmission) seen.lobes.diffuse *= 1.0 - base.scattering.share;
        @if(transmission) seen.lobes.diffuse *= 1.0 - base.transmission;
        seen.lobes.transmission = diffuse - seen.lobes.diffuse;
    }
    return specular + albedo.multiple * irradiance + diffuse;
}
