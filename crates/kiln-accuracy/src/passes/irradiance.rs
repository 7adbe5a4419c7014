//! Irradiance over π in two ways: twin of `shaders/bake/irradiance.wgsl`.

use std::f64::consts::PI;

use kiln_brdf::sampling::{hammersley, pdf_cosine, sample_cosine};

use super::{Tap, Taps, filter_level};

/// (1/π) ∫ L cos θ sin θ dθ dφ by the rectangle rule with `step` radians between directions: 0.025 in tutorials. Of a constant
/// environment it is off by less than 1.3 times the step.
pub fn irradiance_grid(step: f64) -> Taps {
    let (columns, rows) = ((2.0 * PI / step).ceil() as u32, (0.5 * PI / step).ceil() as u32);
    let tap = |column: u32, row: u32| {
        let (sin_phi, cos_phi) = libm::sincos(f64::from(column) * step);
        let (sine, cosine) = libm::sincos(f64::from(row) * step);
        Tap { light: [sine * cos_phi, sine * sin_phi, cosine], level: 0.0, weight: cosine * sine }
    };
    let taps = (0..columns).flat_map(|column| (0..rows).map(move |row| tap(column, row)));
    Taps::new(taps.filter(|tap| tap.weight != 0.0).collect(), f64::from(columns * rows) / PI)
}

/// The mean along `count` directions distributed as cos θ / π, each read at the level that its density asks for plus
/// `level_bias`.
pub fn irradiance_cosine(face_size: usize, count: u32, level_bias: f64) -> Taps {
    let tap = |index: u32| {
        let light = sample_cosine(hammersley(index, count));
        Tap { light, level: filter_level(face_size, pdf_cosine(light[2]), count, level_bias), weight: 1.0 }
    };
    Taps::new((0..count).map(tap).collect(), f64::from(count))
}
