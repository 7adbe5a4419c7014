//! A limit on radiance, where a user wants one.

use super::{Defect, Place, Texels, Weights};
use crate::{Cancel, Cancelled, decode::CHECK_TEXELS};

/// What [`limit_radiance`] took away.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimitReport {
    /// Texels over the limit; `worst` is the brightest channel value that was met.
    pub limited: Defect,
    /// ∫ radiance dω before, of each channel, over finite texels; a picture counts as a sphere of equal texels.
    pub flux_before: [f64; 3],
    /// How much of it is gone.
    pub flux_lost: [f64; 3],
    /// Texels with a NaN or infinite value: left as they were. Repair first.
    pub non_finite: usize,
}

impl LimitReport {
    /// Lost over before, of all channels together; 0 where nothing was lost.
    pub fn fraction_lost(&self) -> f64 {
        let lost: f64 = self.flux_lost.iter().sum();
        if lost == 0.0 { 0.0 } else { lost / self.flux_before.iter().sum::<f64>() }
    }
}

/// Scales every texel whose largest channel is above `max` so that this channel is `max`: hue and saturation stay.
///
/// A limit makes the light of the sun a matter of the image's resolution, so nobody calls this unasked, and what it
/// returns must be shown.
///
/// # Panics
/// Where `max` is not above 0.
///
/// # Errors
/// [`Cancelled`], with some texels limited.
pub fn limit_radiance<T: Texels + ?Sized>(
    texels: &mut T,
    max: f32,
    cancel: Cancel,
) -> Result<LimitReport, Cancelled> {
    assert!(max > 0.0, "a limit of {max} leaves no radiance");
    let shape = texels.shape();
    let weights = Weights::new(shape);
    let mut report = LimitReport::default();
    for (index, texel) in texels.rgb_mut().chunks_exact_mut(3).enumerate() {
        if index.is_multiple_of(CHECK_TEXELS) {
            cancel.check()?;
        }
        if !texel.iter().all(|value| value.is_finite()) {
            report.non_finite += 1;
            continue;
        }
        let weight = weights.of(index);
        for (flux, &value) in report.flux_before.iter_mut().zip(texel.iter()) {
            *flux += f64::from(value) * weight;
        }
        let (channel, value) = brightest(texel);
        if value <= max {
            continue;
        }
        let (face, x, y) = shape.position(index);
        report.limited.add(Place { face, x, y, channel, value }, |worst| value > worst);
        let scale = f64::from(max) / f64::from(value);
        for (lost, value) in report.flux_lost.iter_mut().zip(texel.iter_mut()) {
            let limited = (f64::from(*value) * scale) as f32;
            *lost += (f64::from(*value) - f64::from(limited)) * weight;
            *value = limited;
        }
    }
    Ok(report)
}

fn brightest(texel: &[f32]) -> (usize, f32) {
    let mut brightest = (0, texel[0]);
    for (channel, &value) in texel.iter().enumerate() {
        if value > brightest.1 {
            brightest = (channel, value);
        }
    }
    brightest
}
