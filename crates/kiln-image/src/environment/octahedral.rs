//! Octahedral maps: the sphere folded onto a square.
//!
//! Source: Engelhardt and Dachsbacher 2008, "Octahedron Environment Maps"; Cigolle et al. 2014, "A Survey of Efficient
//! Representations for Independent Unit Vectors" (there with +Z up; here +Y).

use crate::{Bulk, Cancel, Cancelled, DecodeError, Image, Limits, Panorama, decode::check_size};
use rayon::prelude::*;
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
    ((1.0 - b.abs()).copysign(a), (1.0 - a.abs()).copysign(b))
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
    let columns: Vec<Longitude> = (0..width).flat_map(|column| longitudes(column, width, SAMPLES)).collect();
    let mut rgb = Bulk::new(vec![0.0_f32; width * height * 3]);
    let mut ranges: Bulk<Vec<Range>> = Bulk::new(vec![EMPTY; width * height]);
    let lines = rgb.par_chunks_mut(3 * width).zip(ranges.par_chunks_mut(width)).enumerate();
    lines.try_for_each(|(row, (line, ranges))| {
        let rings = rings(row, height, SAMPLES);
        let texels = line.as_chunks_mut::<3>().0.iter_mut().zip(ranges);
        for ((texel, range), longitudes) in texels.zip(columns.chunks_exact(SAMPLES)) {
            // 16 samples a texel: a row of 16384 would be milliseconds.
            cancel.check()?;
            let sampled = sample(map, &rings, longitudes);
            *texel = sampled.mean.map(|value| value as f32);
            *range = sampled.range;
        }
        Ok::<(), Cancelled>(())
    })?;
    // A row can be at a lamp only where it and its neighbours differ so much in all.
    let row_ranges: Vec<Range> = ranges.chunks(width).map(|row| row.iter().fold(EMPTY, join)).collect();
    rgb.par_chunks_mut(3 * width).enumerate().try_for_each(|(row, line)| {
        if contrast(row_ranges[rows_around(row, height)].iter().fold(EMPTY, join)) <= contrast_max {
            return Ok::<(), Cancelled>(());
        }
        let rings = rings(row, height, SAMPLES_AT_LAMPS);
        for (column, texel) in line.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            cancel.check()?;
            if contrast_around(&ranges, width, row, column) > contrast_max {
                let longitudes: Vec<Longitude> = longitudes(column, width, SAMPLES_AT_LAMPS).collect();
                *texel = sample(map, &rings, &longitudes).mean.map(|value| value as f32);
            }
        }
        Ok(())
    })?;
    Ok(Panorama::new(Image::new(width, height, rgb.into_inner())?)?)
}

/// The contrast in a texel and its eight neighbours: a lamp's corner may reach in between the samples.
fn contrast_around(ranges: &[Range], width: usize, row: usize, column: usize) -> f64 {
    let columns = [if column == 0 { width - 1 } else { column - 1 }, column, (column + 1) % width];
    let rows = rows_around(row, ranges.len() / width);
    let around = rows.flat_map(|row| columns.map(|column| &ranges[row * width + column]));
    contrast(around.fold(EMPTY, join))
}

/// A row and its neighbours.
fn rows_around(row: usize, height: usize) -> std::ops::Range<usize> {
    row.saturating_sub(1)..(row + 2).min(height)
}

fn join([lowest, highest]: Range, range: &Range) -> Range {
    [lowest.min(range[0]), highest.max(range[1])]
}

fn contrast([lowest, highest]: Range) -> f64 {
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

/// Sine and cosine of a longitude, and the sum of their magnitudes.
type Longitude = [f64; 3];

/// Even steps in longitude over a column.
fn longitudes(column: usize, width: usize, samples: usize) -> impl Iterator<Item = Longitude> {
    (0..samples).map(move |sample| {
        let u = ((column * samples + sample) as f64 + 0.5) / (width * samples) as f64;
        let (sin, cos) = libm::sincos(2.0 * PI * (u - 0.5));
        [sin, cos, sin.abs() + cos.abs()]
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

/// The map's texels at samples; as [`octahedral_uv`], in texels from the map's centre.
fn sample(map: &Image, rings: &[[f64; 2]], longitudes: &[Longitude]) -> Sampled {
    let (half, last) = (0.5 * map.width as f64, map.width as i64 - 1);
    let index = |position: f64| ((position + half) as i64).clamp(0, last) as usize;
    let (mut sum, mut range) = ([0.0; 3], EMPTY);
    for &[y, radius] in rings {
        for &[sin, cos, reach] in longitudes {
            let scale = half * radius / (y.abs() + radius * reach);
            let (a, b) = (scale * sin, -scale * cos);
            let (a, b) =
                if y >= 0.0 { (a, b) } else { ((half - b.abs()).copysign(a), (half - a.abs()).copysign(b)) };
            let start = 3 * (index(b) * map.width + index(a));
            let texel = &map.rgb[start..start + 3];
            for (sum, &value) in sum.iter_mut().zip(texel) {
                *sum += f64::from(value);
            }
            let light = texel[0] + texel[1] + texel[2];
            range = join(range, &[light, light]);
        }
    }
    let count = (rings.len() * longitudes.len()) as f64;
    Sampled { mean: sum.map(|sum| sum / count), range }
}
