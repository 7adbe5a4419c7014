//! The lobes that environments are prefiltered with, as functions of the angle.

use crate::cancel::{Cancel, Cancelled};
use crate::kernel::{Kernel, kernel_charlie, kernel_ggx, kernel_lambert};
use std::f64::consts::PI;

/// A BRDF part whose prefiltered map (N = V = R) is a convolution. α is perceptual roughness², in (0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lobe {
    /// max(cos θ, 0)/π: the map is E/π.
    Lambert,
    /// Trowbridge–Reitz.
    Ggx {
        /// Width.
        alpha: f64,
    },
    /// Sheen of Estevez and Kulla 2017.
    Charlie {
        /// Width; small α is a rim seen from the side.
        alpha: f64,
    },
}

impl Lobe {
    /// Its spectrum up to `band_limit`.
    ///
    /// # Errors
    /// [`Cancelled`] within the work of a few nodes.
    pub fn kernel(self, band_limit: usize, cancel: Cancel) -> Result<Kernel, Cancelled> {
        match self {
            Lobe::Lambert => Ok(kernel_lambert(band_limit)),
            Lobe::Ggx { alpha } => kernel_ggx(alpha, band_limit, cancel),
            Lobe::Charlie { alpha } => kernel_charlie(alpha, band_limit, cancel),
        }
    }

    /// Its kernel over the angle, given the spectrum's `ln_norm`.
    pub fn profile(self, ln_norm: f64) -> Profile {
        match self {
            // GGX of α = 1 is Lambert, but for the norm that its ln_norm holds.
            Lobe::Lambert => Profile::Ggx(GgxProfile::new(1.0, ln_norm)),
            Lobe::Ggx { alpha } => Profile::Ggx(GgxProfile::new(alpha, ln_norm)),
            Lobe::Charlie { alpha } => Profile::Charlie(CharlieProfile::new(alpha, ln_norm)),
        }
    }
}

/// A kernel K(θ), normalised to ∫ K dω = 1, per steradian.
pub trait ZonalKernel: Copy + Send + Sync {
    /// K at 1 − cos θ without its factor max(cos θ, 0): smooth across the horizon.
    fn distribution_at(&self, one_minus_x: f64) -> f64;

    /// Squared angle over which K varies, seen at a squared chord from the axis.
    fn scale2(&self, chord2: f64) -> f64;

    /// Whether K up to that squared chord is no part of any sum: how it varies there does not matter.
    #[inline(always)]
    fn is_negligible(&self, _chord2: f64) -> bool {
        false
    }

    /// K at 1 − cos θ.
    #[inline(always)]
    fn at(&self, one_minus_x: f64) -> f64 {
        self.distribution_at(one_minus_x) * (1.0 - one_minus_x).max(0.0)
    }
}

/// The kernel of any lobe. Where many values are needed, match it once and go on with what it holds.
#[derive(Clone, Copy, Debug)]
pub enum Profile {
    /// GGX and Lambert.
    Ggx(GgxProfile),
    /// Charlie.
    Charlie(CharlieProfile),
}

/// α² / (π (α² cos²θ_h + sin²θ_h)²), as [`crate::ggx_kernel_at`] has it.
#[derive(Clone, Copy, Debug)]
pub struct GgxProfile {
    alpha2: f64,
    /// α²/π over the norm.
    factor: f64,
}

impl GgxProfile {
    fn new(alpha: f64, ln_norm: f64) -> Self {
        let alpha2 = alpha * alpha;
        Self { alpha2, factor: alpha2 / PI * libm::exp(-ln_norm) }
    }
}

/// ln 1e-18: what a sun of 1e7 makes of it no sum can notice.
const NEGLIGIBLE_LN: f64 = -41.446_531_673_892_82;

/// (2 + 1/α) sin(θ_h)^(1/α) / 2π in logarithms.
#[derive(Clone, Copy, Debug)]
pub struct CharlieProfile {
    alpha: f64,
    ln_scale: f64,
    /// Squared chord up to which K is below 1e-18 of what it is at the horizon.
    negligible_chord2: f64,
}

impl CharlieProfile {
    fn new(alpha: f64, ln_norm: f64) -> Self {
        let ln_scale = libm::log((2.0 + 1.0 / alpha) / (2.0 * PI)) - ln_norm;
        let negligible_chord2 = 2.0 * libm::exp(2.0 * alpha * NEGLIGIBLE_LN);
        Self { alpha, ln_scale, negligible_chord2 }
    }
}

