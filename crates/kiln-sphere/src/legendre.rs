//! Associated Legendre functions P̄_lm(cos θ) of one order m, on blocks of rings, by degree.
//!
//! Normalised so that Y_lm(θ, λ) = P̄_lm(cos θ) e^{imλ} has unit norm on the sphere; no Condon–Shortley sign:
//! P̄_00 = 1/√4π, P̄_11 = √(3/8π) sin θ.

use std::f64::consts::PI;

/// Rings handled side by side.
pub(crate) const LANES: usize = 8;

/// Near the poles P̄_mm underflows although P̄_lm of higher degree matters: values are kept times 2^(120 e)
/// until they have grown to e = 0. Below 2^-120 a value is no part of any sum that f64 could notice.
const SCALE: f64 = (1u128 << 120) as f64;

/// Steps between looks at the scale: each grows a value by less than 2^7, so it stays far below 1/SCALE's inverse,
/// and what a lane adds before the look is below 2^-64.
const STEPS_UNCHECKED: usize = 8;

/// Up to [`LANES`] rings of one hemisphere.
#[derive(Clone, Debug)]
pub(crate) struct RingBlock {
    cos: [f64; LANES],
    sin: [f64; LANES],
}

impl RingBlock {
    /// Rings at polar angles `thetas` (1 to [`LANES`] of them; the last one fills up the block).
    pub(crate) fn new(thetas: &[f64]) -> Self {
        let theta = |lane: usize| thetas[lane.min(thetas.len() - 1)];
        Self {
            cos: std::array::from_fn(|lane| libm::cos(theta(lane))),
            sin: std::array::from_fn(|lane| libm::sin(theta(lane))),
        }
    }

    /// Whether all |P̄_lm| with l ≤ `band_limit` are negligible here (below 1e-20).
    ///
    /// Beyond the turning point m = l sin θ by δ, P̄ falls like exp(−0.94 √(δ³/l)); δ = 14 l^(1/3) gives
    /// exp(−49). Checked by `skipped_blocks_are_negligible`.
    pub(crate) fn is_negligible(&self, m: usize, band_limit: usize) -> bool {
        let widest = self.sin.iter().fold(0.0, |a: f64, &b| a.max(b));
        let l = band_limit as f64;
        m as f64 > l * widest + 14.0 * libm::cbrt(l + 1.0)
    }
}

/// Recurrence over the degree for one order m: P̄_l = a_l x P̄_{l−1} − b_l P̄_{l−2}.
pub(crate) struct Order {
    m: usize,
    /// (a_l, b_l) for l = m + 1, m + 2 …, band limit.
    steps: Vec<[f64; 2]>,
    /// P̄_mm / sin^m θ.
    sectoral: f64,
}

impl Order {
    pub(crate) fn new(m: usize, band_limit: usize) -> Self {
        let mm = (m * m) as f64;
        let a = |l: usize| {
            let ll = (l * l) as f64;
            ((4.0 * ll - 1.0) / (ll - mm)).sqrt()
        };
        let step = |l: usize| if l == m + 1 { [a(l), 0.0] } else { [a(l), a(l) / a(l - 1)] };
        let steps = (m + 1..=band_limit).map(step).collect();
        let product = (1..=m).fold(1.0 / (4.0 * PI), |p, k| p * ((2 * k + 1) as f64 / (2 * k) as f64));
        Self { m, steps, sectoral: product.sqrt() }
    }

    /// Calls `visit(l − m, values)` for l = m …, band limit, leaving out degrees where all lanes vanish.
    #[inline(always)]
    pub(crate) fn for_each_degree(&self, rings: &RingBlock, mut visit: impl FnMut(usize, &[f64; LANES])) {
        let mut value = [0.0; LANES];
        let mut exponent = [0u32; LANES];
        for lane in 0..LANES {
            let (power, e) = scaled_power(rings.sin[lane], self.m);
            (value[lane], exponent[lane]) = (power * self.sectoral, e);
        }
        let mut previous = [0.0; LANES];
        let mut offset = 0;
        while exponent.iter().any(|&e| e > 0) {
            let is_any_live = exponent.contains(&0);
            for _ in 0..STEPS_UNCHECKED {
                if is_any_live {
                    visit(offset, &std::array::from_fn(|i| if exponent[i] == 0 { value[i] } else { 0.0 }));
                }
                let Some(step) = self.steps.get(offset) else { return };
                advance(step, &rings.cos, &mut value, &mut previous);
                offset += 1;
            }
            rescale(&mut value, &mut previous, &mut exponent);
        }
        // In variables that nothing points to: they stay in registers. In memory, written in parts and read whole, they
        // stall each step (measured, more than the arithmetic takes).
        let (mut value, mut previous, x) = (value, previous, rings.cos);
        visit(offset, &value);
        for &[a, b] in &self.steps[offset..] {
            let next = std::array::from_fn(|lane| a * (x[lane] * value[lane]) - b * previous[lane]);
            (previous, value) = (value, next);
            offset += 1;
            visit(offset, &value);
        }
    }
}

/// Degrees of a batch, of both parities in turn.
pub(crate) const BATCH: usize = 16;

