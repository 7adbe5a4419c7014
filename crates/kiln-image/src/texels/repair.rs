//! Makes texels radiance: holes are filled, what no light makes goes.

use super::{Repair, Shape, Texels, Weights, is_out_of_gamut};
use crate::{Bulk, Cancel, Cancelled, colour::Gamut, decode::CHECK_TEXELS};
use std::{cell::LazyCell, mem::replace};

/// Makes every value finite, and none negative but as a colour outside Rec. 709.
///
/// A non-finite value becomes the mean of its finite neighbours (of eight, same channel); holes close
/// from their rim inwards, one ring per pass, and an image without any finite value becomes black.
/// Columns wrap in a panorama (and in an image of its shape); faces of a cube are neighbours across their edges. Negative
/// values become 0 first, so that they do not darken what is filled in: as stored, where the texels were
/// converted from another colour space.
///
/// # Errors
/// [`Cancelled`], with the texels half repaired.
pub fn repair_texels<T: Texels + ?Sized>(texels: &mut T, cancel: Cancel) -> Result<Repair, Cancelled> {
    let (shape, gamut) = (texels.shape(), texels.gamut().copied());
    let weights = LazyCell::new(|| Weights::new(shape));
    let rgb = texels.rgb_mut();
    let mut repair = Repair::default();
    let mut moved = 0.0;
    for (index, texel) in rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        if index.is_multiple_of(CHECK_TEXELS) {
            cancel.check()?;
        }
        let change = lift_negatives(texel, gamut.as_ref(), &mut repair);
        if change > 0.0 {
            moved += change * weights.of(index);
        }
    }
    let holes = find_holes(rgb, repair.non_finite, cancel)?;
    close_holes(rgb, shape, &holes, cancel)?;
    let flux = |index: usize| f64::from(rgb[index]) * weights.of(index / 3);
    moved += sum(holes.iter().map(|&index| flux(index).abs()), cancel)?;
    if moved > 0.0 {
        let total = sum((0..rgb.len()).map(flux), cancel)?;
        repair.flux_moved = moved / total.max(f64::MIN_POSITIVE);
    }
    Ok(repair)
}

/// Counts what is wrong with a texel and takes away what no light makes; returns Σ |change| over its channels.
fn lift_negatives(texel: &mut [f32; 3], gamut: Option<&Gamut>, repair: &mut Repair) -> f64 {
    let before = *texel;
    let negatives = before.iter().filter(|value| value.is_finite() && **value < 0.0).count();
    let holes = before.iter().filter(|value| !value.is_finite()).count();
    repair.non_finite += holes;
    if negatives == 0 {
        return 0.0;
    }
    if is_out_of_gamut(before, gamut) {
        repair.out_of_gamut += negatives;
        return 0.0;
    }
    repair.negative += negatives;
    *texel = match gamut.filter(|_| holes == 0) {
        Some(gamut) => {
            gamut.converted(gamut.stored(before).map(|value| value.max(0.0))).map(|value| value as f32)
        }
        None => before.map(|value| if value < 0.0 && value.is_finite() { 0.0 } else { value }),
    };
    let change = |(new, old): (&f32, &f32)| (f64::from(*new) - f64::from(*old)).abs();
    texel.iter().zip(&before).filter(|(_, old)| old.is_finite()).map(change).sum()
}

/// The indices of the `count` values that are not finite.
fn find_holes(rgb: &[f32], count: usize, cancel: Cancel) -> Result<Bulk<Vec<usize>>, Cancelled> {
    // Of the right size at once: growing means copying, which cannot be interrupted.
    let mut holes = Bulk::new(Vec::with_capacity(count));
    if count == 0 {
        return Ok(holes);
    }
    for (block, values) in rgb.chunks(CHECK_TEXELS).enumerate() {
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

/// Holes between two looks at a [`Cancel`]: each has eight neighbours.
const CHECK_HOLES: usize = CHECK_TEXELS / 16;

/// Fills from the rim; a pass reads only what earlier passes left finite, so order does not matter, and
/// looks only where the last one reached, so the work is linear in the number of holes.
fn close_holes(rgb: &mut [f32], shape: Shape, holes: &[usize], cancel: Cancel) -> Result<(), Cancelled> {
    if holes.is_empty() {
        return Ok(());
    }
    // Who is reached has a finite neighbour, is filled in the next pass, and is reached no more.
    let mut is_reached = Bulk::new(vec![false; rgb.len()]);
    let mut rim = Bulk::new(Vec::with_capacity(holes.len()));
    for indices in holes.chunks(CHECK_TEXELS) {
        cancel.check()?;
        rim.extend_from_slice(indices);
    }
    let mut filled = Bulk::new(Vec::with_capacity(holes.len()));
    while !rim.is_empty() {
        for indices in rim.chunks(CHECK_HOLES) {
            cancel.check()?;
            filled.extend(
                indices.iter().filter_map(|&index| Some((index, neighbour_mean(rgb, shape, index)?))),
            );
        }
        for values in filled.chunks(CHECK_TEXELS) {
            cancel.check()?;
            values.iter().for_each(|&(index, value)| rgb[index] = value);
        }
        rim.clear();
        for values in filled.chunks(CHECK_HOLES) {
            cancel.check()?;
            let reached = values.iter().flat_map(|&(index, _)| neighbours(shape, index));
            let next = |index: &usize| !rgb[*index].is_finite() && !replace(&mut is_reached[*index], true);
            rim.extend(reached.filter(next));
        }
        filled.clear();
    }
    for indices in holes.chunks(CHECK_TEXELS) {
        cancel.check()?;
        for &index in indices {
            if !rgb[index].is_finite() {
                rgb[index] = 0.0;
            }
        }
    }
    Ok(())
}

fn neighbour_mean(rgb: &[f32], shape: Shape, index: usize) -> Option<f32> {
    let (mut sum, mut count) = (0.0, 0);
    for value in neighbours(shape, index).map(|neighbour| rgb[neighbour]).filter(|v| v.is_finite()) {
        sum += f64::from(value);
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}

/// The up to nine values around and at `index`, same channel.
fn neighbours(shape: Shape, index: usize) -> impl Iterator<Item = usize> {
    shape.neighbours(index / 3).map(move |texel| 3 * texel + index % 3)
}
