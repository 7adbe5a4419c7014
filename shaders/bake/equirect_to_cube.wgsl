// A panorama onto a cube map: bilinear lookups at sub-texel centres, weighted by their solid angles. One lookup a texel is
// what tutorials do; it skips texels of panoramas finer than the cube. `kiln bake` integrates the overlaps instead.

import lib::sphere::{cube_direction, cube_texel_solid_angle_sr, panorama_uv};
import super::faces::{faces, face_position, is_inside, store_radiance};

struct Settings {
    // Lookups along each edge of a texel.
    samples_per_edge: u32,
}

@group(0) @binding(1) var panorama: texture_2d<f32>;
// Repeats in u, so that the left and right columns are neighbours; clamps in v.
@group(0) @binding(2) var panorama_sampler: sampler;
@group(0) @binding(3) var<uniform> settings: Settings;

fn texel_radiance(face: u32, st: vec2f, face_size: u32) -> vec3f {
    let count = clamp(settings.samples_per_edge, 1u, 64u);
    let edge = 2.0 / f32(max(face_size, 1u));
    var sum = vec4f(0.0);
    for (var i = 0u; i < count * count; i++) {
        let within = (vec2f(vec2u(i % count, i / count)) + 0.5) / f32(count) - 0.5;
        let at = st + edge * within;
        let weight = cube_texel_solid_angle_sr(at, face_size);
        // The level is stated: derivatives would jump at the wrap column.
        let texel = textureSampleLevel(panorama, panorama_sampler, panorama_uv(cube_direction(face, at)), 0.0);
        sum += weight * vec4f(texel.rgb, 1.0);
    }
    // No weight is 0.
    return sum.rgb / max(sum.w, 1e-30);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, texel_radiance(id.z, face_position(id), textureDimensions(faces).x));
    }
}
