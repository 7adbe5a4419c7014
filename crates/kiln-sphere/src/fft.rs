//! FFTs of four signals side by side, so that vector units help and every machine gets the same bits.
//!
//! A vectorised FFT of one signal adds in an order that depends on the vector's width. Here each lane is a signal of its
//! own, and its sums have one order everywhere: mixed radix 4, 2, 3, 5 without reordering (Stockham's method, as in Van
//! Loan 1992, "Computational Frameworks for the Fast Fourier Transform", section 1.7). Lengths with other factors go to
//! rustfft's scalar plan, signal by signal.

use crate::simd;
use rustfft::{Fft, FftPlannerScalar, num_complex::Complex};
use std::ops::{Add, Mul, Sub};
use std::sync::Arc;

pub(crate) type C64 = Complex<f64>;

/// Signals of a batch.
pub(crate) const SIGNALS: usize = 4;

/// One complex number of each signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Batch {
    pub(crate) re: [f64; SIGNALS],
    pub(crate) im: [f64; SIGNALS],
}

impl Batch {
    #[inline(always)]
    pub(crate) fn get(&self, signal: usize) -> C64 {
        C64::new(self.re[signal], self.im[signal])
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, signal: usize, value: C64) {
        (self.re[signal], self.im[signal]) = (value.re, value.im);
    }

    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        Self { re: self.re.map(|x| x * factor), im: self.im.map(|x| x * factor) }
    }

    /// Times i.
    #[inline(always)]
    fn turn(self) -> Self {
        Self { re: self.im.map(|x| -x), im: self.re }
    }
}

impl Add for Batch {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            re: std::array::from_fn(|i| self.re[i] + other.re[i]),
            im: std::array::from_fn(|i| self.im[i] + other.im[i]),
        }
    }
}

impl Sub for Batch {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            re: std::array::from_fn(|i| self.re[i] - other.re[i]),
            im: std::array::from_fn(|i| self.im[i] - other.im[i]),
        }
    }
}

/// All signals times one complex number.
impl Mul<C64> for Batch {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: C64) -> Self {
        Self {
            re: std::array::from_fn(|i| self.re[i] * factor.re - self.im[i] * factor.im),
            im: std::array::from_fn(|i| self.re[i] * factor.im + self.im[i] * factor.re),
        }
    }
}

/// Both directions of one length, unnormalised.
#[derive(Clone)]
pub(crate) struct Plan {
    length: usize,
    kind: Kind,
}

#[derive(Clone)]
enum Kind {
    /// Stages in order.
    Smooth(Arc<[Stage]>),
    Library {
        forward: Arc<dyn Fft<f64>>,
        inverse: Arc<dyn Fft<f64>>,
    },
}

/// One pass of Stockham's method.
struct Stage {
    radix: usize,
    /// e^{−2πi p k/n} for k = 1 … radix − 1, p by p; n is what is left of the length.
    twiddles: Vec<C64>,
}

impl Plan {
    pub(crate) fn new(length: usize) -> Self {
        let kind = match radices(length) {
            Some(radices) => Kind::Smooth(stages(length, &radices)),
            None => {
                let mut planner = FftPlannerScalar::new();
                let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
                Kind::Library { forward, inverse }
            }
        };
        Self { length, kind }
    }

    /// Σ_j x_j e^{−2πijk/n}, in place; `room` is overwritten.
    pub(crate) fn forward(&self, data: &mut Vec<Batch>, room: &mut Vec<Batch>) {
        self.transform::<false>(data, room);
    }

    /// Σ_j x_j e^{+2πijk/n}, in place; `room` is overwritten.
    pub(crate) fn inverse(&self, data: &mut Vec<Batch>, room: &mut Vec<Batch>) {
        self.transform::<true>(data, room);
    }

