// Maps of Lambert, GGX and Charlie as Khronos' sampler for glTF makes them: importance sampling, the level from the density.
// Its level lacks the sphere's 4π, so it reads 1.8 levels above what a sample stands for: smooth and biased. `kiln bake`
// convolves exactly.

import lib::brdf::{d_charlie, d_ggx};
import lib::constants::ALPHA_MIN;
import lib::sampling::{hammersley, orthonormal_basis, pdf_cosine, sample_charlie, sample_cosine, sample_ggx};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment, environment_radiance};

struct Settings {
    perceptual_roughness: f32,
    sample_count: u32,
}

@group(0) @binding(3) var<uniform> settings: Settings;

// Finite where the density is 0, as it is of Charlie's first sample.
fn sample_level(pdf: f32, count: u32) -> f32 {
    let size = f32(textureDimensions(environment).x);
    let texels = 6.0 * max(size * size, 1.0);
    return max(0.5 * log2(texels / max(f32(count) * pdf, 1e-12)), 0.0);
}

fn lambert_radiance(normal: vec3f) -> vec3f {
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    var sum = vec3f(0.0);
    for (var i = 0u; i < count; i++) {
        let light = sample_cosine(hammersley(i, count));
        sum += environment_radiance(frame * light, sample_level(pdf_cosine(light.z), count));
    }
    return sum / f32(count);
}

// A light weighted by n·l, for a half vector and its density as that of lights.
fn reflected(frame: mat3x3f, h: vec3f, pdf: f32, count: u32) -> vec4f {
    let light = 2.0 * h.z * h - vec3f(0.0, 0.0, 1.0);
    if light.z <= 0.0 {
        return vec4f(0.0);
    }
    return light.z * vec4f(environment_radiance(frame * light, sample_level(pdf, count)), 1.0);
}

fn ggx_radiance(normal: vec3f, alpha: f32) -> vec3f {
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let h = sample_ggx(hammersley(i, count), alpha);
        sum += reflected(frame, h, 0.25 * d_ggx(h.z, dot(h.xy, h.xy), alpha), count);
    }
    return sum.rgb / max(sum.w, 1e-30);
}

fn charlie_radiance(normal: vec3f, alpha: f32) -> vec3f {
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let h = sample_charlie(hammersley(i, count), alpha);
        sum += reflected(frame, h, 0.25 * d_charlie(dot(h.xy, h.xy), alpha), count);
    }
    return sum.rgb / max(sum.w, 1e-30);
}

fn settings_alpha() -> f32 {
    return max(settings.perceptual_roughness * settings.perceptual_roughness, ALPHA_MIN);
}

@compute @workgroup_size(8, 8)
fn lambert(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, lambert_radiance(face_direction(id)));
    }
}

@compute @workgroup_size(8, 8)
fn ggx(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, ggx_radiance(face_direction(id), settings_alpha()));
    }
}

@compute @workgroup_size(8, 8)
fn charlie(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, charlie_radiance(face_direction(id), settings_alpha()));
    }
}
