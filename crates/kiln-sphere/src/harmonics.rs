//! Spherical-harmonic coefficients of a three-channel real function.

use crate::cancel::{Bulk, Cancel, Cancelled};
use std::f64::consts::PI;

/// One coefficient of all channels: re, im of red, green, blue.
pub(crate) type Coefficient = [f64; 6];

/// Coefficients a_lm = ∫ f(ω) P̄_lm(cos θ) e^{−imλ} dω of a real function per channel, 0 ≤ m ≤ l ≤ band limit.
///
/// θ is the angle from +Y, λ = 2πu the panorama's longitude (λ = π looks along −Z), P̄_lm such that
/// Y_lm = P̄_lm e^{imλ} is orthonormal, without Condon–Shortley sign. The function is real, so
/// f = Σ_l [a_l0 P̄_l0 + 2 Re Σ_{m>0} a_lm P̄_lm e^{imλ}].
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    band_limit: usize,
    /// Order by order: all l of m = 0, then all l ≥ 1 of m = 1 …
    coefficients: Bulk<Vec<Coefficient>>,
}

impl Harmonics {
    /// The zero function.
    pub fn zero(band_limit: usize) -> Self {
        Self { band_limit, coefficients: Bulk::new(vec![[0.0; 6]; coefficient_count(band_limit)]) }
    }

    /// From the coefficients of order 0, 1 …, each order from l = m up; takes them out one by one.
    pub(crate) fn from_orders(
        band_limit: usize,
        orders: &mut [Vec<Coefficient>],
        cancel: Cancel,
    ) -> Result<Self, Cancelled> {
        let mut coefficients = Bulk::new(Vec::with_capacity(coefficient_count(band_limit)));
        for order in orders {
            cancel.check()?;
            coefficients.append(&mut std::mem::take(order));
        }
        assert_eq!(coefficients.len(), coefficient_count(band_limit), "one list per order");
        Ok(Self { band_limit, coefficients })
    }

    /// From the layout [`Harmonics::coefficients`] returns; `None` if the count does not fit the band limit.
    pub fn from_coefficients(band_limit: usize, coefficients: Vec<[f64; 6]>) -> Option<Self> {
        let coefficients = Bulk::new(coefficients);
        (coefficients.len() == coefficient_count(band_limit)).then_some(Self { band_limit, coefficients })
    }

    /// The degrees up to `band_limit`; zeros where there are none.
    pub fn truncated(&self, band_limit: usize) -> Self {
        let mut result = Self::zero(band_limit);
        let mut start = 0;
        for m in 0..=band_limit {
            let count = band_limit + 1 - m;
            if m <= self.band_limit {
                let order = self.order(m);
                let kept = count.min(order.len());
                result.coefficients[start..start + kept].copy_from_slice(&order[..kept]);
            }
            start += count;
        }
        result
    }

    /// Adds a function of the same band limit. Panics if it has another.
    pub fn add(&mut self, other: &Harmonics) {
        assert_eq!(self.band_limit, other.band_limit, "sums need equal band limits");
        for (sum, value) in self.coefficients.iter_mut().zip(other.coefficients.iter()) {
            for (sum, value) in sum.iter_mut().zip(value) {
                *sum += value;
            }
        }
    }

    /// Highest degree kept.
    pub fn band_limit(&self) -> usize {
        self.band_limit
    }

    /// All coefficients (re, im of red, green, blue): the degrees 0 … L of m = 0, then 1 … L of m = 1, and so on.
    pub fn coefficients(&self) -> &[[f64; 6]] {
        &self.coefficients
    }

    /// a_lm (re, im of red, green, blue). Panics unless m ≤ l ≤ band limit.
    pub fn coefficient(&self, l: usize, m: usize) -> [f64; 6] {
        self.order(m)[l - m]
    }

    /// The coefficients of order `m`, from l = m to the band limit.
    pub(crate) fn order(&self, m: usize) -> &[Coefficient] {
        assert!(m <= self.band_limit, "order {m} over the band limit {}", self.band_limit);
        let start = m * (2 * self.band_limit + 3 - m) / 2;
        &self.coefficients[start..start + self.band_limit + 1 - m]
    }

    /// ‖f_l‖² = Σ_m |a_lm|² (all m from −l to l), summed over the channels, for l = 0 … band limit.
    ///
    /// Their sum over l is ∫ |f|² dω of the band-limited function (Parseval).
    ///
    /// # Errors
    /// [`Cancelled`] within an order's work.
    pub fn band_energies(&self, cancel: Cancel) -> Result<Vec<f64>, Cancelled> {
        let mut energies = vec![0.0; self.band_limit + 1];
        for m in 0..=self.band_limit {
            cancel.check()?;
            let multiplicity = if m == 0 { 1.0 } else { 2.0 };
            for (energy, a) in energies[m..].iter_mut().zip(self.order(m)) {
                *energy += multiplicity * a.iter().map(|part| part * part).sum::<f64>();
            }
        }
        Ok(energies)
    }

    /// Mean over the sphere, a_00 / √4π, per channel.
    pub fn mean(&self) -> [f64; 3] {
        let a = self.coefficients[0];
        [a[0], a[2], a[4]].map(|part| part / (4.0 * PI).sqrt())
    }
}

/// Number of (l, m) with 0 ≤ m ≤ l ≤ `band_limit`.
pub const fn coefficient_count(band_limit: usize) -> usize {
    (band_limit + 1) * (band_limit + 2) / 2
}
