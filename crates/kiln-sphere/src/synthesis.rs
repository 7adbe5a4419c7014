//! Harmonics → values in any direction, many at once.
//!
//! 1. On N ≥ L + 1 rings θ_n = π (n + ½)/N: F_m(θ_n) = Σ_l κ_l a_lm P̄_lm(cos θ_n), exact.
//! 2. Continued around the whole circle with parity (−1)^m (double Fourier sphere) each F_m is a trigonometric
//!    polynomial of degree L, so an FFT gives its coefficients: the function is now a Fourier series on a torus.
//! 3. Evaluated on a grid 1.5 times finer, divided by the window's transform, and interpolated with that window
//!    (a non-uniform FFT of type 2), see `spread`. On a cube's side faces λ is one per column.

use crate::analysis::ring_blocks;
use crate::cancel::{Bulk, Cancel, Cancelled};
use crate::direction::cube_texel_centre;
use crate::fft::{Batch, C64, Plan, SIGNALS, bin, cis, even_fft_length};
use crate::harmonics::Harmonics;
use crate::legendre::{BATCH, LANES, Order, Padded, RingBlock, add_products, pad};
use crate::simd;
use crate::spread::{OVERSAMPLING, Window};
use rayon::prelude::*;
use std::f64::consts::PI;

/// How exactly a synthesis interpolates its grid, relative to the function's largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// 2e-5, from 6 × 6 grid points.
    Coarse,
    /// 1e-7, from 10 × 10.
    Fine,
}

/// The function with coefficients κ_l a_lm at the texel centres of a cube map: `6 · face_size² · 3` values,
/// faces in KTX2 order, rows from the top left.
///
/// `kappa` holds κ_0 … κ_L; degrees beyond it, or beyond the harmonics' band limit, are left out. What is not exact is
/// the interpolation (see [`evaluate`] for the exact sum).
///
/// # Errors
/// [`Cancelled`] within the work of a block of rings, a grid row or a row of texels.
pub fn synthesise_cube(
    harmonics: &Harmonics,
    kappa: &[f64],
    face_size: usize,
    interpolation: Interpolation,
    cancel: Cancel,
) -> Result<Bulk<Vec<f64>>, Cancelled> {
    match interpolation {
        Interpolation::Coarse => Grid::<6>::new(harmonics, kappa, cancel)?.to_cube(face_size, cancel),
        Interpolation::Fine => Grid::<10>::new(harmonics, kappa, cancel)?.to_cube(face_size, cancel),
    }
}

/// The widest window.
const WIDTH_MAX: usize = 10;

/// Memory that [`synthesise_cube`] takes at most, its result included, its input and some kilobytes a thread not.
pub fn synthesise_cube_bytes(band_limit: usize, face_size: usize) -> usize {
    let period = grid_period(band_limit);
    let line_count = period / 2 + WIDTH_MAX;
    let orders = (band_limit + 1) * line_count * size_of::<[C64; 3]>();
    let grid = line_count * (period + WIDTH_MAX) * size_of::<Value>();
    let angles = 3 * face_size * face_size * size_of::<f64>();
    orders + grid + 6 * face_size * face_size * size_of::<[f64; 3]>() + angles
}

/// Grid points per full circle for degrees up to `band_limit`.
fn grid_period(band_limit: usize) -> usize {
    let least = libm::ceil((2 * band_limit + 2) as f64 * OVERSAMPLING) as usize;
    even_fft_length(least.max(2 * WIDTH_MAX))
}

/// The function with coefficients κ_l a_lm in one direction, summed term by term: slow and exact up to rounding.
pub fn evaluate(harmonics: &Harmonics, kappa: &[f64], direction: [f64; 3]) -> [f64; 3] {
    let band_limit = usable_band_limit(harmonics, kappa);
    let (theta, lambda) = angles(direction);
    let block = RingBlock::new(&[theta]);
    let mut value = [0.0; 3];
    for m in 0..=band_limit {
        let mut sum = [0.0; 6];
        let coefficients = harmonics.order(m);
        Order::new(m, band_limit).for_each_degree(&block, |offset, legendre| {
            for (s, a) in sum.iter_mut().zip(&coefficients[offset]) {
                *s += kappa[m + offset] * legendre[0] * a;
            }
        });
        let phase = cis(m as f64 * lambda) * if m == 0 { 1.0 } else { 2.0 };
        for channel in 0..3 {
            value[channel] += phase.re * sum[2 * channel] - phase.im * sum[2 * channel + 1];
        }
    }
    value
}

fn usable_band_limit(harmonics: &Harmonics, kappa: &[f64]) -> usize {
    assert!(!kappa.is_empty(), "a kernel spectrum has at least κ_0");
    harmonics.band_limit().min(kappa.len() - 1)
}

