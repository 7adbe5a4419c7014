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