impl ZonalKernel for GgxProfile {
    #[inline(always)]
    fn distribution_at(&self, one_minus_x: f64) -> f64 {
        let sin2 = 0.5 * one_minus_x;
        let denominator = self.alpha2 * (1.0 - sin2) + sin2;
        self.factor / (denominator * denominator)
    }

    /// The distance to the nearest pole in the complex plane: α² (1 − s) + s = 0 with s = chord²/4 lies at chord ≈ ±2iα.
    #[inline(always)]
    fn scale2(&self, chord2: f64) -> f64 {
        chord2 + 4.0 * self.alpha2
    }
}

impl ZonalKernel for CharlieProfile {
    #[inline(always)]
    fn distribution_at(&self, one_minus_x: f64) -> f64 {
        let sin2 = 0.5 * one_minus_x;
        if sin2 > 0.0 { libm::exp(self.ln_scale + 0.5 / self.alpha * libm::log(sin2)) } else { 0.0 }
    }

    /// Twice the e-folding length of a power of the chord; near the axis, where it has no weight, no less than 0.02.
    #[inline(always)]
    fn scale2(&self, chord2: f64) -> f64 {
        4.0 * self.alpha * self.alpha * (chord2 + 4e-4)
    }

    #[inline(always)]
    fn is_negligible(&self, chord2: f64) -> bool {
        chord2 < self.negligible_chord2
    }
}

impl ZonalKernel for Profile {
    #[inline]
    fn distribution_at(&self, one_minus_x: f64) -> f64 {
        match self {
            Profile::Ggx(kernel) => kernel.distribution_at(one_minus_x),
            Profile::Charlie(kernel) => kernel.distribution_at(one_minus_x),
        }
    }

    #[inline]
    fn scale2(&self, chord2: f64) -> f64 {
        match self {
            Profile::Ggx(kernel) => kernel.scale2(chord2),
            Profile::Charlie(kernel) => kernel.scale2(chord2),
        }
    }

    #[inline]
    fn is_negligible(&self, chord2: f64) -> bool {
        match self {
            Profile::Ggx(kernel) => kernel.is_negligible(chord2),
            Profile::Charlie(kernel) => kernel.is_negligible(chord2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Lobe, ZonalKernel as _};
    use crate::cancel::Cancel;
    use crate::quadrature::gauss_legendre;
    use std::f64::consts::PI;

    const LOBES: [Lobe; 6] = [
        Lobe::Lambert,
        Lobe::Ggx { alpha: 1.0 / 64.0 },
        Lobe::Ggx { alpha: 0.5 },
        Lobe::Charlie { alpha: 1.0 },
        Lobe::Charlie { alpha: 0.0625 },
        Lobe::Charlie { alpha: 0.001 },
    ];

    /// 2π ∫ K P_1 dx by panels that halve towards the lobe and the horizon.
    fn first_moments(lobe: Lobe, ln_norm: f64) -> [f64; 2] {
        let profile = lobe.profile(ln_norm);
        let rule = gauss_legendre(20);
        let mut edges: Vec<f64> = (0..40).map(|i| libm::exp2(-f64::from(i))).collect();
        edges.extend((1..40).map(|i| 1.0 - libm::exp2(-f64::from(i))));
        edges.extend([0.0, 1.0]);
        edges.sort_by(f64::total_cmp);
        let mut sums = [0.0; 2];
        for edge in edges.windows(2) {
            let half = 0.5 * (edge[1] - edge[0]);
            for &(y, weight) in &rule {
                let one_minus_x = edge[0] + half * (1.0 + y);
                let mass = 2.0 * PI * weight * half * profile.at(one_minus_x);
                sums[0] += mass;
                sums[1] += mass * (1.0 - one_minus_x);
            }
        }
        sums
    }

    #[test]
    fn profile_has_unit_mass_and_the_spectrum_s_first_moment() {
        for lobe in LOBES {
            let kernel = lobe.kernel(1, Cancel::NEVER).expect("nobody cancels");
            let [mass, mean] = first_moments(lobe, kernel.ln_norm);
            assert!((mass - 1.0).abs() <= 1e-10, "{lobe:?}: mass {mass}");
            assert!((mean - kernel.kappa[1]).abs() <= 1e-10, "{lobe:?}: {mean} for {}", kernel.kappa[1]);
        }
    }

    #[test]
    fn moment_check_rejects_another_alpha() {
        let kernel = Lobe::Ggx { alpha: 0.5 }.kernel(1, Cancel::NEVER).expect("nobody cancels");
        let [mass, _] = first_moments(Lobe::Ggx { alpha: 0.501 }, kernel.ln_norm);
        assert!((mass - 1.0).abs() > 1e-5);
    }
}
