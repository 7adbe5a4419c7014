//! Spherical harmonics as engines evaluate them.
//!
//! All take radiance coefficients of the real orthonormal basis (degree 2 at least) and are exact up to rounding.

use std::f64::consts::PI;

/// E/π over radiance, per degree: Lambert's spectrum (Ramamoorthi and Hanrahan 2001, Â_l/π).
const LAMBERT: [f64; 3] = [1.0, 2.0 / 3.0, 0.25];

/// Factors of Filament's polynomials: Y_lm = factor · polynomial.
fn basis_factors() -> [f64; 9] {
    let half = 0.5 / PI.sqrt();
    let (one, two) = (3.0_f64.sqrt() * half, 15.0_f64.sqrt() * half);
    let zonal = 5.0_f64.sqrt() * half / 2.0;
    [half, one, one, one, two, two, zonal, two, two / 2.0]
}

/// The nine coefficients of Filament's `sh` metadata: E/π pre-scaled so that the shader only evaluates polynomials
///
/// ```text
/// E/π = c0 + c1 y + c2 z + c3 x + c4 xy + c5 yz + c6 (3z² − 1) + c7 zx + c8 (x² − y²)
/// ```
///
/// Source: google/filament, libs/ibl/src/CubemapSH.cpp (`computeIrradianceSH3Bands`, `renderPreScaledSH3Bands`): a
/// constant environment of 1 gives c0 = 1.
///
/// # Panics
/// Below nine coefficients.
pub fn filament(radiance: &[[f64; 3]]) -> [[f64; 3]; 9] {
    let factors = basis_factors();
    std::array::from_fn(|index| radiance[index].map(|c| c * LAMBERT[index.isqrt()] * factors[index]))
}

/// The 27 numbers of three.js' `SphericalHarmonics3.fromArray`: radiance as it is, r g b of each coefficient. The
/// shader applies the cosine lobe and yields E, which its Lambert BRDF divides by π.
///
/// Source: mrdoob/three.js, src/renderers/shaders/ShaderChunk/lights_pars_begin.glsl.js (`shGetIrradianceAt`) and
/// src/math/SphericalHarmonics3.js (`getBasisAt`).
///
/// # Panics
/// Below nine coefficients.
pub fn three(radiance: &[[f64; 3]]) -> Vec<f64> {
    radiance[..9].as_flattened().to_vec()
}
