//! What is wrong with an image's numbers, and its repair.

use crate::{Bulk, Cancel, Cancelled, Image, colour::luminance, decode::CHECK_TEXELS};
use std::mem::replace;
use thiserror::Error;

/// The largest finite binary16 number.
const F16_MAX: f32 = 65504.0;

/// Where a value stands, and what it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
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
    /// Below zero, −∞ too.
    pub negative: Defect,
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
    /// Non-finite values from finite neighbours, negative values to 0; the flux moved is reported.
    Repair,
    /// Refuse the image.
    Error,
    /// Leave everything as it is.
    Keep,
}

/// What [`repair_texels`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repair {
    /// Channel values that were NaN or ±∞.
    pub non_finite: usize,
    /// Channel values that were finite and negative.
    pub negative: usize,
    /// Σ |change| over Σ value afterwards, both weighted by solid angle where the image has a
    /// panorama's shape and equally otherwise. A non-finite value counts as 0 before.
    pub flux_moved: f64,
}

/// Why a [`TexelPolicy`] was not carried through.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TexelError {
    /// [`TexelPolicy::Error`] refuses the image.
    #[error("texel ({}, {}) holds {} in channel {}; {nan} values are NaN, {infinite} infinite, {negative} negative",
        place.x, place.y, place.value, place.channel)]
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

impl TexelReport {
    /// Whether every value is finite and not negative.
    pub fn is_radiance(&self) -> bool {
        self.nan.count == 0 && self.infinite.count == 0 && self.negative.count == 0
    }
}

