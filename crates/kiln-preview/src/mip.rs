//! Smaller levels of 8-bit images, averaged in the space that light adds up in.

use kiln_scene::{ColorSpace, Image8};
use rayon::prelude::*;

/// How texels average.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Average {
    /// sRGB-encoded colour: averaged as linear light.
    Srgb,
    /// Data: averaged as it is.
    Linear,
}

impl From<ColorSpace> for Average {
    fn from(space: ColorSpace) -> Self {
        match space {
            ColorSpace::Srgb => Average::Srgb,
            ColorSpace::Linear => Average::Linear,
        }
    }
}

/// Levels below `image`, largest first, down to 1×1: each texel is the area-weighted mean of those it covers, so
/// that odd sizes neither shift nor drop a row. Alpha averages linearly.
pub(crate) fn smaller_levels(image: &Image8, average: Average) -> Vec<Image8> {
    let tables = Tables::new(average);
    let mut levels: Vec<Image8> = Vec::new();
    loop {
        let last = levels.last().unwrap_or(image);
        if last.width == 1 && last.height == 1 {
            return levels;
        }
        let next = halve(last, &tables);
        levels.push(next);
    }
}

struct Tables {
    /// Byte to linear value in [0, 1].
    decode: [f32; 256],
    /// Linear value, in steps of 1 / (len − 1), to byte; empty for linear data.
    encode: Vec<u8>,
}

/// Fine enough for sRGB's steep dark end: a step is 0.05 of the smallest difference between two codes.
const ENCODE_STEPS: usize = 65536;

impl Tables {
    fn new(average: Average) -> Self {
        let code = |index: usize| index as f32 / 255.0;
        match average {
            Average::Linear => Tables { decode: std::array::from_fn(code), encode: Vec::new() },
            Average::Srgb => Tables {
                decode: std::array::from_fn(|index| srgb_to_linear(code(index))),
                encode: (0..ENCODE_STEPS)
                    .map(|step| to_byte(linear_to_srgb(step as f32 / (ENCODE_STEPS - 1) as f32)))
                    .collect(),
            },
        }
    }

    fn encode(&self, value: f32) -> u8 {
        match self.encode.is_empty() {
            true => to_byte(value),
            false => self.encode[(value * (ENCODE_STEPS - 1) as f32 + 0.5) as usize],
        }
    }
}

fn to_byte(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

/// IEC 61966-2-1.
fn srgb_to_linear(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// IEC 61966-2-1.
fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn halve(image: &Image8, tables: &Tables) -> Image8 {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    let columns: Vec<Taps> = (0..width).map(|x| Taps::new(image.width, width, x)).collect();
    let mut rgba = vec![0; width as usize * height as usize * 4];
    let rows = rgba.par_chunks_exact_mut(width as usize * 4).enumerate();
    rows.for_each(|(y, row)| {
        let vertical = Taps::new(image.height, height, y as u32);
        for (texel, horizontal) in row.chunks_exact_mut(4).zip(&columns) {
            texel.copy_from_slice(&mean(image, horizontal, &vertical, tables));
        }
    });
    Image8 { width, height, rgba }
}

/// Up to three neighbours with weights that sum to 1.
struct Taps {
    first: usize,
    weights: [f32; 3],
    count: usize,
}

impl Taps {
    /// What the `index`-th of `to` texels covers of `from` texels, `to` = max(1, ⌊from / 2⌋).
    fn new(from: u32, to: u32, index: u32) -> Self {
        let scale = f64::from(from) / f64::from(to);
        let (start, end) = (f64::from(index) * scale, f64::from(index + 1) * scale);
        let first = start as usize;
        let covered =
            |tap: usize| (end.min((first + tap + 1) as f64) - start.max((first + tap) as f64)).max(0.0);
        let weights = [0, 1, 2].map(|tap| (covered(tap) / scale) as f32);
        // The last tap may lie outside the image with a weight of 0 or a rounding error.
        let count = (from as usize - first).min(3);
        Taps { first, weights, count }
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        (0..self.count).map(|tap| (self.first + tap, self.weights[tap])).filter(|(_, weight)| *weight > 0.0)
    }
}

fn mean(image: &Image8, horizontal: &Taps, vertical: &Taps, tables: &Tables) -> [u8; 4] {
    let mut sum = [0.0_f32; 4];
    for (y, weight_y) in vertical.iter() {
        for (x, weight_x) in horizontal.iter() {
            let at = (y * image.width as usize + x) * 4;
            let weight = weight_x * weight_y;
            for (channel, sum) in sum.iter_mut().enumerate().take(3) {
                *sum += weight * tables.decode[usize::from(image.rgba[at + channel])];
            }
            sum[3] += weight * f32::from(image.rgba[at + 3]) / 255.0;
        }
    }
    let [red, green, blue, alpha] = sum.map(|value| value.clamp(0.0, 1.0));
    [tables.encode(red), tables.encode(green), tables.encode(blue), to_byte(alpha)]
}
