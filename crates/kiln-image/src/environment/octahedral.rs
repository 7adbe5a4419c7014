//! Octahedral maps: the sphere folded onto a square.
//!
//! Source: Engelhardt and Dachsbacher 2008, "Octahedron Environment Maps"; Cigolle et al. 2014, "A Survey of Efficient
//! Representations for Independent Unit Vectors" (there with +Z up; here +Y).

use crate::{Bulk, Cancel, DecodeError, Image, Limits, Panorama, decode::check_size};
use std::f64::consts::PI;

/// Unit direction at (`u`, `v`) in [0, 1]² of an octahedral map, from its top left; +Y in the centre, +X at the right, −Z at
/// the top.
pub fn octahedral_direction(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let y = 1.0 - a.abs() - b.abs();
    let (x, z) = if y >= 0.0 { (a, b) } else { fold(a, b) };
    let inverse_length = 1.0 / (x * x + y * y + z * z).sqrt();
    [x * inverse_length, y * inverse_length, z * inverse_length]
}

/// Position of a direction of any length but zero; undoes [`octahedral_direction`].
pub fn octahedral_uv(direction: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = direction;
    let inverse_norm = 1.0 / (x.abs() + y.abs() + z.abs());
    let (a, b) = (x * inverse_norm, z * inverse_norm);
    let (a, b) = if y >= 0.0 { (a, b) } else { fold(a, b) };
    [0.5 * a + 0.5, 0.5 * b + 0.5]
}

/// Mirrors a triangle at the diamond's edge; its own inverse.
fn fold(a: f64, b: f64) -> (f64, f64) {
    (libm::copysign(1.0 - b.abs(), a), libm::copysign(1.0 - a.abs(), b))
}

/// Samples along each side of a panorama texel: 16 a texel, more where the map is so small that its texels' slanted edges
/// show.
fn samples_per_side(size: usize) -> usize {
    (128 / size).clamp(4, 16)
}

/// A panorama as high as the map: the equator crosses about 2 · size of its texels.
///
/// The samples of a texel share its solid angle equally (even steps in longitude and in y), so the mean is the
/// integral's; each takes the map's texel it falls into, as that is a constant patch.
pub(super) fn resample(map: &Image, limits: &Limits, cancel: Cancel) -> Result<Panorama, DecodeError> {
    let size = map.width;
    let (width, height) = (2 * size, size);
    check_size("octahedral map as panorama", width, height, limits)?;
    let samples = samples_per_side(size);
    let columns: Vec<(f64, f64)> = (0..width * samples)
        .map(|column| libm::sincos(2.0 * PI * ((column as f64 + 0.5) / (width * samples) as f64 - 0.5)))
        .collect();
    let mut rgb = Bulk::new(Vec::with_capacity(width * height * 3));
    let index = |position: f64| ((position * size as f64) as usize).min(size - 1);
    for row in 0..height {
        let edge = |row: usize| libm::cos(PI * row as f64 / height as f64);
        let (top, bottom) = (edge(row), edge(row + 1));
        let rings: Vec<(f64, f64)> = (0..samples)
            .map(|sample| {
                let y = top + (bottom - top) * (sample as f64 + 0.5) / samples as f64;
                (y, (1.0 - y * y).max(0.0).sqrt())
            })
            .collect();
        for longitudes in columns.chunks_exact(samples) {
            let mut sum = [0.0; 3];
            for &(y, radius) in &rings {
                for &(sin, cos) in longitudes {
                    let [u, v] = octahedral_uv([radius * sin, y, -radius * cos]);
                    let texel = map.texel(index(u), index(v));
                    sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += f64::from(value));
                }
            }
            rgb.extend(sum.map(|sum| (sum / (samples * samples) as f64) as f32));
            // 16 samples a texel: a row of 16384 would be milliseconds.
            cancel.check()?;
        }
    }
    Ok(Panorama::new(Image::new(width, height, rgb.into_inner())?)?)
}