impl TexelPolicy {
    /// Applies the policy; the returned counts are zero where nothing was changed.
    ///
    /// # Errors
    /// [`TexelError::NoRadiance`] from [`TexelPolicy::Error`] where a value is NaN, infinite or negative.
    pub fn apply(self, image: &mut Image, cancel: Cancel) -> Result<Repair, TexelError> {
        match self {
            TexelPolicy::Repair => Ok(repair_texels(image, cancel)?),
            TexelPolicy::Keep => Ok(Repair::default()),
            TexelPolicy::Error => {
                let report = check_texels(image, cancel)?;
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
pub fn check_texels(image: &Image, cancel: Cancel) -> Result<TexelReport, Cancelled> {
    let mut report = TexelReport {
        nan: Defect::default(),
        infinite: Defect::default(),
        negative: Defect::default(),
        above_f16: Defect::default(),
        max: f32::NEG_INFINITY,
        min: f32::INFINITY,
        mean_luminance: 0.0,
    };
    let (mut luminance_sum, mut finite_texels) = (0.0, 0_usize);
    for (index, texel) in image.rgb.chunks_exact(3).enumerate() {
        if index.is_multiple_of(CHECK_TEXELS) {
            cancel.check()?;
        }
        let (x, y) = (index % image.width, index / image.width);
        for (channel, &value) in texel.iter().enumerate() {
            check_value(&mut report, Place { x, y, channel, value });
        }
        if texel.iter().all(|value| value.is_finite()) {
            luminance_sum += luminance([texel[0], texel[1], texel[2]]);
            finite_texels += 1;
        }
    }
    report.mean_luminance = luminance_sum / finite_texels.max(1) as f64;
    Ok(report)
}

fn check_value(report: &mut TexelReport, place: Place) {
    let value = place.value;
    if value.is_nan() {
        report.nan.add(place, |_| false);
        return;
    }
    if value < 0.0 {
        report.negative.add(place, |worst| value < worst);
    }
    if value.is_infinite() {
        report.infinite.add(place, |_| false);
        return;
    }
    if value > F16_MAX {
        report.above_f16.add(place, |worst| value > worst);
    }
    report.max = report.max.max(value);
    report.min = report.min.min(value);
}

/// Makes every value finite and not negative.
///
/// A non-finite value becomes the mean of its finite neighbours (of eight, same channel); holes close
/// from their rim inwards, one ring per pass, and an image without any finite value becomes black.
/// Columns wrap where the image has a panorama's shape. Negative values become 0 first, so that they
/// do not darken what is filled in.
///
/// # Errors
/// [`Cancelled`], with the image half repaired.
pub fn repair_texels(image: &mut Image, cancel: Cancel) -> Result<Repair, Cancelled> {
    let mut repair = Repair::default();
    let mut moved = 0.0;
    let stride = image.width * 3;
    let weights: Vec<f64> = (0..image.height).map(|y| row_weight(image, y)).collect();
    for (index, value) in image.rgb.iter_mut().enumerate() {
        if index.is_multiple_of(CHECK_TEXELS) {
            cancel.check()?;
        }
        if !value.is_finite() {
            repair.non_finite += 1;
        } else if *value < 0.0 {
            moved -= f64::from(*value) * weights[index / stride];
            *value = 0.0;
            repair.negative += 1;
        }
    }
    let holes = find_holes(image, repair.non_finite, cancel)?;
    close_holes(image, &holes, cancel)?;
    let flux = |index: usize| f64::from(image.rgb[index]) * weights[index / stride];
    moved += sum(holes.iter().map(|&index| flux(index)), cancel)?;
    let total = sum((0..image.rgb.len()).map(flux), cancel)?;
    repair.flux_moved = if moved > 0.0 { moved / total.max(f64::MIN_POSITIVE) } else { 0.0 };
    Ok(repair)
}

/// The indices of the `count` values that are not finite.
fn find_holes(image: &Image, count: usize, cancel: Cancel) -> Result<Bulk<Vec<usize>>, Cancelled> {
    // Of the right size at once: growing means copying, which cannot be interrupted.
    let mut holes = Bulk::new(Vec::with_capacity(count));
    if count == 0 {
        return Ok(holes);
    }
    for (block, values) in image.rgb.chunks(CHECK_TEXELS).enumerate() {
        cancel.check()?;
        let is_hole =
            |(index, value): (usize, &f32)| (!value.is_finite()).then_some(block * CHECK_TEXELS + index);
        holes.extend(values.iter().enumerate().filter_map(is_hole));
    }
    Ok(holes)
}

fn sum(values: impl Iterator<Item = f64>, cancel: Cancel) -> Result<f64, Cancelled> {
    let checked = |(index, value): (usize, f64)| {
        if index.is_multiple_of(CHECK_TEXELS) { cancel.check().map(|()| value) } else { Ok(value) }
    };
    values.enumerate().map(checked).sum()
}

fn is_panorama_shaped(image: &Image) -> bool {
    image.width == 2 * image.height
}

/// Proportional to a texel's solid angle in row `y`.
fn row_weight(image: &Image, y: usize) -> f64 {
    if is_panorama_shaped(image) {
        libm::sin((y as f64 + 0.5) / image.height as f64 * std::f64::consts::PI)
    } else {
        1.0
    }
}

/// Holes between two looks at a [`Cancel`]: each has eight neighbours.
const CHECK_HOLES: usize = CHECK_TEXELS / 16;

/// Fills from the rim; a pass reads only what earlier passes left finite, so order does not matter, and
/// looks only where the last one reached, so the work is linear in the number of holes.
fn close_holes(image: &mut Image, holes: &[usize], cancel: Cancel) -> Result<(), Cancelled> {
    if holes.is_empty() {
        return Ok(());
    }
    // Who is reached has a finite neighbour, is filled in the next pass, and is reached no more.
    let mut is_reached = Bulk::new(vec![false; image.rgb.len()]);
    let mut rim = Bulk::new(Vec::with_capacity(holes.len()));
    for indices in holes.chunks(CHECK_TEXELS) {
        cancel.check()?;
        rim.extend_from_slice(indices);
    }
    let mut filled = Bulk::new(Vec::with_capacity(holes.len()));
    while !rim.is_empty() {
        for indices in rim.chunks(CHECK_HOLES) {
            cancel.check()?;
            filled.extend(indices.iter().filter_map(|&index| Some((index, neighbour_mean(image, index)?))));
        }
        for values in filled.chunks(CHECK_TEXELS) {
            cancel.check()?;
            values.iter().for_each(|&(index, value)| image.rgb[index] = value);
        }
        rim.clear();
        for values in filled.chunks(CHECK_HOLES) {
            cancel.check()?;
            let reached = values.iter().flat_map(|&(index, _)| neighbours(image, index));
            let next =
                |index: &usize| !image.rgb[*index].is_finite() && !replace(&mut is_reached[*index], true);
            rim.extend(reached.filter(next));
        }
        filled.clear();
    }
    for indices in holes.chunks(CHECK_TEXELS) {
        cancel.check()?;
        for &index in indices {
            if !image.rgb[index].is_finite() {
                image.rgb[index] = 0.0;
            }
        }
    }
    Ok(())
}

fn neighbour_mean(image: &Image, index: usize) -> Option<f32> {
    let (mut sum, mut count) = (0.0, 0);
    for value in neighbours(image, index).map(|neighbour| image.rgb[neighbour]).filter(|v| v.is_finite()) {
        sum += f64::from(value);
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}

/// The up to nine values around and at `index`, same channel.
fn neighbours(image: &Image, index: usize) -> impl Iterator<Item = usize> + use<> {
    let (width, wraps) = (image.width, is_panorama_shaped(image));
    let (channel, x, y) = (index % 3, index / 3 % width, index / 3 / width);
    let columns = [-1, 0, 1].into_iter().filter_map(move |step| match x.checked_add_signed(step) {
        Some(column) if column < width => Some(column),
        _ if wraps => Some(if step < 0 { width - 1 } else { 0 }),
        _ => None,
    });
    let rows = y.saturating_sub(1)..(y + 2).min(image.height);
    rows.flat_map(move |row| columns.clone().map(move |column| (row * width + column) * 3 + channel))
}
