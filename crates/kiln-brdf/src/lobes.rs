//! Distribution, visibility and Fresnel terms.

use std::f64::consts::PI;

/// GGX (Trowbridge–Reitz) distribution of half vectors, per steradian; ∫ D n·h dω = 1.
///
/// D = α² / (π (α² cos²θ_h + sin²θ_h)²) from sin²θ_h, not 1 − cos²θ_h: exact for the smallest α (Walter et al.
/// 2007, eq. 33). At α = 0 it is 0 off the peak and NaN on it: a mirror has no density.
pub fn d_ggx(alpha: f64, sin2_theta_h: f64) -> f64 {
    let alpha2 = alpha * alpha;
    let denominator = alpha2 * (1.0 - sin2_theta_h) + sin2_theta_h;
    alpha2 / (PI * denominator * denominator)
}

/// Height-correlated Smith visibility of GGX, G_2 / (4 n·l n·v) (Heitz 2014, "Understanding the Masking-Shadowing
/// Function", eq. 99).
///
/// Infinite only where `n_dot_l` and `n_dot_v` are both 0, or one is and α is.
pub fn v_smith_ggx_correlated(alpha: f64, n_dot_v: f64, n_dot_l: f64) -> f64 {
    0.5 / smith_denominator(alpha, n_dot_v, n_dot_l)
}

/// n·l √(α² + (1 − α²) n·v²) + n·v √(α² + (1 − α²) n·l²).
pub(crate) fn smith_denominator(alpha: f64, n_dot_v: f64, n_dot_l: f64) -> f64 {
    let alpha2 = alpha * alpha;
    let lambda = |cosine: f64| (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt();
    n_dot_l * lambda(n_dot_v) + n_dot_v * lambda(n_dot_l)
}

/// Schlick's Fresnel factor, f0 + (1 − f0)(1 − v·h)⁵ (Schlick 1994).
pub fn f_schlick(f0: f64, v_dot_h: f64) -> f64 {
    f0 + (1.0 - f0) * schlick_weight(v_dot_h)
}

/// (1 − v·h)⁵.
pub(crate) fn schlick_weight(v_dot_h: f64) -> f64 {
    let x = 1.0 - v_dot_h;
    let x2 = x * x;
    x2 * x2 * x
}

/// How a microfacet lobe masks and shadows: the term G of V = G / (4 n·l n·v).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Masking {
    /// Height-correlated Smith (Heitz 2014, eq. 99): what glTF's renderers and Filament use.
    SmithCorrelated,
    /// Separable Smith, G_1(n·l) G_1(n·v) (Walter et al. 2007, eq. 34).
    SmithSeparable,
    /// Schlick's rational G_1 = x / (x (1 − k) + k) with k = α/2: the split-sum table of Karis 2013 and of the tutorials.
    SchlickIbl,
    /// The same with k = (perceptual roughness + 1)²/8, which Karis 2013 gives for lights and not for environments.
    SchlickLights,
}

impl Masking {
    /// All of them.
    pub const ALL: [Self; 4] =
        [Self::SmithCorrelated, Self::SmithSeparable, Self::SchlickIbl, Self::SchlickLights];

    /// V · n·l, finite for α > 0.
    pub fn scattered(self, alpha: f64, n_dot_v: f64, n_dot_l: f64) -> f64 {
        match self {
            // 0/0 where both cosines are 0.
            Self::SmithCorrelated => {
                0.5 * n_dot_l / smith_denominator(alpha, n_dot_v, n_dot_l).max(f64::MIN_POSITIVE)
            }
            Self::SmithSeparable => n_dot_l / (smith_half(alpha, n_dot_v) * smith_half(alpha, n_dot_l)),
            Self::SchlickIbl | Self::SchlickLights => {
                let k = self.schlick_k(alpha);
                0.25 * n_dot_l / (schlick_half(k, n_dot_v) * schlick_half(k, n_dot_l))
            }
        }
    }

    /// G of a mirror (α = 0) seen at `n_dot_v`.
    pub(crate) fn mirror(self, n_dot_v: f64) -> f64 {
        let k = self.schlick_k(0.0);
        let g_1 = if k > 0.0 { n_dot_v / schlick_half(k, n_dot_v) } else { 1.0 };
        g_1 * g_1
    }

    /// 0 for Smith's.
    fn schlick_k(self, alpha: f64) -> f64 {
        match self {
            Self::SmithCorrelated | Self::SmithSeparable => 0.0,
            Self::SchlickIbl => 0.5 * alpha,
            Self::SchlickLights => (alpha.sqrt() + 1.0) * (alpha.sqrt() + 1.0) / 8.0,
        }
    }
}

/// 2x / G_1(x) of Smith's masking for GGX: x + √(α² + (1 − α²) x²).
pub(crate) fn smith_half(alpha: f64, cosine: f64) -> f64 {
    let alpha2 = alpha * alpha;
    cosine + (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt()
}

/// x / G_1(x) of Schlick's masking.
fn schlick_half(k: f64, cosine: f64) -> f64 {
    cosine * (1.0 - k) + k
}

/// Charlie distribution of half vectors, (2 + 1/α) sin^(1/α) θ_h / 2π (Estevez and Kulla 2017, "Production Friendly
/// Microfacet Sheen BRDF", eq. 2), 0 < α ≤ 1; underflows to 0 near the normal for small α.
pub fn d_charlie(alpha: f64, sin_theta_h: f64) -> f64 {
    (2.0 + 1.0 / alpha) * libm::pow(sin_theta_h, 1.0 / alpha) / (2.0 * PI)
}

/// Ashikhmin's visibility for sheen, 1 / (4 (n·l + n·v − n·l n·v)) (Neubelt and Pettineo 2013); exceeds 1 at grazing
/// angles, which some renderers clamp.
pub fn v_ashikhmin(n_dot_v: f64, n_dot_l: f64) -> f64 {
    1.0 / (4.0 * (n_dot_l + n_dot_v - n_dot_l * n_dot_v))
}

#[cfg(test)]
mod tests {
    use super::{d_ggx, f_schlick, v_ashikhmin, v_smith_ggx_correlated};

    #[test]
    fn closed_forms_at_known_points() {
        assert!((d_ggx(1.0, 0.3) - 1.0 / std::f64::consts::PI).abs() <= 1e-15);
        assert!((v_smith_ggx_correlated(0.3, 1.0, 1.0) - 0.25).abs() <= 1e-15);
        assert!((v_ashikhmin(1.0, 1.0) - 0.25).abs() <= 1e-15);
        assert!((f_schlick(0.04, 1.0) - 0.04).abs() <= 1e-15);
        assert!((f_schlick(0.04, 0.0) - 1.0).abs() <= 1e-15);
    }

    #[test]
    fn distribution_keeps_its_digits_at_small_alpha() {
        // α = 1e-6 at θ_h = α: D = 1 / (4π α²) to second order; 1 − cos² would be rounding noise there.
        let (alpha, sin2) = (1e-6, 1e-12);
        let exact = 1.0 / (4.0 * std::f64::consts::PI * alpha * alpha);
        assert!((d_ggx(alpha, sin2) / exact - 1.0).abs() <= 1e-11);
        let cosine = (1.0f64 - sin2).sqrt();
        assert!(
            (d_ggx(alpha, 1.0 - cosine * cosine) / exact - 1.0).abs() > 1e-6,
            "the naive form loses them"
        );
    }
}
