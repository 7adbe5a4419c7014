//! Irradiance from spherical harmonics, as engines without a map of it light diffusely.

use half::f16;
use kiln_diagnostic::Diagnostic;
use kiln_sphere::{cube_direction, real_harmonics};
use serde::Deserialize;

/// Edge of the faces. A polynomial of degree 8 between texels of 2.8° is off by less than binary16 rounds.
pub(crate) const FACE_SIZE: usize = 32;

/// Highest degree that is accepted; what kiln.toml can ask for.
const ORDER_MAX: usize = 8;

/// The part of a `sh` target that is read.
#[derive(Deserialize)]
struct Facts {
    order: usize,
    irradiance_over_pi: Vec<[f64; 3]>,
}

/// Six faces of RGBA in binary16 and the power of two that they are divided by. Where harmonics ring below 0 they are 0, as
/// engines clamp them.
///
/// # Errors
/// What is wrong with the text.
pub(crate) fn irradiance_cube(name: &str, json: &[u8]) -> Result<(Vec<u8>, i32), Diagnostic> {
    let facts: Facts = serde_json::from_slice(json)
        .map_err(|error| Diagnostic::error(format!("the harmonics of `{name}` are malformed: {error}")))?;
    let Facts { order, irradiance_over_pi: coefficients } = facts;
    if order > ORDER_MAX || coefficients.len() != (order + 1) * (order + 1) {
        let count = coefficients.len();
        let message = format!("`{name}` has {count} coefficients of order {order}");
        let help = format!("order n has (n + 1)² of them, and n is at most {ORDER_MAX}");
        return Err(Diagnostic::error(message).with_help(help));
    }
    let centre = |index: usize| (2 * index + 1) as f64 / FACE_SIZE as f64 - 1.0;
    let texel = |index: usize| {
        let (face, inside) = (index / (FACE_SIZE * FACE_SIZE), index % (FACE_SIZE * FACE_SIZE));
        let direction = cube_direction(face, centre(inside % FACE_SIZE), centre(inside / FACE_SIZE));
        let basis = real_harmonics(direction, order);
        let sum = |channel: usize| -> f64 {
            coefficients.iter().zip(&basis).map(|(coefficient, y)| coefficient[channel] * y).sum()
        };
        // Also for NaN, which JSON cannot hold and a sum of huge numbers can be.
        [0, 1, 2].map(|channel| sum(channel).max(0.0))
    };
    let texels: Vec<[f64; 3]> = (0..6 * FACE_SIZE * FACE_SIZE).map(texel).collect();
    let largest = texels.iter().flatten().copied().fold(0.0, f64::max);
    let scale_log2 = (0..128).find(|&log2| largest / f64::from(log2).exp2() <= f64::from(f16::MAX));
    let Some(scale_log2) = scale_log2 else {
        return Err(Diagnostic::error(format!("the harmonics of `{name}` are too large to be shown")));
    };
    let factor = (-f64::from(scale_log2)).exp2();
    let rgba = |[r, g, b]: &[f64; 3]| [r * factor, g * factor, b * factor, 1.0];
    let bytes = texels.iter().flat_map(rgba).flat_map(|value| f16::from_f64(value).to_le_bytes()).collect();
    Ok((bytes, scale_log2))
}
