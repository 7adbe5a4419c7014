//! Panorama → what all its lighting maps are made from.

use crate::bright::{BrightTexel, take_brightest, without};
use crate::patch::Patch;
use kiln_image::Panorama;
use kiln_sphere::{Cancel, Cancelled, Harmonics, Lobe};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Highest band limit [`analyse`] chooses: GGX of α = 1/256 to 1e-4. Beyond it memory, not time, is the limit
/// (counted: about 0.9 GB while a map of all its degrees is made).
pub const BAND_LIMIT_MAX: usize = 2047;
/// Most texels that are convolved directly: a sun of 0.53° covers 28 texels of a panorama 4096 wide, 450 of the largest,
/// but at the zenith all texels of the first row of one 1024 wide.
pub const BRIGHT_MAX: usize = 2048;
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
    let Division { whole, bright, rest, band_limit } = divide(panorama, request, cancel)?;
    let by_row = BrightRows::new(width, &bright);
    let dim_row = |row: usize| by_row.dim(row, whole_row(panorama, row));
    let dim = kiln_sphere::analyse_rows(width, height, dim_row, band_limit, cancel)?;
    let mut low = dim.truncated(LOW_BAND_LIMIT);
    if !bright.is_empty() {
        let excess_row = |row: usize| by_row.excess(row);
        low.add(&kiln_sphere::analyse_rows(width, height, excess_row, LOW_BAND_LIMIT, cancel)?);
    }
    Ok(Analysis {
        width,
        height,
        error: request.error,
        dim,
        dim_energy: rest.energy,
        bright,
        low,
        range: whole.range,
    })
}

/// What of a panorama is transformed, and what is not.
struct Division {
    whole: Sums,
    bright: Vec<BrightTexel>,
    /// The panorama without the bright texels' excess.
    rest: Sums,
    band_limit: usize,
}

fn divide(panorama: &Panorama, request: &AnalysisRequest, cancel: Cancel) -> Result<Division, Cancelled> {
    let (width, height) = (panorama.width(), panorama.height());
    let whole = sums(width, height, |row| whole_row(panorama, row), cancel)?;
    let need = Need::new(request, whole.mean(), whole.variance(), cancel)?;
    let bright = take_brightest(width, height, panorama.rgb(), &whole, &need, cancel)?;
    let by_row = BrightRows::new(width, &bright);
    let dim_row = |row: usize| by_row.dim(row, whole_row(panorama, row));
    let rest = if bright.is_empty() { whole.clone() } else { sums(width, height, dim_row, cancel)? };
    let band_limit = need.band_limit(rest.variance());
    Ok(Division { whole, bright, rest, band_limit })
}

fn whole_row(panorama: &Panorama, row: usize) -> Cow<'_, [f32]> {
    let width = panorama.width();
    Cow::Borrowed(&panorama.rgb()[row * width * 3..][..width * 3])
}

/// What [`analyse`] will make of a panorama, known before its transform is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Highest degree.
    pub band_limit: usize,
    /// Texels that are convolved directly.
    pub bright_texels: usize,
    /// Standard deviation of what is transformed, relative to the mean radiance.
    pub contrast: f64,
}

/// Looks at each texel once, and transforms nothing.
///
/// # Errors
/// [`Cancelled`] within a row's work.
pub fn forecast(
    panorama: &Panorama,
    request: &AnalysisRequest,
    cancel: Cancel,
) -> Result<Forecast, Cancelled> {
    let Division { whole, bright, rest, band_limit } = divide(panorama, request, cancel)?;
    let mean = square(whole.mean()).sqrt();
    let contrast = if mean > 0.0 { rest.variance().sqrt() / mean } else { 0.0 };
    Ok(Forecast { band_limit, bright_texels: bright.len(), contrast })
}

/// Bright texels by their rows: rows without and rows of nothing but their excess are made as they are read, since a
/// copy of a large panorama would be most of the memory an analysis takes.
struct BrightRows<'a> {
    width: usize,
    rows: BTreeMap<usize, Vec<&'a BrightTexel>>,
    black: Vec<f32>,
}

impl<'a> BrightRows<'a> {
    fn new(width: usize, bright: &'a [BrightTexel]) -> Self {
        let mut rows = BTreeMap::<_, Vec<_>>::new();
        for texel in bright {
            rows.entry(texel.index / width).or_default().push(texel);
        }
        Self { width, rows, black: vec![0.0; width * 3] }
    }

    /// A row without its bright texels' excess.
    fn dim<'b>(&self, row: usize, mut whole: Cow<'b, [f32]>) -> Cow<'b, [f32]> {
        for texel in self.rows.get(&row).into_iter().flatten() {
            without(&mut whole.to_mut()[texel.index % self.width * 3..][..3], texel.excess);
        }
        whole
    }

    /// The excess alone.
    fn excess(&self, row: usize) -> Cow<'_, [f32]> {
        let mut values = Cow::Borrowed(self.black.as_slice());
        for texel in self.rows.get(&row).into_iter().flatten() {
            let place = texel.index % self.width * 3;
            values.to_mut()[place..place + 3].copy_from_slice(&texel.excess.map(|value| value as f32));
        }
        values
    }
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

