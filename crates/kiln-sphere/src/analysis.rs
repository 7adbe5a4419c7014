//! Panorama → harmonics. A texel is a constant patch of the sphere, so the result is exact up to rounding:
//!
//! ```text
//! a_lm = Σ_texels f ∫_patch P̄_lm(cos θ) e^{−imλ} sin θ dθ dλ
//! ```
//!
//! 1. Along each row an FFT; the patch's width gives the factor (2π/W) sinc(m/W) e^{−iπm/W}.
//! 2. Down each column F_m(θ) sin θ is needed against P̄_lm, which is a trigonometric polynomial of degree l in θ
//!    when continued around the circle with parity (−1)^m. So only the Fourier coefficients up to L of the
//!    continued step function times sin θ matter; they are known exactly: an FFT of length 2H, times sinc.
//! 3. Summed up on N ≥ L + 1 rings θ_n = π (n + ½)/N they stand for the step function exactly, and
//!    ∫ … dθ = (π/N) Σ_n is exact too. The ring count is free of H, and the two hemispheres share P̄_lm.

use crate::cancel::{Bulk, Cancel, Cancelled};
use crate::fft::{Batch, C64, Plan, SIGNALS, bin, cis, even_fft_length, sinc};
use crate::harmonics::{Coefficient, Harmonics, coefficient_count};
use crate::legendre::{BATCH, LANES, Order, Padded, RingBlock, add_products, unpad};
use crate::simd;
use rayon::prelude::*;
use std::borrow::Cow;
use std::f64::consts::PI;

/// Harmonics of a panorama of `width` × `height` constant patches, degrees up to `band_limit`.
///
/// `rgb` holds `width · height · 3` values, row 0 at +Y. Any sizes from 1 × 1 are accepted; `band_limit` may
/// exceed `width / 2`, since patches have content beyond it. Exact up to rounding: within 1e-11 of quadrature.
/// Non-finite texels give non-finite coefficients. Panics if `rgb` has another length.
///
/// # Errors
/// [`Cancelled`] within a row's or a block of rings' work.
pub fn analyse(
    width: usize,
    height: usize,
    rgb: &[f32],
    band_limit: usize,
    cancel: Cancel,
) -> Result<Harmonics, Cancelled> {
    assert!(width > 0 && rgb.len() == width * height * 3, "{width}x{height} texels, {} values", rgb.len());
    analyse_rows(width, height, |row| Cow::Borrowed(&rgb[row * width * 3..][..width * 3]), band_limit, cancel)
}

/// [`analyse`] of rows that are made as they are read, so that a changed panorama needs no copy of its own.
///
/// `row` gives the `width · 3` values of a row. Panics if it gives another number.
///
/// # Errors
/// [`Cancelled`] within a row's or a block of rings' work.
pub fn analyse_rows<'a>(
    width: usize,
    height: usize,
    row: impl Fn(usize) -> Cow<'a, [f32]> + Sync,
    band_limit: usize,
    cancel: Cancel,
) -> Result<Harmonics, Cancelled> {
    let spectra = row_spectra(width, height, row, band_limit, cancel)?;
    let rows: &[Coefficient] = &spectra;
    let columns = Columns::new(height, band_limit);
    let stride = rows.len() / height;
    let mut orders = Bulk::new(vec![Vec::new(); band_limit + 1]);
    orders.par_chunks_mut(SIGNALS).enumerate().try_for_each_init(
        Room::default,
        |room, (chunk, orders)| {
            let first = chunk * SIGNALS;
            let ms: [usize; SIGNALS] = std::array::from_fn(|signal| first + signal.min(orders.len() - 1));
            let weights = ms.map(|m| {
                let share = m as f64 / width as f64;
                cis(-PI * share) * (2.0 * PI / width as f64 * sinc(share))
            });
            let aliases = ms.map(|m| alias(m, width));
            let value = |row: usize, channel: usize, signal: usize| {
                let (frequency, is_conjugate) = aliases[signal];
                let coefficient = &rows[row * stride + frequency];
                let z = C64::new(coefficient[2 * channel], coefficient[2 * channel + 1]);
                (if is_conjugate { z.conj() } else { z }) * weights[signal]
            };
            columns.project(ms, value, room, orders, cancel)
        },
    )?;
    drop(spectra);
    Harmonics::from_orders(band_limit, &mut orders, cancel)
}

/// Memory that [`analyse`] takes at most, its result included, its input and some kilobytes a thread not.
pub fn analyse_bytes(width: usize, height: usize, band_limit: usize) -> usize {
    let spectra = height * spectrum_length(width, band_limit);
    // Once as orders, once as the result.
    (spectra + 2 * coefficient_count(band_limit)) * size_of::<Coefficient>()
}

