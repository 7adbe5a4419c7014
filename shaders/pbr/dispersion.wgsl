// Red bends less than blue. KHR_materials_dispersion: one refraction for each channel.

import lib::volume::dispersed_ior;
import super::interface::material;
import super::transmission::refracted_radiance;

fn dispersed_radiance(view: vec3f, normal: vec3f, perceptual_roughness: f32, ior: f32) -> vec3f {
    let iors = dispersed_ior(max(ior, 1.0), material.dispersion);
    return vec3f(
        refracted_radiance(view, normal, perceptual_roughness, iors.r).r,
        refracted_radiance(view, normal, perceptual_roughness, iors.g).g,
        refracted_radiance(view, normal, perceptual_roughness, iors.b).b,
    );
}
