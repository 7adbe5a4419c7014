// Irradiance over π from a cube map, in two ways: `grid` steps through the hemisphere evenly in both angles, as tutorials do;
// `cosine` draws directions where they count. `kiln bake` needs neither: it is a product of nine harmonics.

import lib::constants::PI;
import lib::sampling::{hammersley, orthonormal_basis, pdf_cosine, sample_cosine, spherical_direction};
import super::faces::{face_direction, is_inside, store_radiance};
import super::source::{environment_radiance, filter_level};

struct Settings {
    // `grid`: radians between directions; 0.025 in tutorials.
    step: f32,
    // `cosine`: directions.
    sample_count: u32,
    // `cosine`: added to the level that is read.
    level_bias: f32,
}

@group(0) @binding(3) var<uniform> settings: Settings;

// E / π = (1/π) ∫ L cos θ sin θ dθ dφ over [0, 2π] × [0, π/2], by the rectangle rule.
fn irradiance_grid(normal: vec3f) -> vec3f {
    let frame = orthonormal_basis(normal);
    let step = clamp(settings.step, 1e-3, 1.0);
    let columns = u32(ceil(2.0 * PI / step));
    let rows = u32(ceil(0.5 * PI / step));
    var sum = vec3f(0.0);
    for (var column = 0u; column < columns; column++) {
        let turn = f32(column) * step / (2.0 * PI);
        for (var row = 0u; row < rows; row++) {
            let theta = f32(row) * step;
            let light = frame * spherical_direction(sin(theta), cos(theta), turn);
            sum += cos(theta) * sin(theta) * environment_radiance(light, 0.0);
        }
    }
    // (1/π) (2π) (π/2) over the number of directions.
    return sum * (PI / f32(max(columns * rows, 1u)));
}

// The mean of the radiance along directions distributed as cos θ / π.
fn irradiance_cosine(normal: vec3f) -> vec3f {
    let frame = orthonormal_basis(normal);
    let count = max(settings.sample_count, 1u);
    var sum = vec3f(0.0);
    for (var i = 0u; i < count; i++) {
        let light = sample_cosine(hammersley(i, count));
        let level = filter_level(pdf_cosine(light.z), count, settings.level_bias);
        sum += environment_radiance(frame * light, level);
    }
    return sum / f32(count);
}

@compute @workgroup_size(8, 8)
fn grid(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, irradiance_grid(face_direction(id)));
    }
}

@compute @workgroup_size(8, 8)
fn cosine(@builtin(global_invocation_id) id: vec3u) {
    if is_inside(id) {
        store_radiance(id, irradiance_cosine(face_direction(id)));
    }
}
