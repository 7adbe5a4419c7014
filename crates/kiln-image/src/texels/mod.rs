//! What is wrong with the numbers of an image, a panorama or a cube, and what may be done about it.

mod limit;
mod repair;
mod shape;

pub use limit::{LimitReport, limit_radiance};
pub use repair::repair_texels;
pub use shape::{Shape, Texels};

use crate::{
    Cancel, Cancelled, FACE_NAMES,
    colour::{Gamut, luminance},
    decode::CHECK_TEXELS,
};
use shape::Weights;
use std::fmt;
use thiserror::Error;

/// The largest finite binary16 number.
const F16_MAX: f32 = 65504.0;

/// Where a value stands, and what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Face of a cube, +X −X +Y −Y +Z −Z from 0; `None` in an image.
    pub face: Option<usize>,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// 0, 1, 2 for red, green, blue.
    pub channel: usize,
    /// The value.
    pub value: f32,
}

/// How often something is wrong, and where it is worst.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Defect {
    /// Channel values concerned (a texel has three).
    pub count: usize,
    /// The most extreme one; the first one where they do not compare.
    pub worst: Option<Place>,
}

/// The state of an image's numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelReport {
    /// Not a number.
    pub nan: Defect,
    /// ±∞.
    pub infinite: Defect,
    /// Below zero, −∞ too, where no light can be: the values as stored were negative already.
    pub negative: Defect,
    /// Below zero only because Rec. 709 cannot hold the colour: the values as stored, in a wider space, were radiance.
    /// Harmless; [`TexelPolicy::Repair`] keeps them.
    pub out_of_gamut: Defect,
    /// Finite, but above 65504, the largest binary16 number.
    pub above_f16: Defect,
    /// Largest finite value of any channel; −∞ where there is none.
    pub max: f32,
    /// Smallest finite value of any channel; +∞ where there is none.
    pub min: f32,
    /// Mean Rec. 709 luminance over the texels that are finite, all texels weighing alike; 0 where there is none.
    pub mean_luminance: f64,
}

/// What to do with texels that are no radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelPolicy {
    /// Non-finite values from finite neighbours, negative values to 0 (in the colour space they were stored in, so that
    /// colours outside Rec. 709 stay as they are); the flux moved is reported.
    Repair,
    /// Refuse the image.
    Error,
    /// Leave everything as it is: for a skybox that is only looked at.
    Keep,
}

/// What [`repair_texels`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repair {
    /// Channel values that were NaN or ±∞.
    pub non_finite: usize,
    /// Channel values that were finite and negative in a texel that was stored with a negative value.
    pub negative: usize,
    /// Channel values that were negative as a colour outside Rec. 709 has it, and were kept.
    pub out_of_gamut: usize,
    /// Σ |change| over Σ value afterwards, both weighted by solid angle (a picture's texels weigh alike). A
    /// non-finite value counts as 0 before.
    pub flux_moved: f64,
}

/// Why a [`TexelPolicy`] was not carried through.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TexelError {
    /// [`TexelPolicy::Error`] refuses the image.
    #[error("{place}; {nan} values are NaN, {infinite} infinite, {negative} negative")]
    NoRadiance {
        /// The worst of them: NaN before infinite before negative.
        place: Place,
        /// Values that are NaN.
        nan: usize,
        /// Values that are ±∞.
        infinite: usize,
        /// Values below zero.
        negative: usize,
    },
    /// The image is not wanted any more; some of it may be repaired.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "texel ({}, {})", self.x, self.y)?;
        if let Some(name) = self.face.and_then(|face| FACE_NAMES.get(face)) {
            write!(f, " of face {name}")?;
        }
        write!(f, " holds {} in channel {}", self.value, self.channel)
    }
}

impl TexelReport {
    /// Whether every value is finite and none is negative but as a colour outside Rec. 709.
    pub fn is_radiance(&self) -> bool {
        self.nan.count == 0 && self.infinite.count == 0 && self.negative.count == 0
    }
}

impl TexelPolicy {
    /// Applies the policy; the returned counts are zero where nothing was changed.
    ///
    /// # Errors
    /// [`TexelError::NoRadiance`] from [`TexelPolicy::Error`] where a value is NaN, infinite or negative.
    pub fn apply<T: Texels + ?Sized>(self, texels: &mut T, cancel: Cancel) -> Result<Repair, TexelError> {
        match self {
            TexelPolicy::Repair => Ok(repair_texels(texels, cancel)?),
            TexelPolicy::Keep => Ok(Repair::default()),
            TexelPolicy::Error => {
                let report = check_texels(texels, cancel)?;
                match report.nan.worst.or(report.infinite.worst).or(report.negative.worst) {
                    None => Ok(Repair::default()),
                    Some(place) => Err(TexelError::NoRadiance {
                        place,
                        nan: report.nan.count,
                        infinite: report.infinite.count,
                        negative: report.negative.count,
                    }),
                }
            }
        }
    }
}

impl Defect {
    fn add(&mut self, place: Place, is_worse: impl FnOnce(f32) -> bool) {
        self.count += 1;
        if self.worst.is_none_or(|worst| is_worse(worst.value)) {
            self.worst = Some(place);
        }
    }
}

/// Counts what is no radiance and measures what is.
///
/// # Errors
/// [`Cancelled`] within a few rows' work.
pub fn check_texels<T: Texels + ?Sized>(texels: &T, cancel: Cancel) -> Result<TexelReport, Cancelled> {
    let mut report = TexelReport {
        nan: Defect::default(),
        infinite: Defect::default(),
        negative: Defect::default(),
        out_of_gamut: Defect::default(),
        above_f16: Defect::default(),
        max: f32::NEG_INFINITY,
        min: f32::INFINITY,
        mean_luminance: 0.0,
    };
    let (shape, gamut) = (texels.shape(), texels.gamut());
    let (mut luminance_sum, mut finite_texels) = (0.0, 0_usize);
    for (index, texel) in texels.rgb().as_chunks::<3>().0.iter().enumerate() {
        if index.is_multiple_of(CHECK_TEXELS) {
            cancel.check()?;
        }
        let (face, x, y) = shape.position(index);
        let is_legitimate = is_out_of_gamut(*texel, gamut);
        for (channel, &value) in texel.iter().enumerate() {
            report.add(Place { face, x, y, channel, value }, is_legitimate);
        }
        if texel.iter().all(|value| value.is_finite()) {
            luminance_sum += luminance(*texel);
            finite_texels += 1;
        }
    }
    report.mean_luminance = luminance_sum / finite_texels.max(1) as f64;
    Ok(report)
}

/// Whether a texel is negative only because Rec. 709 cannot hold its colour.
fn is_out_of_gamut(texel: [f32; 3], gamut: Option<&Gamut>) -> bool {
    let Some(gamut) = gamut else { return false };
    let is_negative = texel.iter().any(|&value| value < 0.0) && texel.iter().all(|value| value.is_finite());
    is_negative && !Gamut::is_negative(gamut.stored(texel))
}

impl TexelReport {
    fn add(&mut self, place: Place, is_out_of_gamut: bool) {
        let value = place.value;
        if value.is_nan() {
            self.nan.add(place, |_| false);
            return;
        }
        if value < 0.0 {
            let defect = if is_out_of_gamut { &mut self.out_of_gamut } else { &mut self.negative };
            defect.add(place, |worst| value < worst);
        }
        if value.is_infinite() {
            self.infinite.add(place, |_| false);
            return;
        }
        if value > F16_MAX {
            self.above_f16.add(place, |worst| value > worst);
        }
        self.max = self.max.max(value);
        self.min = self.min.min(value);
    }
}
