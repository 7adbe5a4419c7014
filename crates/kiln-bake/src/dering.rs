//! A window that takes the negative lobes out of a cut-off series of harmonics.
//!
//! A function that is nowhere negative can become so where its series is cut off: lit from one side only, a diffuse
//! surface that turns away gets less than nothing. Degree l times 1/(1 + λ l² (l + 1)²) smooths the function (it is the
//! one that differs least from it while its squared Laplacian is held small: Sloan 2008, "Stupid Spherical Harmonics
//! Tricks", "Windowing"), and the least λ that leaves nothing negative is found here (the idea of Sloan 2017,
//! "Deringing Spherical Harmonics").

use crate::sh::ShCoefficients;
use kiln_sphere::{Cancel, Cancelled, panorama_direction, real_harmonics};
use std::f64::consts::PI;

/// A windowed function and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Deringed {
    /// The function: degree 0, the flux, is as it was. Equal to what was given if `strength` is 0.
    pub sh: ShCoefficients,
    /// λ, the same for all channels so that hues stay; 0 where nothing was negative.
    pub strength: f64,
    /// Least value on the sphere per channel, as given.
    pub minimum_before: [f64; 3],
    /// Least value on the sphere per channel, windowed.
    pub minimum_after: [f64; 3],
}

/// What counts as nothing, as a part of a channel's mean.
const NEGLIGIBLE: f64 = 1e-9;
/// Rounds of "find λ for the known directions, look for a worse direction": two or three are enough in practice.
const ROUNDS_MAX: usize = 12;

/// Windows a function just enough that no channel is negative anywhere (by more than 1e-9 of its mean).
///
/// A channel whose mean is not positive is left out of the choice: no window can help it.
///
/// # Errors
/// [`Cancelled`] within the search around one minimum.
pub fn dering(sh: &ShCoefficients, cancel: Cancel) -> Result<Deringed, Cancelled> {
    let mut probes = Probes::new(sh, cancel)?;
    let lowest = probes.minima(0.0, cancel)?;
    let minimum_before = lowest.map(|(value, _)| value);
    let mut deringed =
        Deringed { sh: sh.clone(), strength: 0.0, minimum_before, minimum_after: minimum_before };
    let mut lowest = lowest;
    for _ in 0..ROUNDS_MAX {
        if probes.are_negligible(&deringed.minimum_after) {
            break;
        }
        for (_, direction) in lowest {
            probes.push(direction);
        }
        deringed.strength = probes.least_strength();
        lowest = probes.minima(deringed.strength, cancel)?;
        deringed.minimum_after = lowest.map(|(value, _)| value);
    }
    if deringed.strength > 0.0 {
        deringed.sh = sh.scaled_by_degree(&window(sh.order, deringed.strength));
    }
    Ok(deringed)
}

/// 1/(1 + λ l² (l + 1)²) for l = 0 … `order`.
fn window(order: usize, strength: f64) -> Vec<f64> {
    let factor = |l: usize| 1.0 / (1.0 + strength * ((l * (l + 1)) as f64).powi(2));
    (0..=order).map(factor).collect()
}

/// Parts of the function in one direction, by degree and channel: any window of it is a sum of so many terms.
type Bands = Vec<[f64; 3]>;

struct Probes<'a> {
    sh: &'a ShCoefficients,
    /// A positive mean, or `None` for a channel that no window can help.
    mean: [Option<f64>; 3],
    /// Rows of a latitude–longitude grid, four rows to the highest degree's half wave.
    rows: usize,
    columns: usize,
    /// The grid's directions, row by row, then those found by searching.
    directions: Vec<[f64; 3]>,
    bands: Vec<Bands>,
}

impl<'a> Probes<'a> {
    fn new(sh: &'a ShCoefficients, cancel: Cancel) -> Result<Self, Cancelled> {
        let rows = 4 * (sh.order + 1);
        let columns = 2 * rows;
        let mean = sh.coefficients[0].map(|c| (c > 0.0).then(|| c / (4.0 * PI).sqrt()));
        let mut probes = Self { sh, mean, rows, columns, directions: Vec::new(), bands: Vec::new() };
        for row in 0..rows {
            cancel.check()?;
            for column in 0..columns {
                let [u, v] =
                    [(column, columns), (row, rows)].map(|(i, count)| (i as f64 + 0.5) / count as f64);
                probes.push(panorama_direction(u, v));
            }
        }
        Ok(probes)
    }

    fn push(&mut self, direction: [f64; 3]) {
        self.directions.push(direction);
        self.bands.push(bands(self.sh, direction));
    }

    fn are_negligible(&self, minimum: &[f64; 3]) -> bool {
        let is_negligible =
            |(minimum, mean): (&f64, &Option<f64>)| mean.is_none_or(|mean| *minimum >= -NEGLIGIBLE * mean);
        minimum.iter().zip(&self.mean).all(is_negligible)
    }

