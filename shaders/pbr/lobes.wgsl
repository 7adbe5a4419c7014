// The layers of the material, from the base up, each under the environment alone.

import lib::environment::{dominant_direction, ggx_albedo, ggx_scale_bias, irradiance_over_pi, specular_radiance};
import lib::sheen::charlie_albedo;
@if(occlusion) import lib::material::specular_occlusion;
import lib::vector::max_component;

// The opaque or transmitting base. Directions have unit length and point away from the surface.
struct Base {
    diffuse_color: vec3f,
    f0: vec3f,
    f90: f32,
    perceptual_roughness: f32,
    normal: vec3f,
    view: vec3f,
    occlusion: f32,
    @if(transmission) transmission: f32,
    @if(transmission) ior: f32,
}

fn base_radiance(base: Base) -> vec3f {
    let roughness = base.perceptual_roughness;
    let n_dot_v = saturate(dot(base.normal, base.view));
    let albedo = ggx_albedo(base.f0, base.f90, ggx_scale_bias(n_dot_v, roughness));
    let direction = dominant_direction(base.normal, reflect(-base.view, base.normal), roughness);
    var specular = albedo.single * specular_radiance(direction, roughness);
    @if(occlusion) specular *= specular_occlusion(n_dot_v, base.occlusion, roughness * roughness);
    let irradiance = irradiance_over_pi(base.normal) * base.occlusion;
    // What the specular layer left over. Its strongest channel counts, so that a coloured specular does
    // not tint the diffuse with its complement (KHR_materials_specular).
    let below = base.diffuse_color * (1.0 - max_component(albedo.single + albedo.multiple));
    var diffuse = below * irradiance;
    @if(transmission) diffuse = mix(diffuse, below * transmitted_radiance(base), base.transmission);
    return specular + albedo.multiple * irradiance + diffuse;
}

// What shines through from behind. Approximate: one refraction into an endless medium, read from the
// prefiltered environment; no scene behind it, no thickness and no absorption (KHR_materials_volume).
@if(transmission)
fn transmitted_radiance(base: Base) -> vec3f {
    // ior 0 stands for a perfect mirror (KHR_materials_ior); below 1 light may not enter at all.
    let ior = max(base.ior, 1.0);
    let direction = refract(-base.view, base.normal, 1.0 / ior);
    // A medium like air does not blur, however rough: the lobe narrows with ior - 1. Full at ior 1.5 and above.
    let roughness = base.perceptual_roughness * saturate(2.0 * ior - 2.0);
    return specular_radiance(direction, roughness);
}

// Fibres over the base. KHR_materials_sheen.
@if(sheen)
struct Sheen {
    color: vec3f,
    perceptual_roughness: f32,
}

// Approximate until the environment has a Charlie chain: the GGX chain stands in for it. Charlie's lobe
// sits at the horizon and is wide for every roughness, so the chain is read from its middle upwards; at the
// bottom it would mirror like lacquer. What makes it velvet, the bright rim, is the directional albedo.
@if(sheen)
fn under_sheen(below: vec3f, sheen: Sheen, normal: vec3f, view: vec3f, occlusion: f32) -> vec3f {
    let n_dot_v = saturate(dot(normal, view));
    let albedo = charlie_albedo(n_dot_v, sheen.perceptual_roughness);
    let roughness = 0.5 + 0.5 * sheen.perceptual_roughness;
    let direction = dominant_direction(normal, reflect(-view, normal), roughness);
    let radiance = sheen.color * albedo * specular_radiance(direction, roughness) * occlusion;
    return radiance + below * (1.0 - max_component(sheen.color) * albedo);
}

// A varnish over everything. KHR_materials_clearcoat.
@if(clearcoat)
struct Coat {
    weight: f32,
    perceptual_roughness: f32,
    normal: vec3f,
}

// The coat is a dielectric of ior 1.5. It takes from what lies below just what it reflects itself, its
// Fresnel term averaged over its lobe: Schlick's term at n·v when smooth, less at grazing views when rough.
@if(clearcoat)
fn under_coat(below: vec3f, coat: Coat, view: vec3f, occlusion: f32) -> vec3f {
    let roughness = coat.perceptual_roughness;
    let n_dot_v = saturate(dot(coat.normal, view));
    let scale_bias = ggx_scale_bias(n_dot_v, roughness);
    let albedo = coat.weight * (0.04 * scale_bias.x + scale_bias.y);
    let direction = dominant_direction(coat.normal, reflect(-view, coat.normal), roughness);
    var radiance = albedo * specular_radiance(direction, roughness);
    @if(occlusion) radiance *= specular_occlusion(n_dot_v, occlusion, roughness * roughness);
    return below * (1.0 - albedo) + radiance;
}
