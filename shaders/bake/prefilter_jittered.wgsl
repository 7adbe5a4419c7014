// One level of a GGX chain as the common Vulkan samples do it: Hammersley's points, read one level above what their density asks
// for, turned about each texel's normal by up to a tenth of a radian. Their hash of the normal is chaotic in f32, so the
// texel's number comes as a texture. 32 samples there. `kiln bake` convolves exactly.

import lib::brdf::d_ggx;
import lib::constants::{ALPHA_MIN, PI};
import lib::sampling::{hammersley, sample_ggx};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment, environment_radiance};

struct Settings {
    perceptual_roughness: f32,
    sample_count: u32,
}

@group(0) @binding(3) var<uniform> settings: Settings;
// Red: a number in [0, 1) for each texel that is written.
@group(0) @binding(4) var jitter: texture_2d_array<f32>;

// Around +Z, and around +X where the normal is close to ±Z.
fn z_up_basis(normal: vec3f) -> mat3x3f {
    let up = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 0.0, 1.0), abs(normal.z) < 0.999);
    let tangent = normalize(cross(up, normal));
    return mat3x3f(tangent, cross(normal, tangent), normal);
}

fn prefiltered_radiance(normal: vec3f, number: f32) -> vec3f {
    let alpha = settings.perceptual_roughness * settings.perceptual_roughness;
    if alpha <= ALPHA_MIN {
        return environment_radiance(normal, 0.0);
    }
    let frame = z_up_basis(normal);
    let count = max(settings.sample_count, 1u);
    let size = f32(textureDimensions(environment).x);
    let texel_sr = 4.0 * PI / (6.0 * max(size * size, 1.0));
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let point = hammersley(i, count);
        let h = sample_ggx(vec2f(point.x + 0.1 * number / (2.0 * PI), point.y), alpha);
        let light = 2.0 * h.z * h - vec3f(0.0, 0.0, 1.0);
        if light.z > 0.0 {
            // The offset keeps the division from 0.
            let pdf = 0.25 * d_ggx(h.z, dot(h.xy, h.xy), alpha) + 1e-4;
            let sample_sr = 1.0 / max(f32(count) * pdf, 1e-12);
            let level = max(0.5 * log2(max(sample_sr / texel_sr, 1e-30)) + 1.0, 0.0);
            sum += light.z * vec4f(environment_radiance(frame * light, level), 1.0);
        }
    }
    // Sample 0 is the normal itself, so the weight is at least 1.
    return sum.rgb / max(sum.w, 1e-30);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        let number = textureLoad(jitter, id.xy, id.z, 0).r;
        store_radiance(id, prefiltered_radiance(face_direction(id), number));
    }
}