/// Frequencies a row's spectrum keeps.
fn spectrum_length(width: usize, band_limit: usize) -> usize {
    band_limit.min(width / 2) + 1
}

/// Where a real row's spectrum of period `width` holds frequency m, and whether conjugated.
fn alias(m: usize, width: usize) -> (usize, bool) {
    let frequency = m % width;
    if frequency <= width / 2 { (frequency, false) } else { (width - frequency, true) }
}

/// Σ_j f_j e^{−2πimj/W} for 0 ≤ m ≤ min(L, W/2), row by row.
fn row_spectra<'a>(
    width: usize,
    height: usize,
    row: impl Fn(usize) -> Cow<'a, [f32]> + Sync,
    band_limit: usize,
    cancel: Cancel,
) -> Result<Bulk<Vec<Coefficient>>, Cancelled> {
    let stride = spectrum_length(width, band_limit);
    let fft = Plan::new(width);
    // Plain zeros come from the system as they are touched, in the loop; zeros of another type would be written here,
    // all 200 MB of them.
    let mut spectra = Bulk::new(vec![[0.0; 6]; height * stride]);
    spectra.par_chunks_mut(stride * ROWS).enumerate().try_for_each_init(
        || (vec![Batch::default(); width], Vec::new()),
        |(signals, room), (block, out)| {
            cancel.check()?;
            let first = block * ROWS;
            let rows: Vec<_> = (first..first + out.len() / stride).map(&row).collect();
            if rows.iter().all(|texels| texels.iter().all(|&value| value == 0.0)) {
                // As the spectra are already: a few bright texels alone cost little.
                return Ok(());
            }
            for channel in 0..3 {
                cancel.check()?;
                for (row, texels) in rows.iter().enumerate() {
                    let values = texels[channel..width * 3].iter().step_by(3);
                    for (signal, &value) in signals.iter_mut().zip(values) {
                        let parts = if row % 2 == 0 { &mut signal.re } else { &mut signal.im };
                        parts[row / 2] = f64::from(value);
                    }
                }
                fft.forward(signals, room);
                for (row, out) in out.chunks_exact_mut(stride).enumerate() {
                    for (m, out) in out.iter_mut().enumerate() {
                        // Two real rows in one complex transform: their spectra are its Hermitian parts.
                        let z = signals[m].get(row / 2);
                        let mirrored = signals[bin(-(m as isize), width)].get(row / 2).conj();
                        let (sum, difference) = ((z + mirrored) * 0.5, (z - mirrored) * 0.5);
                        let value = if row % 2 == 0 { sum } else { C64::new(difference.im, -difference.re) };
                        out[2 * channel..2 * channel + 2].copy_from_slice(&[value.re, value.im]);
                    }
                }
            }
            Ok(())
        },
    )?;
    Ok(spectra)
}

/// Rows transformed together: two real ones make a complex signal.
const ROWS: usize = 2 * SIGNALS;

/// Buffers of one thread.
#[derive(Default)]
struct Room {
    steps: Vec<Batch>,
    rings: Vec<Batch>,
    fft: Vec<Batch>,
}

/// What all columns of one panorama share.
struct Columns {
    band_limit: usize,
    height: usize,
    ring_count: usize,
    patches: Plan,
    rings: Plan,
    /// (1/2H) sinc(k/2H) e^{−iπk/2H}: from the FFT of 2H steps to Fourier coefficients, k = 0 … L + 1.
    step_factor: Vec<C64>,
    /// e^{ikπ/2N}: shifts to ring centres, k = 0 … L.
    ring_shift: Vec<C64>,
    blocks: Vec<RingBlock>,
}

impl Columns {
    fn new(height: usize, band_limit: usize) -> Self {
        let ring_count = even_fft_length(band_limit + 1);
        let period = 2.0 * height as f64;
        let step = |k: usize| cis(-PI * k as f64 / period) * (sinc(k as f64 / period) / period);
        let shift = |k: usize| cis(PI * k as f64 / (2 * ring_count) as f64);
        Self {
            band_limit,
            height,
            ring_count,
            patches: Plan::new(2 * height),
            rings: Plan::new(2 * ring_count),
            step_factor: (0..=band_limit + 1).map(step).collect(),
            ring_shift: (0..=band_limit).map(shift).collect(),
            blocks: ring_blocks(ring_count),
        }
    }

