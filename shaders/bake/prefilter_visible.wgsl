// One level of a GGX chain by sampling visible normals: as prefilter.wgsl, but half vectors come from a spherical cap. Dupuy and
// Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps". Seen along the normal the density is that of all normals
// and even the points come out the same: visible normals pay off for slanted views. `kiln bake` convolves exactly.

import lib::constants::ALPHA_MIN;
import lib::sampling::{hammersley, orthonormal_basis, pdf_ggx_visible, sample_ggx_visible};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment_radiance, filter_level};

struct Settings {
    perceptual_roughness: f32,
    sample_count: u32,
    // Added to the level that is read.
    level_bias: f32,
}

@group(0) @binding(3) var<uniform> settings: Settings;

fn prefiltered_radiance(normal: vec3f) -> vec3f {
    let alpha = settings.perceptual_roughness * settings.perceptual_roughness;
    if alpha <= ALPHA_MIN {
        return environment_radiance(normal, 0.0);
    }
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let h = sample_ggx_visible(vec3f(0.0, 0.0, 1.0), hammersley(i, count), alpha);
        let light = 2.0 * h.z * h - vec3f(0.0, 0.0, 1.0);
        if light.z > 0.0 {
            // Of half vectors over 4 v·h, per steradian of light.
            let pdf = pdf_ggx_visible(1.0, h.z, h.z, dot(h.xy, h.xy), alpha) / max(4.0 * h.z, 1e-6);
            let radiance = environment_radiance(frame * light, filter_level(pdf, count, settings.level_bias));
            sum += light.z * vec4f(radiance, 1.0);
        }
    }
    // Sample 0 is the normal itself, so the weight is at least 1.
    return sum.rgb / max(sum.w, 1e-30);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, prefiltered_radiance(face_direction(id)));
    }
}
