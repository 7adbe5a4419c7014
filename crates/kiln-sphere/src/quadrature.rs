//! Gauss–Legendre rules.

use std::f64::consts::PI;

/// Nodes and weights of the `count`-point Gauss–Legendre rule on [−1, 1], nodes ascending.
///
/// Exact for polynomials of degree `2 · count − 1`. Newton's method on P_n from Tricomi's first guess;
/// accurate to a few units in the last place for the counts used here (up to some hundreds).
pub fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.0, 0.0); count];
    for index in 0..count.div_ceil(2) {
        let mut x = libm::cos(PI * (index as f64 + 0.75) / (count as f64 + 0.5));
        for _ in 0..8 {
            let (value, slope) = legendre_and_slope(count, x);
            x -= value / slope;
        }
        if 2 * index + 1 == count {
            x = 0.0;
        }
        let (_, slope) = legendre_and_slope(count, x);
        let weight = 2.0 / ((1.0 - x * x) * slope * slope);
        rule[index] = (-x, weight);
        rule[count - 1 - index] = (x, weight);
    }
    rule
}

/// P_n(x) and its derivative, |x| < 1.
fn legendre_and_slope(degree: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut value) = (0.0, 1.0);
    for l in 0..degree {
        let next = ((2 * l + 1) as f64 * x * value - l as f64 * previous) / (l + 1) as f64;
        (previous, value) = (value, next);
    }
    let slope = degree as f64 * (previous - x * value) / (1.0 - x * x);
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::gauss_legendre;
    use crate::testing::check_within;

    #[test]
    fn gauss_rule_is_exact_to_its_degree_and_no_further() {
        let integrate = |count: usize, power: i32| -> f64 {
            gauss_legendre(count).iter().map(|&(x, weight)| weight * x.powi(power)).sum()
        };
        for count in [1, 2, 3, 8, 16, 33] {
            let degree = 2 * count as i32 - 2;
            check_within("even power", integrate(count, degree), 2.0 / f64::from(degree + 1), 1e-14);
        }
        assert!((integrate(3, 6) - 2.0 / 7.0).abs() > 1e-3, "three points cannot integrate x^6");
    }
}
