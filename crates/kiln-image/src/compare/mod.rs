//! How much two pictures differ: in numbers that people quote, and as the eye sees it.
//!
//! Start at [`compare`]. Pictures are display pictures: sRGB-encoded, 8 bits a channel.

mod flip;

use crate::colour::srgb_to_linear;

pub use flip::{PIXELS_PER_DEGREE, flip};

/// A display picture.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// sRGB, `width · height · 3` bytes.
    pub rgb: &'a [u8],
}

/// What differs between two pictures of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Root of the mean squared difference of encoded values, 0 to 1.
    pub rmse: f64,
    /// Peak signal-to-noise ratio of encoded values in decibels; infinite for equal pictures.
    pub psnr_db: f64,
    /// Largest difference of a channel, in 1/255.
    pub difference_max: u8,
    /// Where that is, from the top left.
    pub place_of_max: [usize; 2],
    /// Pixels of which any channel differs.
    pub differing: usize,
    /// Mean of `flip_map`.
    pub flip_mean: f64,
    /// Largest of `flip_map`.
    pub flip_max: f64,
    /// What the eye makes of each pixel's difference, 0 (none) to 1; see [`flip`].
    pub flip_map: Vec<f32>,
}

/// Two pictures cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("one is {}x{} pixels, the other {}x{}", .0[0], .0[1], .1[0], .1[1])]
pub struct SizesDiffer(pub [usize; 2], pub [usize; 2]);

/// Compares a picture with what it should be.
///
/// # Errors
/// [`SizesDiffer`].
pub fn compare(reference: Picture<'_>, test: Picture<'_>) -> Result<Comparison, SizesDiffer> {
    let sizes = [reference, test].map(|picture| [picture.width, picture.height]);
    if sizes[0] != sizes[1] {
        return Err(SizesDiffer(sizes[0], sizes[1]));
    }
    let differences = || reference.rgb.iter().zip(test.rgb).map(|(a, b)| a.abs_diff(*b));
    let squares: u64 = differences().map(|difference| u64::from(difference).pow(2)).sum();
    let rmse = (squares as f64 / reference.rgb.len().max(1) as f64).sqrt() / 255.0;
    let by_pixel: Vec<u8> =
        reference.rgb.chunks_exact(3).zip(test.rgb.chunks_exact(3)).map(|(a, b)| largest(a, b)).collect();
    let difference_max = by_pixel.iter().copied().max().unwrap_or(0);
    let at = by_pixel.iter().position(|difference| *difference == difference_max).unwrap_or(0);
    let flip_map = flip(reference, test, PIXELS_PER_DEGREE);
    Ok(Comparison {
        rmse,
        psnr_db: -20.0 * rmse.log10(),
        difference_max,
        place_of_max: [at % reference.width.max(1), at / reference.width.max(1)],
        differing: by_pixel.iter().filter(|difference| **difference > 0).count(),
        flip_mean: flip_map.iter().map(|error| f64::from(*error)).sum::<f64>() / flip_map.len().max(1) as f64,
        flip_max: flip_map.iter().copied().fold(0.0, f32::max).into(),
        flip_map,
    })
}

fn largest(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// Colours for values from 0 to 1, from black over violet and orange to pale yellow, ever lighter: sRGB bytes.
pub fn heat_map(values: &[f32]) -> Vec<u8> {
    /// Evenly spaced; lightness grows from each to the next.
    const STOPS: [[f32; 3]; 6] = [
        [0.0, 0.0, 4.0],
        [60.0, 15.0, 112.0],
        [140.0, 41.0, 129.0],
        [222.0, 73.0, 104.0],
        [254.0, 159.0, 109.0],
        [252.0, 253.0, 191.0],
    ];
    let color = |value: &f32| {
        let at = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
        let first = (at as usize).min(STOPS.len() - 2);
        let share = at - first as f32;
        let mix = |channel: usize| STOPS[first][channel] * (1.0 - share) + STOPS[first + 1][channel] * share;
        [mix(0), mix(1), mix(2)].map(|value| value.round() as u8)
    };
    values.iter().flat_map(color).collect()
}

/// Linear values of a picture, pixel by pixel.
fn linear(picture: Picture<'_>) -> Vec<[f64; 3]> {
    let table: Vec<f64> = (0..=255u8).map(|code| srgb_to_linear(f64::from(code) / 255.0)).collect();
    let pixels = picture.rgb.chunks_exact(3);
    pixels.map(|pixel| [0, 1, 2].map(|channel| table[usize::from(pixel[channel])])).collect()
}
