//! Octahedral maps: the sphere folded onto a square.
//!
//! Source: Engelhardt and Dachsbacher 2008, "Octahedron Environment Maps"; Cigolle et al. 2014, "A Survey of Efficient
//! Representations for Independent Unit Vectors" (there with +Z up; here +Y).

use crate::{Bulk, Cancel, Cancelled, DecodeError, Image, Limits, Panorama, decode::check_size};
use std::f64::consts::PI;

/// Unit direction at (`u`, `v`) in [0, 1]² of an octahedral map, from its top left; +Y in the centre, +X at the right, −Z at
/// the top.
pub fn octahedral_direction(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let y = 1.0 - a.abs() - b.abs();
    let (x, z) = if y >= 0.0 { (a, b) } else { fold(a, b) };
    let inverse_length = 1.0 / (x * x + y * y + z * z).sqrt();
    [x * inverse_length, y * inverse_length, z * inverse_length]
}

/// Position of a direction of any length but zero; undoes [`octahedral_direction`].
pub fn octahedral_uv(direction: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = direction;
    let inverse_norm = 1.0 / (x.abs() + y.abs() + z.abs());
    let (a, b) = (x * inverse_norm, z * inverse_norm);
    let (a, b) = if y >= 0.0 { (a, b) } else { fold(a, b) };
    [0.5 * a + 0.5, 0.5 * b + 0.5]
}

/// Mirrors a triangle at the diamond's edge; its own inverse.
fn fold(a: f64, b: f64) -> (f64, f64) {
    (libm::copysign(1.0 - b.abs(), a), libm::copysign(1.0 - a.abs(), b))
}

/// Samples along each side of a panorama texel, and where light and dark meet in it: the share of a lamp's texels that falls
/// into it is then off by half a percent, with [`SAMPLES`] by 8 %.
const SAMPLES: usize = 4;
const SAMPLES_AT_LAMPS: usize = 64;

/// A texel is at a lamp where samples in it and around it differ by more than this times the sum of all the map's texels.
/// There are at most 10⁴ such lamps, so their cost is bounded, whatever the map; what is not taken for one is off by less than
/// 8·10⁻⁶ of all the light.
const LAMP_SHARE: f64 = 1e-4;

/// A panorama as high as the map: the equator crosses about 2 · size of its texels.
///
/// The samples of a texel share its solid angle equally (even steps in longitude and in y), so the mean is the
/// integral's; each takes the map's texel it falls into, as that is a constant patch.
pub(super) fn resample(map: &Image, limits: &Limits, cancel: Cancel) -> Result<Panorama, DecodeError> {
    let size = map.width;
    let (width, height) = (2 * size, size);
    check_size("octahedral map as panorama", width, height, limits)?;
    let contrast_max = LAMP_SHARE * sum(map, cancel)?;
    let columns: Vec<[f64; 2]> = (0..width).flat_map(|column| longitudes(column, width, SAMPLES)).collect();
    let mut rgb = Bulk::new(Vec::with_capacity(width * height * 3));
    let mut ranges: Bulk<Vec<Range>> = Bulk::new(Vec::with_capacity(width * height));
    for row in 0..height {
        let rings = rings(row, height, SAMPLES);
        for longitudes in columns.chunks_exact(SAMPLES) {
            // 16 samples a texel: a row of 16384 would be milliseconds.
            cancel.check()?;
            let texel = sample(map, &rings, longitudes);
            rgb.extend(texel.mean.map(|value| value as f32));
            ranges.push(texel.range);
        }
    }
    for row in 0..height {
        let rings = rings(row, height, SAMPLES_AT_LAMPS);
        for column in 0..width {
            cancel.check()?;
            if contrast_around(&ranges, width, row, column) > contrast_max {
                let longitudes: Vec<[f64; 2]> = longitudes(column, width, SAMPLES_AT_LAMPS).collect();
                let start = (row * width + column) * 3;
                let values = rgb[start..start + 3].iter_mut().zip(sample(map, &rings, &longitudes).mean);
                values.for_each(|(value, mean)| *value = mean as f32);
            }
        }
    }
    Ok(Panorama::new(Image::new(width, height, rgb.into_inner())?)?)
}

/// The contrast in a texel and its eight neighbours: a lamp's corner may reach in between the samples.
fn contrast_around(ranges: &[Range], width: usize, row: usize, column: usize) -> f64 {
    let rows = row.saturating_sub(1)..(row + 2).min(ranges.len() / width);
    let columns = [column + width - 1, column, column + 1].map(|column| column % width);
    let around = rows.flat_map(|row| columns.map(|column| &ranges[row * width + column]));
    let [lowest, highest] =
        around.fold(EMPTY, |[lowest, highest], range| [lowest.min(range[0]), highest.max(range[1])]);
    f64::from(highest) - f64::from(lowest)
}

/// All channels of all finite texels, the magnitude of each.
fn sum(map: &Image, cancel: Cancel) -> Result<f64, Cancelled> {
    let mut sum = 0.0;
    for y in 0..map.height {
        cancel.check()?;
        let values = map.row(y).iter().map(|&value| f64::from(value.abs()));
        sum += values.filter(|value| value.is_finite()).sum::<f64>();
    }
    Ok(sum)
}

/// Sine and cosine of even steps in longitude over a column.
fn longitudes(column: usize, width: usize, samples: usize) -> impl Iterator<Item = [f64; 2]> {
    (0..samples).map(move |sample| {
        let u = ((column * samples + sample) as f64 + 0.5) / (width * samples) as f64;
        libm::sincos(2.0 * PI * (u - 0.5)).into()
    })
}

/// Height and radius of even steps in y over a row.
fn rings(row: usize, height: usize, samples: usize) -> Vec<[f64; 2]> {
    let edge = |row: usize| libm::cos(PI * row as f64 / height as f64);
    let (top, bottom) = (edge(row), edge(row + 1));
    let ring = |sample: usize| {
        let y = top + (bottom - top) * (sample as f64 + 0.5) / samples as f64;
        [y, (1.0 - y * y).max(0.0).sqrt()]
    };
    (0..samples).map(ring).collect()
}

/// Smallest and largest sum of channels.
type Range = [f32; 2];

const EMPTY: Range = [f32::INFINITY, f32::NEG_INFINITY];

struct Sampled {
    mean: [f64; 3],
    range: Range,
}

fn sample(map: &Image, rings: &[[f64; 2]], longitudes: &[[f64; 2]]) -> Sampled {
    let size = map.width;
    let index = |position: f64| ((position * size as f64) as usize).min(size - 1);
    let (mut sum, mut range) = ([0.0; 3], EMPTY);
    for &[y, radius] in rings {
        for &[sin, cos] in longitudes {
            let [u, v] = octahedral_uv([radius * sin, y, -radius * cos]);
            let texel = map.texel(index(u), index(v)).map(f64::from);
            sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value);
            let light = (texel[0] + texel[1] + texel[2]) as f32;
            range = [range[0].min(light), range[1].max(light)];
        }
    }
    let count = (rings.len() * longitudes.len()) as f64;
    Sampled { mean: sum.map(|sum| sum / count), range }
}
