// Red bends less than blue. KHR_materials_dispersion: one refraction for each channel.

import lib::volume::dispersed_ior;
import super::interface::material;
import super::transmission::{Entry, transmitted_radiance};

fn dispersed_radiance(entry: Entry, ior: f32) -> vec3f {
    let iors = dispersed_ior(max(ior, 1.0), material.dispersion);
    return vec3f(
        transmitted_radiance(entry, iors.r).r,
        transmitted_radiance(entry, iors.g).g,
        transmitted_radiance(entry, iors.b).b,
    );
}
