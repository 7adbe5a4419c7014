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
use crate::fft::{C64, Plan, bin, cis, even_fft_length, sinc};
use crate::harmonics::{Coefficient, Harmonics, coefficient_count};
use crate::legendre::{BATCH, LANES, Order, RingBlock, add_products};
use rayon::prelude::*;
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
    let spectra = row_spectra(width, height, rgb, band_limit, cancel)?;
    let rows: &[Coefficient] = &spectra;
    let columns = Columns::new(height, band_limit);
    let stride = rows.len() / height;
    let mut orders = Bulk::new(vec![Vec::new(); band_limit + 1]);
    orders.par_iter_mut().enumerate().try_for_each(|(m, order)| {
        let weight =
            cis(-PI * m as f64 / width as f64) * (2.0 * PI / width as f64 * sinc(m as f64 / width as f64));
        let (frequency, conjugate) = alias(m, width);
        let column: Vec<[C64; 3]> = (0..height)
            .map(|row| {
                let [r, g, b] = values(&rows[row * stride + frequency]);
                [r, g, b].map(|z| if conjugate { z.conj() } else { z } * weight)
            })
            .collect();
        *order = columns.project(m, &column, cancel)?;
        Ok(())
    })?;
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
fn row_spectra(
    width: usize,
    height: usize,
    rgb: &[f32],
    band_limit: usize,
    cancel: Cancel,
) -> Result<Bulk<Vec<Coefficient>>, Cancelled> {
    let stride = spectrum_length(width, band_limit);
    let fft = Plan::new(width).forward;
    // Plain zeros come from the system as they are touched, in the loop; zeros of another type would be written here,
    // all 200 MB of them.
    let mut spectra = Bulk::new(vec![[0.0; 6]; height * stride]);
    spectra.par_chunks_mut(stride).zip(rgb.par_chunks(width * 3)).try_for_each_init(
        || (vec![C64::default(); width], vec![C64::default(); width]),
        |(red_green, blue), (out, row)| {
            cancel.check()?;
            for (j, texel) in row.chunks_exact(3).enumerate() {
                red_green[j] = C64::new(f64::from(texel[0]), f64::from(texel[1]));
                blue[j] = C64::new(f64::from(texel[2]), 0.0);
            }
            fft.process(red_green);
            fft.process(blue);
            for (m, out) in out.iter_mut().enumerate() {
                // Two real rows in one complex transform: their spectra are its Hermitian parts.
                let (z, mirrored) = (red_green[m], red_green[bin(-(m as isize), width)].conj());
                let difference = (z - mirrored) * 0.5;
                let red = (z + mirrored) * 0.5;
                *out = [red.re, red.im, difference.im, -difference.re, blue[m].re, blue[m].im];
            }
            Ok(())
        },
    )?;
    Ok(spectra)
}

/// The channels of a coefficient as complex numbers.
fn values(&[a, b, c, d, e, f]: &Coefficient) -> [C64; 3] {
    [C64::new(a, b), C64::new(c, d), C64::new(e, f)]
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

    /// a_lm for l = m … L from the column's F_m, one value per row and channel.
    fn project(&self, m: usize, column: &[[C64; 3]], cancel: Cancel) -> Result<Vec<Coefficient>, Cancelled> {
        let half = self.ring_count / 2;
        let mut even = vec![[0.0; 6]; half.next_multiple_of(LANES)];
        let mut odd = even.clone();
        for channel in 0..3 {
            cancel.check()?;
            let rings = self.on_rings(m, column, channel);
            for n in 0..half {
                let (north, south) = (rings[n], rings[self.ring_count - 1 - n]);
                let (sum, difference) = (north + south, north - south);
                even[n][2 * channel..2 * channel + 2].copy_from_slice(&[sum.re, sum.im]);
                odd[n][2 * channel..2 * channel + 2].copy_from_slice(&[difference.re, difference.im]);
            }
        }
        self.integrate(m, &[even, odd], cancel)
    }

    /// F_m(θ) sin θ, band-limited, on the rings.
    fn on_rings(&self, m: usize, column: &[[C64; 3]], channel: usize) -> Vec<C64> {
        let sign = if m.is_multiple_of(2) { -1.0 } else { 1.0 };
        let period = 2 * self.height;
        let mut steps = vec![C64::default(); period];
        for (row, value) in column.iter().enumerate() {
            // sin θ changes sign behind the pole, and so must the step function where the product is even.
            steps[row] = value[channel];
            steps[period - 1 - row] = value[channel] * sign;
        }
        self.patches.forward.process(&mut steps);
        let step_at = |k: isize| {
            let factor = self.step_factor[k.unsigned_abs()];
            steps[bin(k, period)] * if k < 0 { factor.conj() } else { factor }
        };
        let mut rings = vec![C64::default(); 2 * self.ring_count];
        let limit = self.band_limit as isize;
        for k in -limit..=limit {
            let shift = self.ring_shift[k.unsigned_abs()];
            let times_sin = (step_at(k - 1) - step_at(k + 1)) * C64::new(0.0, -0.5);
            rings[bin(k, 2 * self.ring_count)] = times_sin * if k < 0 { shift.conj() } else { shift };
        }
        self.rings.inverse.process(&mut rings);
        rings.truncate(self.ring_count);
        rings
    }

    /// (π/N) Σ_n P̄_lm(θ_n) g(θ_n) over both hemispheres; P̄_lm is even about the equator where l − m is.
    fn integrate(
        &self,
        m: usize,
        parities: &[Vec<Coefficient>; 2],
        cancel: Cancel,
    ) -> Result<Vec<Coefficient>, Cancelled> {
        let order = Order::new(m, self.band_limit);
        let count = self.band_limit + 1 - m;
        let mut sums = vec![[0.0; 6]; count.next_multiple_of(BATCH)];
        for (index, block) in self.blocks.iter().enumerate() {
            if block.is_negligible(m, self.band_limit) {
                continue;
            }
            cancel.check()?;
            let first = index * LANES;
            let rings: [&[Coefficient; LANES]; 2] = std::array::from_fn(|parity| {
                parities[parity][first..first + LANES].try_into().expect("padded to whole blocks")
            });
            order.for_each_batch(block, |first, legendre| {
                for (index, (sum, p)) in sums[first..first + BATCH].iter_mut().zip(legendre).enumerate() {
                    *sum = add_products(*sum, p, rings[index & 1]);
                }
            });
        }
        let weight = PI / self.ring_count as f64;
        Ok(sums[..count].iter().map(|sum| sum.map(|part| part * weight)).collect())
    }
}

/// The northern half of `ring_count` rings θ_n = π (n + ½)/N, in blocks.
pub(crate) fn ring_blocks(ring_count: usize) -> Vec<RingBlock> {
    let thetas: Vec<f64> = (0..ring_count / 2).map(|n| PI * (n as f64 + 0.5) / ring_count as f64).collect();
    thetas.chunks(LANES).map(RingBlock::new).collect()
}
