//! Sample points and importance sampling, as pairs of `sample_x` and `pdf_x`; twins of `shaders/lib/sampling.wgsl`.
//!
//! Directions are local, z is the normal; densities are per steradian of what the method returns; u lies in [0, 1)².

use crate::lobes::{d_charlie, d_ggx, smith_half};
use std::f64::consts::PI;

/// Van der Corput's sequence in base 2: the bits of `index` mirrored at the binary point (Niederreiter 1992, section 3.1).
///
/// The lowest 8 bits of the mirrored number are dropped, as `f32` could not hold them: exact for indices below 2²⁴.
pub fn radical_inverse(index: u32) -> f64 {
    f64::from(index.reverse_bits() >> 8) / f64::from(1 << 24)
}

/// Point `index` of `count` of Hammersley's set: (index / count, radical inverse) (Hammersley 1960).
pub fn hammersley(index: u32, count: u32) -> [f64; 2] {
    [f64::from(index) / f64::from(count.max(1)), radical_inverse(index)]
}

/// Tangent and bitangent of a unit `normal` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3).
pub fn orthonormal_basis([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}

/// Directions distributed as cos θ / π (Malley's method).
pub fn sample_cosine([turn, u]: [f64; 2]) -> [f64; 3] {
    spherical_direction(u.sqrt(), (1.0 - u).sqrt(), turn)
}

/// Density of [`sample_cosine`].
pub fn pdf_cosine(cos_theta: f64) -> f64 {
    cos_theta.max(0.0) / PI
}

/// Half vectors distributed as D n·h of GGX (Walter et al. 2007, eq. 35).
pub fn sample_ggx([turn, u]: [f64; 2], alpha: f64) -> [f64; 3] {
    let (cosine2, sine2) = (1.0 - u, alpha * alpha * u);
    let length = (cosine2 + sine2).sqrt();
    spherical_direction(sine2.sqrt() / length, cosine2.sqrt() / length, turn)
}

/// Density of [`sample_ggx`].
pub fn pdf_ggx(half: [f64; 3], alpha: f64) -> f64 {
    d_ggx(alpha, sin2(half)) * half[2].max(0.0)
}

/// Half vectors of GGX as a unit `view` with z ≥ 0 sees them (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
/// Spherical Caps", listing 3).
pub fn sample_ggx_visible(view: [f64; 3], [turn, u]: [f64; 2], alpha: f64) -> [f64; 3] {
    let stretched = normalised([alpha * view[0], alpha * view[1], view[2]]);
    let z = (1.0 - u) * (1.0 + stretched[2]) - stretched[2];
    let cap = spherical_direction(((1.0 - z) * (1.0 + z)).max(0.0).sqrt(), z, turn);
    let [x, y, z] = std::array::from_fn(|i| cap[i] + stretched[i]);
    normalised([alpha * x, alpha * y, z.max(0.0)])
}

/// Density of [`sample_ggx_visible`]: G_1(n·v) v·h D / n·v (Heitz 2018, eq. 3).
pub fn pdf_ggx_visible(view: [f64; 3], half: [f64; 3], alpha: f64) -> f64 {
    let v_dot_h: f64 = view.iter().zip(half).map(|(v, h)| v * h).sum();
    2.0 * v_dot_h.max(0.0) / smith_half(alpha, view[2]) * d_ggx(alpha, sin2(half))
}

/// Half vectors distributed as D n·h of Charlie (inverted from Estevez and Kulla 2017, eq. 2).
pub fn sample_charlie([turn, u]: [f64; 2], alpha: f64) -> [f64; 3] {
    // ln sin²θ; the shader's smallest normal f32 stands for 0 here too.
    let ln_sin2 = 2.0 * alpha / (2.0 * alpha + 1.0) * libm::log(u.max(f64::from(f32::MIN_POSITIVE)));
    spherical_direction(libm::exp(0.5 * ln_sin2), (-libm::expm1(ln_sin2)).sqrt(), turn)
}

/// Density of [`sample_charlie`].
pub fn pdf_charlie(half: [f64; 3], alpha: f64) -> f64 {
    d_charlie(alpha, sin2(half).sqrt()) * half[2].max(0.0)
}

/// sin²θ without a difference.
fn sin2([x, y, _]: [f64; 3]) -> f64 {
    x * x + y * y
}

fn spherical_direction(sine: f64, cosine: f64, turn: f64) -> [f64; 3] {
    let (sin_phi, cos_phi) = libm::sincos(2.0 * PI * turn);
    [sine * cos_phi, sine * sin_phi, cosine]
}

fn normalised(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { v.map(|x| x / length) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: u32 = 1 << 14;

    /// Mean of f / pdf over the samples, which is ∫ f over the hemisphere.
    fn integral(
        sample: impl Fn([f64; 2]) -> [f64; 3],
        pdf: impl Fn([f64; 3]) -> f64,
        f: impl Fn([f64; 3]) -> f64,
    ) -> f64 {
        let mean = |sum: f64, u| {
            let direction = sample(u);
            sum + f(direction) / pdf(direction)
        };
        // Half a step away from 0, where some densities are infinite.
        let point = |i| hammersley(i, COUNT).map(|u| u + 0.5 / f64::from(COUNT));
        (0..COUNT).map(point).fold(0.0, mean) / f64::from(COUNT)
    }

    /// A function of all of the direction with a known integral over the hemisphere: z² + x z + 0.1 x² … = 2π/3 · (1 + 0.1).
    fn smooth([x, _, z]: [f64; 3]) -> f64 {
        z * z + x * z + 0.1 * x * x
    }

    const SMOOTH: f64 = 2.0 * PI / 3.0 * 1.1;

    #[test]
    fn samples_follow_their_densities() {
        let view = normalised([0.6, -0.3, 0.5]);
        let alpha = 0.7;
        let cosine = integral(sample_cosine, |d| pdf_cosine(d[2]), smooth);
        let ggx = integral(|u| sample_ggx(u, alpha), |h| pdf_ggx(h, alpha), smooth);
        let charlie = integral(|u| sample_charlie(u, alpha), |h| pdf_charlie(h, alpha), |h| h[2] * smooth(h));
        assert!((cosine / SMOOTH - 1.0).abs() <= 5e-3, "{cosine}");
        assert!((ggx / SMOOTH - 1.0).abs() <= 5e-3, "{ggx}");
        // ∫ z (z² + x z + x²/10) = 2π (1/4 + 1/80).
        let expected = 2.0 * PI * (0.25 + 0.1 / 8.0);
        assert!((charlie / expected - 1.0).abs() <= 5e-3, "{charlie}");
        // Visible normals leave out what is turned away.
        let seen = |h: [f64; 3]| view.iter().zip(h).map(|(v, h)| v * h).sum::<f64>().max(0.0);
        let visible = |alpha| {
            let f = |h| seen(h) * d_ggx(alpha, sin2(h));
            integral(|u| sample_ggx_visible(view, u, 0.7), |h| pdf_ggx_visible(view, h, 0.7), f)
        };
        // ∫ D ⟨v·h⟩ dω = n·v / G_1 (Heitz 2014, eq. 14).
        let projected = 0.5 * smith_half(alpha, view[2]);
        assert!((visible(alpha) / projected - 1.0).abs() <= 1e-9, "{}", visible(alpha));
        assert!((visible(0.6) / projected - 1.0).abs() > 1e-2, "the check sees another α");
        let wrong = integral(|u| sample_ggx(u, alpha), |h| pdf_ggx(h, 0.6), smooth);
        assert!((wrong / SMOOTH - 1.0).abs() > 0.02, "the check sees another density: {wrong}");
    }

    #[test]
    fn basis_is_orthonormal_and_right_handed_at_the_poles_too() {
        for normal in
            [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], normalised([1e-9, 0.0, -1.0]), normalised([1.0, 2.0, -0.1])]
        {
            let [t, b] = orthonormal_basis(normal);
            let cross = [t[1] * b[2] - t[2] * b[1], t[2] * b[0] - t[0] * b[2], t[0] * b[1] - t[1] * b[0]];
            for (actual, expected) in cross.iter().zip(normal) {
                assert!((actual - expected).abs() <= 1e-12, "{normal:?}: {cross:?}");
            }
        }
        assert!(radical_inverse(u32::MAX) < 1.0 && radical_inverse(1) == 0.5 && radical_inverse(6) == 0.375);
    }
}