/// (θ, λ) of a direction: angle from +Y in [0, π], longitude in [0, 2π].
fn angles([x, y, z]: [f64; 3]) -> (f64, f64) {
    (libm::atan2(libm::hypot(x, z), y), PI + libm::atan2(x, -z))
}

/// Three channels and room, a whole number of vectors.
type Value = [f64; 4];

/// The function on an oversampled grid over (θ, λ), with margins wide enough for the window.
struct Grid<const WIDTH: usize> {
    window: Window<WIDTH>,
    /// Grid points per full circle, along λ and (twice the rows from pole to pole) along θ.
    period: usize,
    /// Values per row: a period and the margins.
    stride: usize,
    values: Bulk<Vec<Value>>,
}

/// A place between grid points along one dimension: the first of them, counted from the margin, and their weights.
type Place<const WIDTH: usize> = (usize, [f64; WIDTH]);

impl<const WIDTH: usize> Grid<WIDTH> {
    /// Rows and columns before the grid's origin: a window may start that far below its cell.
    const MARGIN: usize = WIDTH / 2 - 1;

    fn new(harmonics: &Harmonics, kappa: &[f64], cancel: Cancel) -> Result<Self, Cancelled> {
        let band_limit = usable_band_limit(harmonics, kappa);
        let period = grid_period(band_limit);
        let window = Window::new();
        let deconvolution = window.deconvolution(band_limit, period, cancel)?;
        let columns = Columns::new(harmonics, kappa, period, &deconvolution);
        let lines = Lines { margin: Self::MARGIN, count: period / 2 + WIDTH };
        let mut orders = Bulk::new(vec![Vec::new(); band_limit + 1]);
        orders.par_chunks_mut(SIGNALS).enumerate().try_for_each_init(
            Room::default,
            |room, (chunk, orders)| {
                columns.refine(chunk * SIGNALS, lines, &deconvolution, room, orders, cancel)
            },
        )?;
        let stride = period + WIDTH;
        let values = rows(&orders, period, stride, lines, cancel)?;
        Ok(Self { window, period, stride, values })
    }

    fn to_cube(&self, face_size: usize, cancel: Cancel) -> Result<Bulk<Vec<f64>>, Cancelled> {
        let angles = CubeAngles::new(face_size, cancel)?;
        let side_columns: Vec<Place<WIDTH>> =
            angles.side_longitudes.iter().map(|&lambda| self.place(lambda)).collect();
        let mut rgb = Bulk::new(vec![0.0; 6 * face_size * face_size * 3]);
        rgb.par_chunks_mut(face_size.max(1) * 3).enumerate().try_for_each(|(line, out)| {
            cancel.check()?;
            let (face, y) = (line / face_size, line % face_size);
            simd::dispatch(
                #[inline(always)]
                || {
                    for (x, texel) in out.chunks_exact_mut(3).enumerate() {
                        let (theta, lambda) = angles.at(face, x, y);
                        let column = match lambda {
                            Longitude::OfColumn(index) => side_columns[index],
                            Longitude::Own(lambda) => self.place(lambda),
                        };
                        texel.copy_from_slice(&self.interpolate(self.place(theta), column)[..3]);
                    }
                },
            );
            Ok(())
        })?;
        Ok(rgb)
    }

    /// Where an angle from 0 to 2π lies on the grid.
    #[inline(always)]
    fn place(&self, angle: f64) -> Place<WIDTH> {
        let (first, weights) = self.window.weights(angle * (self.period as f64 / (2.0 * PI)));
        ((first + Self::MARGIN as isize) as usize, weights)
    }

    #[inline(always)]
    fn interpolate(&self, (row, row_weights): Place<WIDTH>, (column, column_weights): Place<WIDTH>) -> Value {
        let values: &[Value] = &self.values;
        let mut sum = [0.0; 4];
        for (line, row_weight) in row_weights.iter().enumerate() {
            let start = (row + line) * self.stride + column;
            let mut partial = [0.0; 4];
            for (value, weight) in values[start..start + WIDTH].iter().zip(&column_weights) {
                for (p, v) in partial.iter_mut().zip(value) {
                    *p += weight * v;
                }
            }
            for (s, p) in sum.iter_mut().zip(partial) {
                *s += row_weight * p;
            }
        }
        sum
    }
}

/// (θ, λ) of a cube's texel centres.
struct CubeAngles {
    face_size: usize,
    /// θ on a side face, row by row; the same on all four.
    side_colatitudes: Vec<f64>,
    /// λ of the columns of +X, −X, +Z, −Z.
    side_longitudes: Vec<f64>,
    /// (θ, λ) on the top; the bottom is its mirror image.
    cap: Vec<[f64; 2]>,
}

