//! Low-order spherical harmonics, the smallest form of light.

use crate::analysis::{Analysis, LOW_BAND_LIMIT};
use kiln_sphere::{kernel_lambert, real_harmonics, world_coefficients};

/// Coefficients of a function on the sphere: f(ω) = Σ c_lm Y_lm(ω), real orthonormal basis over world axes.
///
/// | what              | convention                                                                                    |
/// |-------------------|-----------------------------------------------------------------------------------------------|
/// | basis             | ∫ Y_lm² dω = 1, no Condon–Shortley sign, no constants folded into the coefficients             |
/// | first ones        | Y_00 = 0.2821, Y_1,−1 = 0.4886 y, Y_10 = 0.4886 z, Y_11 = 0.4886 x (see [`real_harmonics`])   |
/// | scale             | c_lm = ∫ f Y_lm dω in the function's unit times steradian: constant 1 gives c_00 = √4π = 3.545 |
/// | radiance ([`sh`]) | the function is radiance                                                                      |
/// | [`Self::to_irradiance`] | the function is E/π: a white diffuse surface's radiance; times π for irradiance         |
#[derive(Clone, Debug, PartialEq)]
pub struct ShCoefficients {
    /// Highest degree.
    pub order: usize,
    /// `(order + 1)²` colours, at l(l + 1) + m.
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

    /// Each degree l times `factors[l]`: a convolution with a function of the angle alone (Funk–Hecke).
    ///
    /// # Panics
    /// If there are fewer factors than degrees.
    pub fn scaled_by_degree(&self, factors: &[f64]) -> Self {
        let scale = |(index, c): (usize, &[f64; 3])| c.map(|value| value * factors[usize::isqrt(index)]);
        Self { order: self.order, coefficients: self.coefficients.iter().enumerate().map(scale).collect() }
    }

    /// Radiance into E/π: each degree times Lambert's spectrum 1, 2/3, 1/4, 0, −1/24, 0, 1/64, 0, −1/128.
    ///
    /// Of order 2 a cut-off after 99 % of the energy at least (Ramamoorthi and Hanrahan 2001); a strong sun makes it
    /// negative on the far side, see [`crate::dering`].
    pub fn to_irradiance(&self) -> Self {
        self.scaled_by_degree(&kernel_lambert(self.order).kappa)
    }
}

/// Radiance up to degree `order` (at most 8; more is cut), bright texels included; exact up to rounding.
pub fn sh(analysis: &Analysis, order: usize) -> ShCoefficients {
    let order = order.min(LOW_BAND_LIMIT);
    ShCoefficients { order, coefficients: world_coefficients(&analysis.low, order) }
}

/// E/π up to degree 2, without a window.
pub fn irradiance_sh(analysis: &Analysis) -> ShCoefficients {
    sh(analysis, 2).to_irradiance()
}