/// Integrals over the sphere of constant patches.
#[derive(Clone)]
pub(crate) struct Sums {
    /// ∫ f dω.
    flux: [f64; 3],
    /// ∫ |f|² dω, summed over the channels.
    pub(crate) energy: f64,
    /// Least and greatest texel per channel.
    range: [[f64; 2]; 3],
}

impl Sums {
    pub(crate) fn mean(&self) -> [f64; 3] {
        self.flux.map(|flux| flux / (4.0 * PI))
    }

    /// Mean of |f − its mean|² over the sphere, summed over the channels.
    pub(crate) fn variance(&self) -> f64 {
        (self.energy / (4.0 * PI) - square(self.mean())).max(0.0)
    }

    /// The same without `excess` of a texel of that value.
    pub(crate) fn without(&self, value: [f64; 3], excess: [f64; 3], solid_angle_sr: f64) -> Sums {
        let rest = std::array::from_fn(|i| value[i] - excess[i]);
        Sums {
            flux: std::array::from_fn(|i| self.flux[i] - solid_angle_sr * excess[i]),
            energy: self.energy - solid_angle_sr * (square(value) - square(rest)),
            range: self.range,
        }
    }
}

fn sums<'a>(
    width: usize,
    height: usize,
    row: impl Fn(usize) -> Cow<'a, [f32]>,
    cancel: Cancel,
) -> Result<Sums, Cancelled> {
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    let (mut flux, mut energy) = ([0.0; 3], 0.0);
    for index in 0..height {
        cancel.check()?;
        let texels = row(index);
        let solid_angle_sr = Patch::of_texel(width, height, index * width).solid_angle_sr();
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        for texel in texels.chunks_exact(3) {
            for channel in 0..3 {
                let value = f64::from(texel[channel]);
                let [low, high] = &mut range[channel];
                (*low, *high) = (low.min(value), high.max(value));
                sum[channel] += value;
                squares[channel] += value * value;
            }
        }
        for (flux, sum) in flux.iter_mut().zip(sum) {
            *flux += solid_angle_sr * sum;
        }
        energy += solid_angle_sr * squares.iter().sum::<f64>();
    }
    Ok(Sums { flux, energy, range })
}

fn square(rgb: [f64; 3]) -> f64 {
    rgb.iter().map(|value| value * value).sum()
}

/// What convolving one texel for all texels of a chain costs, in units of L²: measured, 0.4 ms beside 0.8 µs · L².
const TEXEL_COST: f64 = 500.0;

/// The same of a Charlie chain, which has no place that its lobe does not reach, and takes logarithms: measured, 50 ms.
const SHEEN_TEXEL_COST: f64 = 60_000.0;

/// How many degrees a request needs, by the variance of what is transformed.
pub(crate) struct Need {
    /// What a texel that is convolved directly costs, in units of L².
    pub(crate) texel_cost: f64,
    /// error/2 · mean.
    error: f64,
    /// The lobes' spectra, as far as the whole environment needs them.
    spectra: Vec<Vec<f64>>,
}

impl Need {
    pub(crate) fn new(
        request: &AnalysisRequest,
        mean: [f64; 3],
        variance_max: f64,
        cancel: Cancel,
    ) -> Result<Need, Cancelled> {
        let error = 0.5 * request.error * square(mean).sqrt();
        let allowed = error / variance_max.sqrt();
        let sheen = request.sheen_alpha_min.map(|alpha| Lobe::Charlie { alpha });
        let lobes = [Lobe::Ggx { alpha: request.alpha_min }].into_iter().chain(sheen);
        let spectra = lobes.map(|lobe| spectrum_above(crate::prefilter::usable(lobe), allowed, cancel));
        let texel_cost = if request.sheen_alpha_min.is_some() { SHEEN_TEXEL_COST } else { TEXEL_COST };
        Ok(Need { texel_cost, error, spectra: spectra.collect::<Result<_, _>>()? })
    }

    /// The smallest L with max_{l > L} |κ_l| √variance ≤ error/2 · mean.
    pub(crate) fn band_limit(&self, variance: f64) -> usize {
        if variance <= 0.0 {
            return LOW_BAND_LIMIT;
        }
        let allowed = self.error / variance.sqrt();
        let last = |kappa: &Vec<f64>| kappa.iter().rposition(|k| k.abs() > allowed || allowed.is_nan());
        self.spectra.iter().filter_map(last).fold(LOW_BAND_LIMIT, usize::max)
    }
}

/// A lobe's spectrum up to where it stays below `allowed`, at most [`BAND_LIMIT_MAX`].
fn spectrum_above(lobe: Lobe, allowed: f64, cancel: Cancel) -> Result<Vec<f64>, Cancelled> {
    // A spectrum costs its length squared; one that stays below for half of it does not come back.
    let mut limit = 255;
    loop {
        let kappa = lobe.kernel(limit, cancel)?.kappa;
        let last = kappa.iter().rposition(|k| k.abs() > allowed || allowed.is_nan()).unwrap_or(0);
        if limit == BAND_LIMIT_MAX || 2 * last < limit {
            return Ok(kappa);
        }
        limit = (2 * limit + 1).min(BAND_LIMIT_MAX);
    }
}
