// The metallic-roughness base under the environment alone, with what shines through it. glTF 2.0, appendix B.

import lib::brdf::alpha2_filtered;
import lib::environment::{dominant_direction, ggx_albedo, ggx_scale_bias, irradiance_over_pi, specular_radiance};
@if(occlusion) import lib::material::specular_occlusion;
import lib::vector::max_component;
@if(diffuse_transmission) import super::diffuse_transmission::{light_from_behind, Scattering};
@if(transmission && dispersion) import super::dispersion::dispersed_radiance;
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
    let irradiance = irradiance_over_pi(base.normal) * base.occlusion;
    // What the specular layer left over. Its strongest channel counts, so that a coloured specular does
    // not tint the diffuse with its complement (KHR_materials_specular).
    let left = 1.0 - max_component(albedo.single + albedo.multiple);
    let below = base.diffuse_color * left;
    var diffuse = below * irradiance;
    @if(diffuse_transmission) {
        var behind = light_from_behind(base.scattering, base.normal, left * (1.0 - base.metallic));
        @if(volume) behind *= base.transmittance;
        diffuse = mix(diffuse, behind, base.scattering.share);
    }
    @if(transmission) {
        @if(dispersion) let behind = dispersed_radiance(base.entry, base.ior);
        @else let behind = transmitted_radiance(base.entry, base.ior);
        @if(volume) let through = behind * base.transmittance;
        @else let through = behind;
        diffuse = mix(diffuse, below * through, base.transmission);
    }
    return specular + albedo.multiple * irradiance + diffuse;
}