impl Order {
    /// Like [`Order::for_each_degree`], [`BATCH`] degrees at a time: `visit(first l − m, values)`, zeros where
    /// nothing is to be added (negligible degrees, degrees beyond the band limit). Products with batches keep
    /// their sums in registers.
    #[inline(always)]
    pub(crate) fn for_each_batch(
        &self,
        rings: &RingBlock,
        mut visit: impl FnMut(usize, &[[f64; LANES]; BATCH]),
    ) {
        let mut batch = [[0.0; LANES]; BATCH];
        let mut is_empty = true;
        self.for_each_degree(
            rings,
            #[inline(always)]
            |offset, values| {
                batch[offset % BATCH] = *values;
                is_empty = false;
                if offset % BATCH == BATCH - 1 {
                    visit(offset + 1 - BATCH, &batch);
                    batch = [[0.0; LANES]; BATCH];
                    is_empty = true;
                }
            },
        );
        if !is_empty {
            visit(self.steps.len() / BATCH * BATCH, &batch);
        }
    }
}

#[inline(always)]
fn advance(&[a, b]: &[f64; 2], x: &[f64; LANES], value: &mut [f64; LANES], previous: &mut [f64; LANES]) {
    for lane in 0..LANES {
        let next = a * (x[lane] * value[lane]) - b * previous[lane];
        previous[lane] = value[lane];
        value[lane] = next;
    }
}

/// Six numbers and two of no meaning, a whole number of vectors.
pub(crate) type Padded = [f64; 8];

/// Fills a coefficient up.
#[inline(always)]
pub(crate) fn pad([a, b, c, d, e, f]: [f64; 6]) -> Padded {
    [a, b, c, d, e, f, 0.0, 0.0]
}

/// The coefficient again.
#[inline(always)]
pub(crate) fn unpad([a, b, c, d, e, f, ..]: Padded) -> [f64; 6] {
    [a, b, c, d, e, f]
}

/// sum + Σ_j factors[j] · rows[j], j ascending.
#[inline(always)]
pub(crate) fn add_products<const N: usize>(
    mut sum: Padded,
    factors: &[f64; N],
    rows: &[Padded; N],
) -> Padded {
    for (&factor, row) in factors.iter().zip(rows) {
        for (sum, value) in sum.iter_mut().zip(row) {
            *sum += factor * value;
        }
    }
    sum
}

fn rescale(value: &mut [f64; LANES], previous: &mut [f64; LANES], exponent: &mut [u32; LANES]) {
    for lane in 0..LANES {
        if exponent[lane] > 0 && value[lane].abs() > 1.0 {
            value[lane] /= SCALE;
            previous[lane] /= SCALE;
            exponent[lane] -= 1;
        }
    }
}

/// (p, e) with `base`^`power` = p / SCALE^e, 0 < base ≤ 1, by repeated squaring.
fn scaled_power(base: f64, mut power: usize) -> (f64, u32) {
    let renormalise = |(p, e): (f64, u32)| if p < 1.0 / SCALE { (p * SCALE, e + 1) } else { (p, e) };
    let (mut square, mut result) = ((base, 0), (1.0, 0));
    while power > 0 {
        if power & 1 == 1 {
            result = renormalise((result.0 * square.0, result.1 + square.1));
        }
        square = renormalise((square.0 * square.0, 2 * square.1));
        power >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::{LANES, Order, RingBlock};
    use crate::testing::check_within;
    use std::f64::consts::PI;

    fn values(m: usize, band_limit: usize, theta: f64) -> Vec<f64> {
        let mut all = vec![0.0; band_limit - m + 1];
        Order::new(m, band_limit).for_each_degree(&RingBlock::new(&[theta]), |k, p| all[k] = p[0]);
        all
    }

    #[test]
    fn low_degrees_match_closed_forms() {
        let theta: f64 = 0.7;
        let (s, c) = theta.sin_cos();
        check_within("P00", values(0, 2, theta)[0], (1.0 / (4.0 * PI)).sqrt(), 1e-15);
        check_within("P20", values(0, 2, theta)[2], (5.0 / (16.0 * PI)).sqrt() * (3.0 * c * c - 1.0), 1e-14);
        check_within("P11", values(1, 2, theta)[0], (3.0 / (8.0 * PI)).sqrt() * s, 1e-15);
        check_within("P21", values(1, 2, theta)[1], (15.0 / (8.0 * PI)).sqrt() * s * c, 1e-15);
        check_within("P22", values(2, 2, theta)[0], (15.0 / (32.0 * PI)).sqrt() * s * s, 1e-15);
    }

    #[test]
    fn addition_theorem_holds_at_high_degree_near_the_pole() {
        let band_limit = 1000;
        for theta in [1e-3, 0.05, 0.4, 1.5] {
            let sum: f64 = (0..=band_limit)
                .map(
                    |m| if m == 0 { 1.0 } else { 2.0 } * values(m, band_limit, theta)[band_limit - m].powi(2),
                )
                .sum();
            check_within("sum over m", sum * 4.0 * PI / (2 * band_limit + 1) as f64, 1.0, 1e-11);
        }
    }

    #[test]
    fn skipped_blocks_are_negligible() {
        let mut skipped = 0;
        for band_limit in [60, 511, 1500] {
            for theta in [1e-4, 0.02, 0.1, 0.5, 1.0] {
                let block = RingBlock::new(&[theta; LANES]);
                let Some(m) = (0..=band_limit).find(|&m| block.is_negligible(m, band_limit)) else {
                    continue;
                };
                let largest = values(m, band_limit, theta).iter().fold(0.0, |a: f64, b| a.max(b.abs()));
                assert!(largest <= 1e-18, "l {band_limit}, theta {theta}, m {m}: {largest}");
                skipped += 1;
            }
        }
        assert!(skipped >= 8, "the criterion must skip something, skipped {skipped}");
    }
}