    /// a_lm for l = m … L of up to four orders from their columns F_m: `value(row, channel, signal)`.
    fn project(
        &self,
        ms: [usize; SIGNALS],
        value: impl Fn(usize, usize, usize) -> C64,
        room: &mut Room,
        orders: &mut [Vec<Coefficient>],
        cancel: Cancel,
    ) -> Result<(), Cancelled> {
        let half = self.ring_count / 2;
        let mut parities = [(); SIGNALS].map(|()| {
            let zeros = vec![[0.0; 8]; half.next_multiple_of(LANES)];
            [zeros.clone(), zeros]
        });
        for channel in 0..3 {
            cancel.check()?;
            self.to_rings(ms, |row, signal| value(row, channel, signal), room);
            let place = 2 * channel..2 * channel + 2;
            for (signal, [even, odd]) in parities.iter_mut().enumerate() {
                for n in 0..half {
                    let (north, south) = (room.rings[n], room.rings[self.ring_count - 1 - n]);
                    let (north, south) = (north.get(signal), south.get(signal));
                    let (sum, difference) = (north + south, north - south);
                    even[n][place.clone()].copy_from_slice(&[sum.re, sum.im]);
                    odd[n][place.clone()].copy_from_slice(&[difference.re, difference.im]);
                }
            }
        }
        for (signal, order) in orders.iter_mut().enumerate() {
            *order = self.integrate(ms[signal], &parities[signal], cancel)?;
        }
        Ok(())
    }

    /// F_m(θ) sin θ of four orders, band-limited, on the rings: `room.rings`, north to south.
    fn to_rings(&self, ms: [usize; SIGNALS], value: impl Fn(usize, usize) -> C64, room: &mut Room) {
        let period = 2 * self.height;
        room.steps.resize(period, Batch::default());
        for (signal, m) in ms.into_iter().enumerate() {
            // sin θ changes sign behind the pole, and so must the step function where the product is even.
            let sign = if m.is_multiple_of(2) { -1.0 } else { 1.0 };
            for row in 0..self.height {
                let step = value(row, signal);
                room.steps[row].set(signal, step);
                room.steps[period - 1 - row].set(signal, step * sign);
            }
        }
        self.patches.forward(&mut room.steps, &mut room.fft);
        let step_at = |k: isize| {
            let factor = self.step_factor[k.unsigned_abs()];
            room.steps[bin(k, period)] * if k < 0 { factor.conj() } else { factor }
        };
        room.rings.clear();
        room.rings.resize(2 * self.ring_count, Batch::default());
        let limit = self.band_limit as isize;
        for k in -limit..=limit {
            let shift = self.ring_shift[k.unsigned_abs()] * C64::new(0.0, -0.5);
            let shift = if k < 0 { -shift.conj() } else { shift };
            room.rings[bin(k, 2 * self.ring_count)] = (step_at(k - 1) - step_at(k + 1)) * shift;
        }
        self.rings.inverse(&mut room.rings, &mut room.fft);
    }

    /// (π/N) Σ_n P̄_lm(θ_n) g(θ_n) over both hemispheres; P̄_lm is even about the equator where l − m is.
    fn integrate(
        &self,
        m: usize,
        parities: &[Vec<Padded>; 2],
        cancel: Cancel,
    ) -> Result<Vec<Coefficient>, Cancelled> {
        let order = Order::new(m, self.band_limit);
        let count = self.band_limit + 1 - m;
        let mut sums = vec![[0.0; 8]; count.next_multiple_of(BATCH)];
        for (index, block) in self.blocks.iter().enumerate() {
            if block.is_negligible(m, self.band_limit) {
                continue;
            }
            cancel.check()?;
            let first = index * LANES;
            let rings: [&[Padded; LANES]; 2] = std::array::from_fn(|parity| {
                parities[parity][first..first + LANES].try_into().expect("padded to whole blocks")
            });
            simd::dispatch(
                #[inline(always)]
                || {
                    order.for_each_batch(
                        block,
                        #[inline(always)]
                        |first, legendre| {
                            let sums = &mut sums[first..first + BATCH];
                            for (index, (sum, p)) in sums.iter_mut().zip(legendre).enumerate() {
                                *sum = add_products(*sum, p, rings[index & 1]);
                            }
                        },
                    );
                },
            );
        }
        let weight = PI / self.ring_count as f64;
        Ok(sums[..count].iter().map(|sum| unpad(sum.map(|part| part * weight))).collect())
    }
}

/// The northern half of `ring_count` rings θ_n = π (n + ½)/N, in blocks.
pub(crate) fn ring_blocks(ring_count: usize) -> Vec<RingBlock> {
    let thetas: Vec<f64> = (0..ring_count / 2).map(|n| PI * (n as f64 + 0.5) / ring_count as f64).collect();
    thetas.chunks(LANES).map(RingBlock::new).collect()
}
