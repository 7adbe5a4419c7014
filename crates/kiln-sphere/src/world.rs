//! Real spherical harmonics in the basis renderers use: polar axis z, Y_1,−1 ∝ y, Y_10 ∝ z, Y_11 ∝ x.

use crate::harmonics::Harmonics;
use crate::panorama_direction;
use crate::quadrature::gauss_legendre;
use crate::synthesis::evaluate;
use std::f64::consts::PI;

/// Y_lm of a unit direction for all l ≤ `order`, at index l(l + 1) + m; orthonormal, no Condon–Shortley sign.
///
/// Y_00 = 0.2821, Y_1,−1 = 0.4886 y, Y_10 = 0.4886 z, Y_11 = 0.4886 x, Y_20 = 0.3154 (3z² − 1) …
pub fn real_harmonics(direction: [f64; 3], order: usize) -> Vec<f64> {
    let [x, y, z] = direction;
    let mut values = vec![0.0; (order + 1) * (order + 1)];
    // (cosine, sine) = sin^m θ (cos mφ, sin mφ), so that nothing is divided by sin θ at the poles.
    let (mut cosine, mut sine, mut sectoral) = (1.0, 0.0, (0.25 / PI).sqrt());
    for m in 0..=order {
        if m > 0 {
            (cosine, sine) = (x * cosine - y * sine, x * sine + y * cosine);
            sectoral *= ((2 * m + 1) as f64 / (2 * m) as f64).sqrt();
        }
        let (mut previous, mut value, mut a_previous) = (0.0, sectoral, 1.0);
        for l in m..=order {
            if l > m {
                let (ll, mm) = ((l * l) as f64, (m * m) as f64);
                let a = ((4.0 * ll - 1.0) / (ll - mm)).sqrt();
                let next = a * (z * value - previous / a_previous);
                (previous, value, a_previous) = (value, next, a);
            }
            let scale = if m == 0 { 1.0 } else { std::f64::consts::SQRT_2 };
            values[l * (l + 1) + m] = scale * value * cosine;
            if m > 0 {
                values[l * (l + 1) - m] = scale * value * sine;
            }
        }
    }
    values
}

/// Coefficients c_lm = ∫ f Y_lm dω of the harmonics' function in the basis of [`real_harmonics`], l ≤ `order`,
/// per channel; zero above the harmonics' band limit.
///
/// Exact up to rounding: a product of trapezoid (longitude) and Gauss–Legendre (cos θ) rules integrates the
/// product of two functions of degree `order`.
pub fn world_coefficients(harmonics: &Harmonics, order: usize) -> Vec<[f64; 3]> {
    let kappa = vec![1.0; order + 1];
    let longitudes = 2 * order + 2;
    let mut coefficients = vec![[0.0; 3]; (order + 1) * (order + 1)];
    for (cosine, weight) in gauss_legendre(order + 1) {
        let v = libm::acos(cosine) / PI;
        for column in 0..longitudes {
            let direction = panorama_direction(column as f64 / longitudes as f64, v);
            let value = evaluate(harmonics, &kappa, direction);
            let weight = weight * 2.0 * PI / longitudes as f64;
            for (c, basis) in coefficients.iter_mut().zip(real_harmonics(direction, order)) {
                for channel in 0..3 {
                    c[channel] += weight * basis * value[channel];
                }
            }
        }
    }
    coefficients
}
