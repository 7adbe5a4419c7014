//! Low-order spherical harmonics, the smallest form of diffuse light.

use crate::analysis::{Analysis, LOW_BAND_LIMIT};
use kiln_sphere::{kernel_lambert, real_harmonics, world_coefficients};

/// Coefficients of a function on the sphere: f(ω) = Σ c_lm Y_lm(ω), real orthonormal basis over world axes.
///
/// Y_00 = 0.2821, Y_1,−1 = 0.4886 y, Y_10 = 0.4886 z, Y_11 = 0.4886 x … (see [`kiln_sphere::real_harmonics`]).
#[derive(Clone, Debug, PartialEq)]
pub struct ShCoefficients {
    /// Highest degree.
    pub order: usize,
    /// `(order + 1)²` colours, at l(l + 1) + m; c_lm = ∫ f Y_lm dω, in radiance · sr (constant 1 gives c_00 = √4π).
    pub coefficients: Vec<[f64; 3]>,
}

impl ShCoefficients {
    /// The function in a unit direction.
    pub fn evaluate(&self, direction: [f64; 3]) -> [f64; 3] {
        let mut value = [0.0; 3];
        for (c, basis) in self.coefficients.iter().zip(real_harmonics(direction, self.order)) {
            for channel in 0..3 {
                value[channel] += c[channel] * basis;
            }
        }
        value
    }
}

/// Radiance up to degree `order` (at most 8; more is cut), bright texels included; exact up to rounding.
pub fn sh(analysis: &Analysis, order: usize) -> ShCoefficients {
    let order = order.min(LOW_BAND_LIMIT);
    ShCoefficients { order, coefficients: world_coefficients(&analysis.low, order) }
}

/// E/π up to degree 2: radiance times Lambert's spectrum 1, 2/3, 1/4. No windowing, so a strong sun can make it
/// negative on the far side (Ramamoorthi and Hanrahan 2001 bound the error of order 2).
pub fn irradiance_sh(analysis: &Analysis) -> ShCoefficients {
    let mut sh = sh(analysis, 2);
    let kappa = kernel_lambert(2).kappa;
    for (index, c) in sh.coefficients.iter_mut().enumerate() {
        let l = index.isqrt();
        *c = c.map(|value| value * kappa[l]);
    }
    sh
}
