// One level of a GGX chain from a cube map, by importance sampling: half vectors from Hammersley's points, N = V = R, lights
// weighted by n·l, each read from the mip that its density asks for. Karis 2013, "Real Shading in Unreal Engine 4", section
// "Pre-Filtered Environment Map". Biased by the mips and noisy without them; `kiln bake` convolves exactly.

import lib::brdf::d_ggx;
import lib::constants::ALPHA_MIN;
import lib::sampling::{hammersley, orthonormal_basis, sample_ggx};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment_radiance, filter_level};

struct Settings {
    perceptual_roughness: f32,
    sample_count: u32,
    // Added to the level that is read: 0 in tutorials, 1 in the Vulkan samples.
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
        // With V = N: n·h = v·h = h.z, and the view mirrored at h is 2 (n·h) h - n.
        let h = sample_ggx(hammersley(i, count), alpha);
        let light = 2.0 * h.z * h - vec3f(0.0, 0.0, 1.0);
        if light.z > 0.0 {
            // D (n·h) / (4 v·h), per steradian of light. Walter et al. 2007, equations 14 and 24.
            let pdf = 0.25 * d_ggx(h.z, dot(h.xy, h.xy), alpha);
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