enum Longitude {
    OfColumn(usize),
    Own(f64),
}

impl CubeAngles {
    fn new(face_size: usize, cancel: Cancel) -> Result<Self, Cancelled> {
        let centres: Vec<f64> = (0..face_size).map(|i| cube_texel_centre(face_size, i)).collect();
        let mut side_colatitudes = Vec::with_capacity(face_size * face_size);
        let mut cap = Vec::with_capacity(face_size * face_size);
        for &t in &centres {
            cancel.check()?;
            side_colatitudes.extend(centres.iter().map(|&s| libm::atan2((1.0 + s * s).sqrt(), -t)));
            cap.extend(centres.iter().map(|&s| <[f64; 2]>::from(angles([s, 1.0, t]))));
        }
        let side_longitudes = [0, 1, 4, 5]
            .into_iter()
            .flat_map(|face| centres.iter().map(move |&s| angles(crate::cube_direction(face, s, 0.0)).1));
        Ok(Self { face_size, side_colatitudes, side_longitudes: side_longitudes.collect(), cap })
    }

    #[inline(always)]
    fn at(&self, face: usize, x: usize, y: usize) -> (f64, Longitude) {
        let line = y * self.face_size;
        match face {
            2 => {
                let [theta, lambda] = self.cap[line + x];
                (theta, Longitude::Own(lambda))
            }
            3 => {
                let [theta, lambda] = self.cap[(self.face_size - 1 - y) * self.face_size + x];
                (PI - theta, Longitude::Own(lambda))
            }
            _ => {
                let side = if face < 2 { face } else { face - 2 };
                (self.side_colatitudes[line + x], Longitude::OfColumn(side * self.face_size + x))
            }
        }
    }
}

/// What the columns (one per order m) of one synthesis share.
struct Columns<'a> {
    harmonics: &'a Harmonics,
    kappa: &'a [f64],
    band_limit: usize,
    ring_count: usize,
    period: usize,
    rings: Plan,
    fine: Plan,
    /// e^{−ikπ/2N} / (2N · window transform at k), k = 0 … L: from the FFT of the rings to grid coefficients.
    factor: Vec<C64>,
    blocks: Vec<RingBlock>,
}

/// Buffers of one thread.
#[derive(Default)]
struct Room {
    coarse: Vec<Batch>,
    fine: Vec<Batch>,
    fft: Vec<Batch>,
}

/// The grid's rows: `margin` before the pole, `count` in all.
#[derive(Clone, Copy)]
struct Lines {
    margin: usize,
    count: usize,
}

impl<'a> Columns<'a> {
    fn new(harmonics: &'a Harmonics, kappa: &'a [f64], period: usize, deconvolution: &[f64]) -> Self {
        let band_limit = deconvolution.len() - 1;
        let ring_count = even_fft_length(band_limit + 1);
        let circle = (2 * ring_count) as f64;
        let factor = |k: usize| cis(-PI * k as f64 / circle) * (deconvolution[k] / circle);
        Self {
            harmonics,
            kappa,
            band_limit,
            ring_count,
            period,
            rings: Plan::new(2 * ring_count),
            fine: Plan::new(period),
            factor: (0..=band_limit).map(factor).collect(),
            blocks: ring_blocks(ring_count),
        }
    }

    /// F_m of up to four orders from m = `first` on the grid's rows, times what the rows' synthesis needs.
    fn refine(
        &self,
        first: usize,
        lines: Lines,
        deconvolution: &[f64],
        room: &mut Room,
        orders: &mut [Vec<[C64; 3]>],
        cancel: Cancel,
    ) -> Result<(), Cancelled> {
        let on_rings: Vec<Vec<Padded>> =
            (first..first + orders.len()).map(|m| self.on_rings(m, cancel)).collect::<Result<_, _>>()?;
        orders.iter_mut().for_each(|order| order.resize(lines.count, [C64::default(); 3]));
        let circle = 2 * self.ring_count;
        let limit = self.band_limit as isize;
        for channel in 0..3 {
            cancel.check()?;
            room.coarse.resize(circle, Batch::default());
            for (signal, rings) in on_rings.iter().enumerate() {
                let sign = if (first + signal).is_multiple_of(2) { 1.0 } else { -1.0 };
                for (n, ring) in rings.iter().enumerate() {
                    let value = C64::new(ring[2 * channel], ring[2 * channel + 1]);
                    room.coarse[n].set(signal, value);
                    room.coarse[circle - 1 - n].set(signal, value * sign);
                }
            }
            self.rings.forward(&mut room.coarse, &mut room.fft);
            room.fine.clear();
            room.fine.resize(self.period, Batch::default());
            for k in -limit..=limit {
                let factor = self.factor[k.unsigned_abs()];
                room.fine[bin(k, self.period)] =
                    room.coarse[bin(k, circle)] * if k < 0 { factor.conj() } else { factor };
            }
            self.fine.inverse(&mut room.fine, &mut room.fft);
            for (signal, order) in orders.iter_mut().enumerate() {
                for (line, out) in order.iter_mut().enumerate() {
                    let place = bin(line as isize - lines.margin as isize, self.period);
                    out[channel] = room.fine[place].get(signal) * deconvolution[first + signal];
                }
            }
        }
        Ok(())
    }

