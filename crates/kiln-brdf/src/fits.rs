//! Closed-form fits that renderers use instead of a table, and how far they are from it.

use crate::dfg::{Precision, dfg};
use crate::lobes::Masking;

/// [scale, bias] of Karis' fit for mobile (Karis 2014, "Physically Based Shading on Mobile").
///
/// RMS (worst) error over [0, 1]² of a dielectric's reflectance: 0.029 (0.24) against [`Masking::SchlickIbl`], for which it
/// was made, 0.023 (0.084) against [`Masking::SmithCorrelated`]; of scale 0.070 (0.18) and 0.13 (0.46).
pub fn fit_karis_mobile(n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
    let r = |slope: f64, offset: f64| perceptual_roughness * slope + offset;
    let (x, y, z, w) = (r(-1.0, 1.0), r(-0.0275, 0.0425), r(-0.572, 1.04), r(0.022, -0.04));
    let a004 = (x * x).min(libm::exp2(-9.28 * n_dot_v)) * x + y;
    [-1.04 * a004 + z, 1.04 * a004 + w]
}

/// [scale, bias] of Lazarov's fit (Lazarov 2013, "Getting More Physical in Call of Duty: Black Ops II"), gloss read as
/// 1 − perceptual roughness, as its ports do (the game's gloss was a Blinn–Phong exponent 2^(13 gloss)).
///
/// RMS (worst) error over [0, 1]² of a dielectric's reflectance: 0.032 (0.45) against [`Masking::SchlickIbl`], 0.051 (0.46)
/// against [`Masking::SmithCorrelated`]; of scale 0.19 (0.50) and 0.14 (0.49).
pub fn fit_lazarov(n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
    let gloss = 1.0 - perceptual_roughness;
    let t = |slope: f64, offset: f64| gloss * slope + offset;
    let z = t((0.0275 - 0.25 * 0.04) / 0.96, (0.015 - 0.75 * 0.04) / 0.96);
    let a0 = t(1.0 / 0.96, 0.0) * t(0.475, 0.0).min(libm::exp2(-9.28 * n_dot_v)) + z;
    let a1 = t(0.25, 0.75);
    [a1 - a0, a0]
}

/// Largest error and root mean square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorNorms {
    /// Largest |error|.
    pub worst: f64,
    /// Where it is: [n·v, perceptual roughness].
    pub worst_at: [f64; 2],
    /// Root mean square over the square of both.
    pub rms: f64,
}

impl ErrorNorms {
    /// Of (point [n·v, perceptual roughness], error, the area it stands for); a NaN is the worst.
    pub fn of(errors: impl IntoIterator<Item = ([f64; 2], f64, f64)>) -> Self {
        let mut norms = Self { worst: 0.0, worst_at: [0.0; 2], rms: 0.0 };
        let mut area: f64 = 0.0;
        for (at, error, weight) in errors {
            if error.is_nan() || error.abs() > norms.worst {
                (norms.worst, norms.worst_at) = (error.abs(), at);
            }
            norms.rms += weight * error * error;
            area += weight;
        }
        norms.rms = if area > 0.0 { (norms.rms / area).sqrt() } else { 0.0 };
        norms
    }
}

/// What a fit's terms are off by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitError {
    /// Of the factor of F0.
    pub scale: ErrorNorms,
    /// Of the summand.
    pub bias: ErrorNorms,
    /// Of a dielectric's reflectance, 0.04 · scale + bias, which the fits were made for.
    pub dielectric: ErrorNorms,
}

/// Error of `fit` (n·v, perceptual roughness → [scale, bias]) against [`dfg`] at the centres of `size`² cells of
/// [0, 1]².
pub fn fit_error(masking: Masking, size: usize, fit: impl Fn(f64, f64) -> [f64; 2]) -> FitError {
    let centre = |index: usize| (index as f64 + 0.5) / size as f64;
    let errors: Vec<([f64; 2], [f64; 2])> = (0..size * size)
        .map(|index| {
            let at = [centre(index % size), centre(index / size)];
            let (fitted, exact) = (fit(at[0], at[1]), dfg(masking, at[0], at[1], Precision::Table));
            (at, [fitted[0] - exact[0], fitted[1] - exact[1]])
        })
        .collect();
    let norms = |weights: [f64; 2]| {
        ErrorNorms::of(
            errors.iter().map(|&(at, error)| (at, weights[0] * error[0] + weights[1] * error[1], 1.0)),
        )
    };
    FitError { scale: norms([1.0, 0.0]), bias: norms([0.0, 1.0]), dielectric: norms([0.04, 1.0]) }
}