    fn transform<const INVERSE: bool>(&self, data: &mut Vec<Batch>, room: &mut Vec<Batch>) {
        assert_eq!(data.len(), self.length, "a plan fits one length");
        match &self.kind {
            Kind::Smooth(stages) => {
                room.resize(self.length, Batch::default());
                let mut stride = 1;
                for stage in stages.iter() {
                    simd::dispatch(
                        #[inline(always)]
                        || stage.run::<INVERSE>(stride, data, room),
                    );
                    stride *= stage.radix;
                    std::mem::swap(data, room);
                }
            }
            Kind::Library { forward, inverse } => {
                let plan = if INVERSE { inverse } else { forward };
                for signal in 0..SIGNALS {
                    let mut values: Vec<C64> = data.iter().map(|batch| batch.get(signal)).collect();
                    plan.process(&mut values);
                    data.iter_mut().zip(values).for_each(|(batch, value)| batch.set(signal, value));
                }
            }
        }
    }
}

/// Factors of a length that has no others: fours first, then a two, threes and fives.
fn radices(mut length: usize) -> Option<Vec<usize>> {
    let mut radices = Vec::new();
    for radix in [4, 2, 3, 5] {
        while length.is_multiple_of(radix) {
            length /= radix;
            radices.push(radix);
        }
    }
    (length == 1).then_some(radices)
}

fn stages(length: usize, radices: &[usize]) -> Arc<[Stage]> {
    let mut left = length;
    let stage = |&radix: &usize| {
        let n = left;
        left /= radix;
        let angle = |p: usize, k: usize| -2.0 * std::f64::consts::PI * (p * k) as f64 / n as f64;
        let twiddles = (0..left).flat_map(|p| (1..radix).map(move |k| cis(angle(p, k)))).collect();
        Stage { radix, twiddles }
    };
    radices.iter().map(stage).collect()
}

impl Stage {
    #[inline(always)]
    fn run<const INVERSE: bool>(&self, stride: usize, from: &[Batch], to: &mut [Batch]) {
        match self.radix {
            4 => self.pass::<4, INVERSE>(stride, from, to, butterfly4::<INVERSE>),
            2 => self.pass::<2, INVERSE>(stride, from, to, |[a, b]| [a + b, a - b]),
            3 => self.pass::<3, INVERSE>(stride, from, to, butterfly3::<INVERSE>),
            _ => self.pass::<5, INVERSE>(stride, from, to, butterfly5::<INVERSE>),
        }
    }

    #[inline(always)]
    fn pass<const R: usize, const INVERSE: bool>(
        &self,
        stride: usize,
        from: &[Batch],
        to: &mut [Batch],
        butterfly: impl Fn([Batch; R]) -> [Batch; R],
    ) {
        let count = from.len() / R;
        for (p, to) in to.chunks_exact_mut(stride * R).enumerate() {
            let twiddles = &self.twiddles[p * (R - 1)..(p + 1) * (R - 1)];
            for q in 0..stride {
                let mut values = butterfly(std::array::from_fn(|k| from[q + p * stride + k * count]));
                for (value, twiddle) in values[1..].iter_mut().zip(twiddles) {
                    *value = *value * if INVERSE { twiddle.conj() } else { *twiddle };
                }
                for (k, value) in values.into_iter().enumerate() {
                    to[q + k * stride] = value;
                }
            }
        }
    }
}

#[inline(always)]
fn butterfly3<const INVERSE: bool>([a, b, c]: [Batch; 3]) -> [Batch; 3] {
    const SIN: f64 = 0.866_025_403_784_438_6;
    let (sum, difference) = (b + c, (b - c).scale(if INVERSE { SIN } else { -SIN }).turn());
    let middle = a - sum.scale(0.5);
    [a + sum, middle + difference, middle - difference]
}

#[inline(always)]
fn butterfly4<const INVERSE: bool>([a, b, c, d]: [Batch; 4]) -> [Batch; 4] {
    let (even, odd) = (a + c, b + d);
    let turned = (b - d).turn();
    let (x, y) = (a - c, if INVERSE { turned } else { turned.scale(-1.0) });
    [even + odd, x + y, even - odd, x - y]
}

