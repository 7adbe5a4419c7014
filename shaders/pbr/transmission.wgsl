// What shines through from behind. KHR_materials_transmission.

import lib::environment::specular_radiance;
import lib::material::texture_coordinate;
import lib::volume::roughness_refracted;
import super::interface::{material, Varying};

@group(1) @binding(25) var transmission_texture: texture_2d<f32>;
@group(1) @binding(26) var transmission_sampler: sampler;

fn transmission(in: Varying) -> f32 {
    let uv = texture_coordinate(material.transmission_uv_u, material.transmission_uv_v, in.uv0, in.uv1);
    return saturate(material.transmission_factor * textureSample(transmission_texture, transmission_sampler, uv).r);
}

// Approximate: one refraction into an endless medium, read from the prefiltered environment; no scene behind it.
fn refracted_radiance(view: vec3f, normal: vec3f, perceptual_roughness: f32, ior: f32) -> vec3f {
    // ior 0 stands for a perfect mirror (KHR_materials_ior); below 1 light may not enter at all.
    let medium = max(ior, 1.0);
    let direction = refract(-view, normal, 1.0 / medium);
    return specular_radiance(direction, roughness_refracted(perceptual_roughness, medium));
}