    /// Whether the windowed function is nowhere negative at the probes.
    fn is_enough(&self, strength: f64) -> bool {
        let window = window(self.sh.order, strength);
        self.bands.iter().all(|bands| {
            let value = windowed(bands, &window);
            value.iter().zip(&self.mean).all(|(value, mean)| mean.is_none() || *value >= 0.0)
        })
    }

    /// The least λ that is enough at the probes, to all digits.
    fn least_strength(&self) -> f64 {
        let mut enough = 1e-6;
        // A mean above 0 wins over any coefficients in the end.
        while !self.is_enough(enough) && enough < f64::MAX / 8.0 {
            enough *= 8.0;
        }
        let mut too_little = 0.0;
        for _ in 0..80 {
            let middle = 0.5 * (too_little + enough);
            if self.is_enough(middle) {
                enough = middle;
            } else {
                too_little = middle;
            }
        }
        enough
    }

    /// Least value on the sphere and its direction, per channel.
    fn minima(&self, strength: f64, cancel: Cancel) -> Result<[(f64, [f64; 3]); 3], Cancelled> {
        let window = window(self.sh.order, strength);
        let values: Vec<[f64; 3]> = self.bands.iter().map(|bands| windowed(bands, &window)).collect();
        let mut minima = [(f64::INFINITY, [0.0; 3]); 3];
        for (channel, lowest) in minima.iter_mut().enumerate() {
            let is_start = |index: &usize| {
                *index >= self.rows * self.columns || self.is_lowest_around(&values, *index, channel)
            };
            let mut starts: Vec<usize> = (0..values.len()).filter(is_start).collect();
            starts.sort_by(|&a, &b| values[a][channel].total_cmp(&values[b][channel]));
            for index in starts.into_iter().take(STARTS_MAX) {
                cancel.check()?;
                let found = self.descend(self.directions[index], channel, &window);
                if found.0 < lowest.0 {
                    *lowest = found;
                }
            }
        }
        Ok(minima)
    }

    /// Whether a grid point is no higher than its four neighbours; around a pole those of its row have to do.
    fn is_lowest_around(&self, values: &[[f64; 3]], index: usize, channel: usize) -> bool {
        let (row, column) = (index / self.columns, index % self.columns);
        let at = |row: usize, column: usize| values[row * self.columns + column % self.columns][channel];
        let value = at(row, column);
        value <= at(row, column + 1)
            && value <= at(row, column + self.columns - 1)
            && value <= at(row.saturating_sub(1), column)
            && value <= at((row + 1).min(self.rows - 1), column)
    }

    /// Walks downhill by ever shorter steps along two tangents.
    fn descend(&self, start: [f64; 3], channel: usize, window: &[f64]) -> (f64, [f64; 3]) {
        let value_at = |direction| windowed(&bands(self.sh, direction), window)[channel];
        let (mut direction, mut lowest) = (start, value_at(start));
        let (mut step, mut moves) = (0.5 * PI / self.rows as f64, 0);
        while step > STEP_MIN {
            let [u, v] = tangents(direction);
            let offsets = [(step, u), (-step, u), (step, v), (-step, v)];
            let moved = offsets.map(|(step, tangent)| moved(direction, tangent, step));
            let before = lowest;
            for candidate in moved {
                let value = value_at(candidate);
                if value < lowest {
                    (direction, lowest) = (candidate, value);
                }
            }
            moves += 1;
            if lowest >= before || moves == MOVES_MAX {
                (step, moves) = (0.5 * step, 0);
            }
        }
        (lowest, direction)
    }
}

/// Radians; the value is off by its square.
const STEP_MIN: f64 = 1e-7;
/// Steps of one length, so that a level valley is not walked along for ever.
const MOVES_MAX: usize = 8;
/// Lowest grid points a search starts from. The grid is so fine (a tenth of the function's range between neighbours)
/// that the sphere's minimum is below one of the very lowest; a level ring of minima needs one start only.
const STARTS_MAX: usize = 12;

fn bands(sh: &ShCoefficients, direction: [f64; 3]) -> Bands {
    let mut bands = vec![[0.0; 3]; sh.order + 1];
    for (index, (c, basis)) in sh.coefficients.iter().zip(real_harmonics(direction, sh.order)).enumerate() {
        for (sum, c) in bands[index.isqrt()].iter_mut().zip(c) {
            *sum += c * basis;
        }
    }
    bands
}

fn windowed(bands: &[[f64; 3]], window: &[f64]) -> [f64; 3] {
    let mut value = [0.0; 3];
    for (band, factor) in bands.iter().zip(window) {
        for (sum, part) in value.iter_mut().zip(band) {
            *sum += factor * part;
        }
    }
    value
}

/// Two unit vectors that make a right-handed frame with a unit direction.
fn tangents([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    // Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    let sign = if z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}

/// A unit direction, a little way along a tangent.
fn moved(direction: [f64; 3], tangent: [f64; 3], step: f64) -> [f64; 3] {
    let sum: [f64; 3] = std::array::from_fn(|axis| direction[axis] + step * tangent[axis]);
    let inverse_length = 1.0 / (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    sum.map(|value| value * inverse_length)
}
