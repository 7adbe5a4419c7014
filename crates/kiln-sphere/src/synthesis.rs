//! Harmonics → values in any direction, many at once.
//!
//! 1. On N ≥ L + 1 rings θ_n = π (n + ½)/N: F_m(θ_n) = Σ_l κ_l a_lm P̄_lm(cos θ_n), exact.
//! 2. Continued around the whole circle with parity (−1)^m (double Fourier sphere) each F_m is a trigonometric
//!    polynomial of degree L, so an FFT gives its coefficients: the function is now a Fourier series on a torus.
//! 3. Evaluated on a grid 1.5 times finer, divided by the window's transform, and interpolated with that window
//!    (a non-uniform FFT of type 2): 1e-8 of the function's size, see `spread`.

use crate::analysis::ring_blocks;
use crate::cancel::{Bulk, Cancel, Cancelled};
use crate::direction::{cube_direction, cube_texel_centre};
use crate::fft::{C64, Plan, bin, cis, even_fft_length};
use crate::harmonics::{Coefficient, Harmonics};
use crate::legendre::{BATCH, LANES, Order, RingBlock, add_products};
use crate::spread::{OVERSAMPLING, WIDTH, Window};
use rayon::prelude::*;
use std::f64::consts::PI;

/// The function with coefficients κ_l a_lm at the texel centres of a cube map: `6 · face_size² · 3` values,
/// faces in KTX2 order, rows from the top left.
///
/// `kappa` holds κ_0 … κ_L; degrees beyond it, or beyond the harmonics' band limit, are left out. Within about
/// 1e-7 of the function's largest value of the exact sum ([`evaluate`]).
///
/// # Errors
/// [`Cancelled`] within the work of a block of rings, a grid row or a row of texels.
pub fn synthesise_cube(
    harmonics: &Harmonics,
    kappa: &[f64],
    face_size: usize,
    cancel: Cancel,
) -> Result<Bulk<Vec<f64>>, Cancelled> {
    let grid = Grid::new(harmonics, kappa, cancel)?;
    let mut rgb = Bulk::new(vec![0.0; 6 * face_size * face_size * 3]);
    rgb.par_chunks_mut(face_size.max(1) * 3).enumerate().try_for_each(|(line, out)| {
        cancel.check()?;
        let (face, y) = (line / face_size, line % face_size);
        let t = cube_texel_centre(face_size, y);
        for (x, texel) in out.chunks_exact_mut(3).enumerate() {
            let direction = cube_direction(face, cube_texel_centre(face_size, x), t);
            texel.copy_from_slice(&grid.interpolate(direction));
        }
        Ok(())
    })?;
    Ok(rgb)
}

/// Memory that [`synthesise_cube`] takes at most, its result included, its input and some kilobytes a thread not.
pub fn synthesise_cube_bytes(band_limit: usize, face_size: usize) -> usize {
    let period = grid_period(band_limit);
    let line_count = period / 2 + WIDTH;
    let orders = (band_limit + 1) * line_count * size_of::<[C64; 3]>();
    let grid = line_count * (period + WIDTH) * size_of::<[f64; 3]>();
    orders + grid + 6 * face_size * face_size * size_of::<[f64; 3]>()
}