    /// Σ_l κ_l a_lm P̄_lm(cos θ_n) on all rings, north to south.
    fn on_rings(&self, m: usize, cancel: Cancel) -> Result<Vec<Padded>, Cancelled> {
        let order = Order::new(m, self.band_limit);
        let degrees = self.harmonics.order(m).iter().zip(&self.kappa[m..=self.band_limit]);
        let mut scaled: Vec<Padded> = degrees.map(|(a, k)| pad(a.map(|part| part * k))).collect();
        scaled.resize(scaled.len().next_multiple_of(BATCH), [0.0; 8]);
        let half = self.ring_count / 2;
        let mut rings = vec![[0.0; 8]; self.ring_count];
        for (index, block) in self.blocks.iter().enumerate() {
            if block.is_negligible(m, self.band_limit) {
                continue;
            }
            cancel.check()?;
            let mut parities = [[[0.0; 8]; LANES]; 2];
            simd::dispatch(
                #[inline(always)]
                || {
                    order.for_each_batch(
                        block,
                        #[inline(always)]
                        |first, legendre| {
                            let a: &[Padded; BATCH] =
                                scaled[first..first + BATCH].try_into().expect("padded");
                            for (parity, rings) in parities.iter_mut().enumerate() {
                                let a: [Padded; BATCH / 2] = std::array::from_fn(|j| a[2 * j + parity]);
                                for (lane, ring) in rings.iter_mut().enumerate() {
                                    let p: [f64; BATCH / 2] =
                                        std::array::from_fn(|j| legendre[2 * j + parity][lane]);
                                    *ring = add_products(*ring, &p, &a);
                                }
                            }
                        },
                    );
                },
            );
            let first = index * LANES;
            let [even, odd] = &parities;
            for (lane, (even, odd)) in even.iter().zip(odd).enumerate().take(half - first) {
                rings[first + lane] = std::array::from_fn(|i| even[i] + odd[i]);
                rings[self.ring_count - 1 - first - lane] = std::array::from_fn(|i| even[i] - odd[i]);
            }
        }
        Ok(rings)
    }
}

/// Σ_m e^{imλ} F_m on every row's grid points, with wrapped margins.
fn rows(
    orders: &[Vec<[C64; 3]>],
    period: usize,
    stride: usize,
    lines: Lines,
    cancel: Cancel,
) -> Result<Bulk<Vec<Value>>, Cancelled> {
    let plan = Plan::new(period);
    let mut values = Bulk::new(vec![[0.0; 4]; lines.count * stride]);
    values.par_chunks_mut(stride * SIGNALS).enumerate().try_for_each_init(
        || (Vec::new(), Vec::new(), Vec::new()),
        |(red_green, blue, room), (chunk, out)| {
            cancel.check()?;
            let first = chunk * SIGNALS;
            let count = out.len() / stride;
            for buffer in [&mut *red_green, &mut *blue] {
                buffer.clear();
                buffer.resize(period, Batch::default());
            }
            for (m, order) in orders.iter().enumerate() {
                let i = C64::new(0.0, 1.0);
                let mirror = bin(-(m as isize), period);
                for (signal, &[red, green, blue_value]) in order[first..first + count].iter().enumerate() {
                    if m == 0 {
                        red_green[0].set(signal, C64::new(red.re, green.re));
                        blue[0].set(signal, C64::new(blue_value.re, 0.0));
                    } else {
                        // Two real rows as the parts of one complex transform.
                        red_green[m].set(signal, red + i * green);
                        red_green[mirror].set(signal, red.conj() + i * green.conj());
                        blue[m].set(signal, blue_value);
                        blue[mirror].set(signal, blue_value.conj());
                    }
                }
            }
            plan.inverse(red_green, room);
            plan.inverse(blue, room);
            for (signal, out) in out.chunks_exact_mut(stride).enumerate() {
                for (column, out) in out.iter_mut().enumerate() {
                    let j = bin(column as isize - lines.margin as isize, period);
                    let rg = red_green[j].get(signal);
                    *out = [rg.re, rg.im, blue[j].re[signal], 0.0];
                }
            }
            Ok(())
        },
    )?;
    Ok(values)
}
