//! FFT plans: scalar ones, because vector plans differ in their last bits from machine to machine.

use rustfft::{Fft, FftPlannerScalar, num_complex::Complex};
use std::sync::Arc;

pub(crate) type C64 = Complex<f64>;

/// Both directions of one length, unnormalised.
#[derive(Clone)]
pub(crate) struct Plan {
    pub(crate) forward: Arc<dyn Fft<f64>>,
    pub(crate) inverse: Arc<dyn Fft<f64>>,
}

impl Plan {
    pub(crate) fn new(length: usize) -> Self {
        let mut planner = FftPlannerScalar::new();
        Self { forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }
}

/// Smallest even 2^a 3^b 5^c that is at least `minimum`.
pub(crate) fn even_fft_length(minimum: usize) -> usize {
    let is_smooth = |mut n: usize| {
        for prime in [2, 3, 5] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n == 1
    };
    let mut length = minimum.max(2).next_multiple_of(2);
    while !is_smooth(length) {
        length += 2;
    }
    length
}

/// sin(πx) / (πx).
pub(crate) fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    if y.abs() < 1e-4 { 1.0 - y * y / 6.0 } else { libm::sin(y) / y }
}

/// e^{i · angle}.
pub(crate) fn cis(angle: f64) -> C64 {
    let (sin, cos) = libm::sincos(angle);
    C64::new(cos, sin)
}

/// Position of frequency `k` in a transform of `length`.
pub(crate) fn bin(k: isize, length: usize) -> usize {
    let period = length as isize;
    match k {
        0.. if k < period => k as usize,
        // Almost always: a division here would cost as much as the transform.
        ..0 if k >= -period => (k + period) as usize,
        _ => k.rem_euclid(period) as usize,
    }
}