/// Grid points per full circle for degrees up to `band_limit`.
fn grid_period(band_limit: usize) -> usize {
    let least = libm::ceil((2 * band_limit + 2) as f64 * OVERSAMPLING) as usize;
    even_fft_length(least.max(2 * WIDTH))
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

/// The function on an oversampled grid over (θ, λ), with margins wide enough for the window.
struct Grid {
    window: Window,
    /// Grid points per full circle, along λ and (twice the rows from pole to pole) along θ.
    period: usize,
    /// Values per row: a period and the margins.
    stride: usize,
    values: Bulk<Vec<[f64; 3]>>,
}

/// Rows and columns before the grid's origin: a window may start that far below its cell.
const MARGIN: usize = WIDTH / 2 - 1;

impl Grid {
    fn new(harmonics: &Harmonics, kappa: &[f64], cancel: Cancel) -> Result<Self, Cancelled> {
        let band_limit = usable_band_limit(harmonics, kappa);
        let period = grid_period(band_limit);
        let window = Window::new();
        let deconvolution = window.deconvolution(band_limit, period, cancel)?;
        let columns = Columns::new(harmonics, kappa, period, &deconvolution);
        let mut orders = Bulk::new(vec![Vec::new(); band_limit + 1]);
        orders.par_iter_mut().enumerate().try_for_each(|(m, order)| {
            *order = columns.refine(m, &deconvolution, cancel)?;
            Ok(())
        })?;
        let stride = period + WIDTH;
        let values = rows(&orders, period, stride, cancel)?;
        Ok(Self { window, period, stride, values })
    }

    fn interpolate(&self, direction: [f64; 3]) -> [f64; 3] {
        let (theta, lambda) = angles(direction);
        let scale = self.period as f64 / (2.0 * PI);
        let (row, row_weights) = self.window.weights(theta * scale);
        let (column, column_weights) = self.window.weights(lambda * scale);
        let first = (row + MARGIN as isize) as usize * self.stride + (column + MARGIN as isize) as usize;
        let values: &[[f64; 3]] = &self.values;
        let mut sum = [0.0; 3];
        for (line, row_weight) in row_weights.iter().enumerate() {
            let start = first + line * self.stride;
            let mut partial = [0.0; 3];
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

    /// F_m on the grid rows −MARGIN … period/2 + MARGIN, times what the rows' synthesis needs.
    fn refine(&self, m: usize, deconvolution: &[f64], cancel: Cancel) -> Result<Vec<[C64; 3]>, Cancelled> {
        let rings = self.on_rings(m, cancel)?;
        let sign = if m.is_multiple_of(2) { 1.0 } else { -1.0 };
        let circle = 2 * self.ring_count;
        let mut result = vec![[C64::default(); 3]; self.period / 2 + WIDTH];
        for channel in 0..3 {
            cancel.check()?;
            let mut coarse = vec![C64::default(); circle];
            for (n, ring) in rings.iter().enumerate() {
                coarse[n] = C64::new(ring[2 * channel], ring[2 * channel + 1]);
                coarse[circle - 1 - n] = coarse[n] * sign;
            }
            self.rings.forward.process(&mut coarse);
            let mut fine = vec![C64::default(); self.period];
            let limit = self.band_limit as isize;
            for k in -limit..=limit {
                let factor = self.factor[k.unsigned_abs()];
                fine[bin(k, self.period)] =
                    coarse[bin(k, circle)] * if k < 0 { factor.conj() } else { factor };
            }
            self.fine.inverse.process(&mut fine);
            for (line, out) in result.iter_mut().enumerate() {
                out[channel] = fine[bin(line as isize - MARGIN as isize, self.period)] * deconvolution[m];
            }
        }
        Ok(result)
    }

    /// Σ_l κ_l a_lm P̄_lm(cos θ_n) on all rings, north to south.
    fn on_rings(&self, m: usize, cancel: Cancel) -> Result<Vec<[f64; 6]>, Cancelled> {
        let order = Order::new(m, self.band_limit);
        let degrees = self.harmonics.order(m).iter().zip(&self.kappa[m..=self.band_limit]);
        let mut scaled: Vec<Coefficient> = degrees.map(|(a, k)| a.map(|part| part * k)).collect();
        scaled.resize(scaled.len().next_multiple_of(BATCH), [0.0; 6]);
        let half = self.ring_count / 2;
        let mut rings = vec![[0.0; 6]; self.ring_count];
        for (index, block) in self.blocks.iter().enumerate() {
            if block.is_negligible(m, self.band_limit) {
                continue;
            }
            cancel.check()?;
            let mut parities = [[[0.0; 6]; LANES]; 2];
            order.for_each_batch(block, |first, legendre| {
                let a: &[Coefficient; BATCH] = scaled[first..first + BATCH].try_into().expect("padded");
                for (parity, rings) in parities.iter_mut().enumerate() {
                    let a: [Coefficient; BATCH / 2] = std::array::from_fn(|j| a[2 * j + parity]);
                    for (lane, ring) in rings.iter_mut().enumerate() {
                        let p: [f64; BATCH / 2] = std::array::from_fn(|j| legendre[2 * j + parity][lane]);
                        *ring = add_products(*ring, &p, &a);
                    }
                }
            });
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
    cancel: Cancel,
) -> Result<Bulk<Vec<[f64; 3]>>, Cancelled> {
    let plan = Plan::new(period).inverse;
    let line_count = period / 2 + WIDTH;
    let mut values = Bulk::new(vec![[0.0; 3]; line_count * stride]);
    values.par_chunks_mut(stride).enumerate().try_for_each_init(
        || (vec![C64::default(); period], vec![C64::default(); period]),
        |(red_green, blue), (line, out)| {
            cancel.check()?;
            red_green.fill(C64::default());
            blue.fill(C64::default());
            for (m, order) in orders.iter().enumerate() {
                let [red, green, blue_value] = order[line];
                let i = C64::new(0.0, 1.0);
                let mirror = bin(-(m as isize), period);
                if m == 0 {
                    red_green[0] = C64::new(red.re, green.re);
                    blue[0] = C64::new(blue_value.re, 0.0);
                } else {
                    // Two real rows as the parts of one complex transform.
                    red_green[m] = red + i * green;
                    red_green[mirror] = red.conj() + i * green.conj();
                    blue[m] = blue_value;
                    blue[mirror] = blue_value.conj();
                }
            }
            plan.process(red_green);
            plan.process(blue);
            for (column, out) in out.iter_mut().enumerate() {
                let j = bin(column as isize - MARGIN as isize, period);
                *out = [red_green[j].re, red_green[j].im, blue[j].re];
            }
            Ok(())
        },
    )?;
    Ok(values)
}
