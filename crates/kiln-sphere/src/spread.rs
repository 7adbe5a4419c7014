//! The window that interpolates an oversampled periodic grid: exp(β (√(1 − x²) − 1)), cut into polynomials.
//!
//! Source: Barnett, Magland, af Klinteberg 2019, "A parallel non-uniform fast Fourier transform library based
//! on an 'exponential of semicircle' kernel", eq. 1.8; the choice of β for a low oversampling follows
//! section 4.2 there (β = 0.976 π w (1 − 1/2σ)).

use crate::cancel::{Cancel, Cancelled};
use crate::quadrature::gauss_legendre;
use std::f64::consts::PI;

/// Grid points per highest frequency's two samples.
pub(crate) const OVERSAMPLING: f64 = 1.5;
/// Coefficients of each polynomial; with 14 they follow the window to 1e-10.
const COEFFICIENTS: usize = 14;

/// The window as one polynomial per grid interval, and what interpolation does to each frequency. A position is
/// interpolated from `WIDTH` grid points per dimension, to some 10^(1 − WIDTH · 0.8) of the function.
pub(crate) struct Window<const WIDTH: usize> {
    /// `powers[d][j]`: coefficient of y^d in the weight of the j-th grid point.
    powers: [[f64; WIDTH]; COEFFICIENTS],
}

impl<const WIDTH: usize> Window<WIDTH> {
    pub(crate) fn new() -> Self {
        let mut powers = [[0.0; WIDTH]; COEFFICIENTS];
        for j in 0..WIDTH {
            let polynomial = interpolate(|y| semicircle::<WIDTH>(interval_position::<WIDTH>(j, y)));
            for (row, coefficient) in powers.iter_mut().zip(polynomial) {
                row[j] = coefficient;
            }
        }
        Self { powers }
    }

    /// First grid point (may be negative) and weights for the position `x`, in units of the grid spacing.
    #[inline(always)]
    pub(crate) fn weights(&self, x: f64) -> (isize, [f64; WIDTH]) {
        let cell = x.floor();
        let y = 2.0 * (x - cell) - 1.0;
        let mut weights = self.powers[COEFFICIENTS - 1];
        for row in self.powers[..COEFFICIENTS - 1].iter().rev() {
            for (weight, coefficient) in weights.iter_mut().zip(row) {
                *weight = *weight * y + coefficient;
            }
        }
        (cell as isize + 1 - WIDTH as isize / 2, weights)
    }

    /// 1 / (Fourier transform of the window at frequency k) for k = 0 … `highest`, on a grid of `period` points.
    pub(crate) fn deconvolution(
        &self,
        highest: usize,
        period: usize,
        cancel: Cancel,
    ) -> Result<Vec<f64>, Cancelled> {
        let rule = gauss_legendre(40);
        let half = WIDTH as f64 / 2.0;
        let transform = |k: usize| -> f64 {
            let omega = 2.0 * PI * k as f64 / period as f64;
            // x = sin(πy/2) removes the root at the window's ends.
            let term = |&(y, weight): &(f64, f64)| {
                let (sin, cos) = libm::sincos(0.5 * PI * y);
                weight * 0.5 * PI * cos * half * semicircle::<WIDTH>(sin) * libm::cos(omega * half * sin)
            };
            rule.iter().map(term).sum()
        };
        (0..=highest).map(|k| cancel.check().map(|()| 1.0 / transform(k))).collect()
    }
}

fn semicircle<const WIDTH: usize>(x: f64) -> f64 {
    let beta = 0.976 * PI * WIDTH as f64 * (1.0 - 0.5 / OVERSAMPLING);
    let inside = 1.0 - x * x;
    if inside <= 0.0 { libm::exp(-beta) } else { libm::exp(beta * (inside.sqrt() - 1.0)) }
}

/// Place in [−1, 1] of the window, seen from the j-th grid point, for y in [−1, 1] across the grid interval.
fn interval_position<const WIDTH: usize>(j: usize, y: f64) -> f64 {
    let half = WIDTH as f64 / 2.0;
    (half - 0.5 - j as f64 + 0.5 * y) / half
}

/// Power coefficients of the polynomial through `f` at the Chebyshev points of [−1, 1].
fn interpolate(f: impl Fn(f64) -> f64) -> [f64; COEFFICIENTS] {
    let n = COEFFICIENTS;
    let angle = |i: usize| PI * (i as f64 + 0.5) / n as f64;
    let samples: [f64; COEFFICIENTS] = std::array::from_fn(|i| f(libm::cos(angle(i))));
    let mut result = [0.0; COEFFICIENTS];
    let (mut previous, mut chebyshev) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
    chebyshev[0] = 1.0;
    for degree in 0..n {
        let projection: f64 = (0..n).map(|i| samples[i] * libm::cos(degree as f64 * angle(i))).sum();
        let coefficient = projection * if degree == 0 { 1.0 } else { 2.0 } / n as f64;
        for (r, t) in result.iter_mut().zip(chebyshev) {
            *r += coefficient * t;
        }
        let twice = if degree == 0 { 1.0 } else { 2.0 };
        let next = std::array::from_fn(|p| if p == 0 { 0.0 } else { twice * chebyshev[p - 1] } - previous[p]);
        (previous, chebyshev) = (chebyshev, next);
    }
    result
}