#[inline(always)]
fn butterfly5<const INVERSE: bool>([a, b, c, d, e]: [Batch; 5]) -> [Batch; 5] {
    // cos and sin of 72° and 144°.
    const COS: [f64; 2] = [0.309_016_994_374_947_45, -0.809_016_994_374_947_5];
    const SIN: [f64; 2] = [0.951_056_516_295_153_5, 0.587_785_252_292_473_1];
    let sign = if INVERSE { 1.0 } else { -1.0 };
    let (be, cd) = (b + e, c + d);
    let (be_d, cd_d) = ((b - e).scale(sign), (c - d).scale(sign));
    let first = a + be.scale(COS[0]) + cd.scale(COS[1]);
    let second = a + be.scale(COS[1]) + cd.scale(COS[0]);
    let first_turn = (be_d.scale(SIN[0]) + cd_d.scale(SIN[1])).turn();
    let second_turn = (be_d.scale(SIN[1]) - cd_d.scale(SIN[0])).turn();
    [a + be + cd, first + first_turn, second + second_turn, second - second_turn, first - first_turn]
}

/// Smallest even 2^a 3^b 5^c that is at least `minimum`.
pub(crate) fn even_fft_length(minimum: usize) -> usize {
    let mut length = minimum.max(2).next_multiple_of(2);
    while radices(length).is_none() {
        length += 2;
    }
    length
}

/// sin(πx) / (πx).
pub(crate) fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    if y.abs() < 1e-4 { 1.0 - y * y / 6.0 } else { libm::sin(y) / y }
}

/// e^{i · angle}.
pub(crate) fn cis(angle: f64) -> C64 {
    let (sin, cos) = libm::sincos(angle);
    C64::new(cos, sin)
}

/// Position of frequency `k` in a transform of `length`.
pub(crate) fn bin(k: isize, length: usize) -> usize {
    let period = length as isize;
    match k {
        0.. if k < period => k as usize,
        // Almost always: a division here would cost as much as the transform.
        ..0 if k >= -period => (k + period) as usize,
        _ => k.rem_euclid(period) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::{Batch, C64, Plan, SIGNALS, cis};
    use crate::testing::uniform;
    use std::f64::consts::PI;

    fn signals(length: usize) -> Vec<Batch> {
        let mut random = uniform(length as u64);
        let mut four = || std::array::from_fn(|_| random() - 0.5);
        (0..length).map(|_| Batch { re: four(), im: four() }).collect()
    }

    /// Largest difference from the sum itself, over all signals; the sum's sign is `sign`.
    fn worst(length: usize, is_inverse: bool, sign: f64) -> f64 {
        let data = signals(length);
        let mut found = data.clone();
        let plan = Plan::new(length);
        match is_inverse {
            true => plan.inverse(&mut found, &mut Vec::new()),
            false => plan.forward(&mut found, &mut Vec::new()),
        }
        let mut worst: f64 = 0.0;
        for (k, found) in found.iter().enumerate() {
            for signal in 0..SIGNALS {
                let term = |(j, batch): (usize, &Batch)| {
                    batch.get(signal) * cis(sign * 2.0 * PI * (j * k % length) as f64 / length as f64)
                };
                let exact: C64 = data.iter().enumerate().map(term).sum();
                worst = worst.max((found.get(signal) - exact).norm());
            }
        }
        worst
    }

    #[test]
    fn every_kind_of_length_matches_the_sum() {
        for length in [1, 2, 3, 4, 5, 6, 8, 12, 15, 16, 20, 30, 60, 64, 100, 128, 7, 22, 97] {
            for (is_inverse, sign) in [(false, -1.0), (true, 1.0)] {
                let worst = worst(length, is_inverse, sign);
                assert!(worst <= 1e-13 * (length as f64 + 10.0), "{length}, inverse {is_inverse}: {worst}");
            }
        }
    }

    #[test]
    fn sum_check_rejects_the_other_direction() {
        assert!(worst(12, false, 1.0) > 1e-3);
    }
}
