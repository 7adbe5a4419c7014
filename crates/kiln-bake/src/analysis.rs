//! Panorama → what all its lighting maps are made from.

use crate::bright::{BrightTexel, take_brightest};
use crate::patch::Patch;
use kiln_image::Panorama;
use kiln_sphere::{Bulk, Cancel, Cancelled, Harmonics, Lobe};
use std::f64::consts::PI;

/// Highest band limit [`analyse`] chooses: GGX of α = 1/256 to 1e-4. Beyond it memory, not time, is the limit
/// (counted: about 0.9 GB while a map of all its degrees is made).
pub const BAND_LIMIT_MAX: usize = 2047;
/// Most texels that are convolved directly.
pub const BRIGHT_MAX: usize = 64;
/// Degrees kept of the whole environment, bright texels included, for [`crate::sh`].
pub(crate) const LOW_BAND_LIMIT: usize = 8;

/// What an analysis must be good for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalysisRequest {
    /// Smallest GGX α that will be asked for; (0, 1].
    pub alpha_min: f64,
    /// Smallest Charlie α, where there will be sheen maps; (0, 1].
    pub sheen_alpha_min: Option<f64>,
    /// Relative RMS error each prefiltered map may have from the transform, encoding not counted.
    pub error: f64,
}

/// An environment's harmonics up to a band limit, its brightest texels apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) error: f64,
    /// Harmonics of the environment without the excess of the bright texels.
    pub(crate) dim: Harmonics,
    /// ∫ |dim|² dω, all degrees, summed over the channels.
    pub(crate) dim_energy: f64,
    pub(crate) bright: Vec<BrightTexel>,
    /// Harmonics of the whole environment, degrees up to 8.
    pub(crate) low: Harmonics,
    /// Least and greatest texel per channel.
    pub(crate) range: [[f64; 2]; 3],
}

/// Analyses a panorama of finite, not negative texels, of any 2:1 size.
///
/// The band limit follows the error asked for: with V the variance of the dim part over the sphere, the smallest L
/// with max_{l > L} |κ_l| √V ≤ error/2 · mean, κ the spectrum of `alpha_min`; at most [`BAND_LIMIT_MAX`]. What is
/// reached is stated by each map ([`crate::Accuracy`]).
///
/// # Errors
/// [`Cancelled`] within a row's or a block of rings' work.
pub fn analyse(
    panorama: &Panorama,
    request: &AnalysisRequest,
    cancel: Cancel,
) -> Result<Analysis, Cancelled> {
    let (width, height) = (panorama.width(), panorama.height());
    let low = kiln_sphere::analyse(width, height, panorama.rgb(), LOW_BAND_LIMIT, cancel)?;
    let mut rgb = Bulk::new(Vec::with_capacity(panorama.rgb().len()));
    for row in panorama.rgb().chunks_exact(width * 3) {
        cancel.check()?;
        rgb.extend_from_slice(row);
    }
    let bright = take_brightest(width, &mut rgb, low.mean(), BRIGHT_MAX, cancel)?;
    let dim_energy = energy(width, height, &rgb, cancel)?;
    let variance = variance_of_rest(low.mean(), dim_energy, width, height, &bright);
    let band_limit = choose_band_limit(request, low.mean(), variance, cancel)?;
    let dim = kiln_sphere::analyse(width, height, &rgb, band_limit, cancel)?;
    Ok(Analysis {
        width,
        height,
        error: request.error,
        dim,
        dim_energy,
        bright,
        low,
        range: range(width, panorama.rgb(), cancel)?,
    })
}

impl Analysis {
    /// Highest degree known.
    pub fn band_limit(&self) -> usize {
        self.dim.band_limit()
    }

    /// Mean radiance over the sphere, per channel.
    pub fn mean(&self) -> [f64; 3] {
        self.low.mean()
    }
}

/// Mean of |dim − its mean|² over the sphere, summed over the channels.
fn variance_of_rest(
    mean: [f64; 3],
    dim_energy: f64,
    width: usize,
    height: usize,
    bright: &[BrightTexel],
) -> f64 {
    let mut dim_mean = mean;
    for texel in bright {
        let share = Patch::of_texel(width, height, texel.index).solid_angle_sr() / (4.0 * PI);
        for (mean, excess) in dim_mean.iter_mut().zip(texel.excess) {
            *mean -= share * excess;
        }
    }
    (dim_energy / (4.0 * PI) - square(dim_mean)).max(0.0)
}

fn square(rgb: [f64; 3]) -> f64 {
    rgb.iter().map(|value| value * value).sum()
}

pub(crate) fn choose_band_limit(
    request: &AnalysisRequest,
    mean: [f64; 3],
    variance: f64,
    cancel: Cancel,
) -> Result<usize, Cancelled> {
    if variance <= 0.0 {
        return Ok(LOW_BAND_LIMIT);
    }
    let allowed = 0.5 * request.error * (square(mean) / variance).sqrt();
    let sheen = request.sheen_alpha_min.map(|alpha| Lobe::Charlie { alpha });
    let mut band_limit = LOW_BAND_LIMIT;
    for lobe in [Lobe::Ggx { alpha: request.alpha_min }].into_iter().chain(sheen) {
        let kappa = crate::prefilter::usable(lobe).kernel(BAND_LIMIT_MAX, cancel)?.kappa;
        let last_needed = kappa.iter().rposition(|k| k.abs() > allowed || allowed.is_nan()).unwrap_or(0);
        band_limit = band_limit.max(last_needed);
    }
    Ok(band_limit)
}

/// ∫ |f|² dω of constant patches, summed over the channels.
fn energy(width: usize, height: usize, rgb: &[f32], cancel: Cancel) -> Result<f64, Cancelled> {
    let row_energy = |(row, texels): (usize, &[f32])| {
        cancel.check()?;
        let solid_angle_sr = Patch::of_texel(width, height, row * width).solid_angle_sr();
        Ok(solid_angle_sr * texels.iter().map(|&value| f64::from(value) * f64::from(value)).sum::<f64>())
    };
    rgb.chunks_exact(width * 3).enumerate().map(row_energy).sum()
}

fn range(width: usize, rgb: &[f32], cancel: Cancel) -> Result<[[f64; 2]; 3], Cancelled> {
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for row in rgb.chunks_exact(width * 3) {
        cancel.check()?;
        for texel in row.chunks_exact(3) {
            for ([low, high], &value) in range.iter_mut().zip(texel) {
                (*low, *high) = (low.min(value.into()), high.max(value.into()));
            }
        }
    }
    Ok(range)
}
