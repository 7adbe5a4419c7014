// One level of a GGX chain as Blender's Eevee made its light probes before version 4: few samples, each read from a high mip. The
// angle from the normal follows i / count, the azimuth a table of 8192 radical inverses. 1, 16, 32, 64 samples for the first mips
// and 128 for the others; alpha = (mip / last)⁴. Smooth, fast and biased; `kiln bake` convolves exactly.

import lib::brdf::d_ggx;
import lib::constants::{ALPHA_MIN, PI};
import lib::sampling::{orthonormal_basis, radical_inverse, sample_ggx};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment, environment_radiance};

struct Settings {
    perceptual_roughness: f32,
    sample_count: u32,
    // Added to the level that is read: -1 for the first mip, 1 for the others.
    level_bias: f32,
}

// Entries of the table of Hammersley's points.
const TABLE_SIZE: u32 = 8192u;

@group(0) @binding(3) var<uniform> settings: Settings;

fn prefiltered_radiance(normal: vec3f) -> vec3f {
    let alpha = settings.perceptual_roughness * settings.perceptual_roughness;
    if alpha <= ALPHA_MIN {
        return environment_radiance(normal, 0.0);
    }
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    let size = f32(textureDimensions(environment).x);
    let level_factor = settings.level_bias + 0.5 * log2(max(size * size, 1.0) / f32(count));
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let h = sample_ggx(vec2f(radical_inverse(i % TABLE_SIZE), f32(i) / f32(count)), alpha);
        let light = 2.0 * h.z * h - vec3f(0.0, 0.0, 1.0);
        if light.z > 0.0 {
            // Of half vectors; of lights it would be a quarter, which a level of bias makes up for.
            let pdf = d_ggx(h.z, dot(h.xy, h.xy), alpha) * h.z;
            // A texel is taken for 4π/6 of a face.
            let distortion = 4.0 * PI / 6.0;
            let level = max(level_factor - 0.5 * log2(max(pdf * distortion, 1e-12)), 0.0);
            sum += light.z * vec4f(environment_radiance(frame * light, level), 1.0);
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
