//! Sampled estimators, each beside its WGSL pass in `shaders/bake`: same stem, same names, same steps.
//!
//! With N = V = R the directions of a pass do not depend on the texel but for the frame they stand in. A pass is therefore a
//! list of [`Tap`]s in the normal's frame, and a texel their weighted sum.

pub mod brdf_table;
pub mod irradiance;
pub mod prefilter;
pub mod prefilter_eevee;
pub mod prefilter_jittered;
pub mod prefilter_khronos;
pub mod prefilter_visible;

use std::f64::consts::PI;

use kiln_brdf::sampling::orthonormal_basis;

use crate::source::{Rgb, Source};

/// One lookup of an estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap {
    /// Unit direction in the normal's frame, z the normal.
    pub light: [f64; 3],
    /// Level of the source that is read.
    pub level: f64,
    /// Factor of what is read.
    pub weight: f64,
}

/// Tangent and bitangent of a unit normal.
pub type Basis = fn([f64; 3]) -> [[f64; 3]; 2];

/// A pass made ready for a lobe, a source and a count.
#[derive(Clone, Debug)]
pub struct Taps {
    /// What is read; the weights are divided by what the pass divides by in the end.
    pub taps: Vec<Tap>,
    /// Frame of the directions.
    pub basis: Basis,
    /// Turns the frame of each texel about its normal by this share of a turn times a number from the texel's normal.
    pub jitter: f64,
}

impl Taps {
    /// Taps in Kiln's frame, their weights divided by `divisor`.
    pub(crate) fn new(mut taps: Vec<Tap>, divisor: f64) -> Taps {
        for tap in &mut taps {
            tap.weight /= divisor;
        }
        Taps { taps, basis: orthonormal_basis, jitter: 0.0 }
    }

    /// The same divided by the sum of the weights.
    pub(crate) fn normalised(taps: Vec<Tap>) -> Taps {
        let total = taps.iter().map(|tap| tap.weight).sum::<f64>();
        Taps::new(taps, total.max(1e-30))
    }

    /// What the pass writes to a texel that looks along `normal`; `jitter` in [0, 1) is the texel's number.
    pub fn radiance(&self, source: &Source, normal: [f64; 3], jitter: f64) -> Rgb {
        let [mut tangent, mut bitangent] = (self.basis)(normal);
        if self.jitter > 0.0 {
            let (sin, cos) = libm::sincos(2.0 * PI * self.jitter * jitter);
            let (t, b) = (tangent, bitangent);
            tangent = std::array::from_fn(|i| cos * t[i] + sin * b[i]);
            bitangent = std::array::from_fn(|i| cos * b[i] - sin * t[i]);
        }
        let mut sum = [0.0; 3];
        for Tap { light: [x, y, z], level, weight } in &self.taps {
            let light = std::array::from_fn(|i| x * tangent[i] + y * bitangent[i] + z * normal[i]);
            let radiance = source.sample(light, *level);
            for (sum, value) in sum.iter_mut().zip(radiance) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// Texels read for one texel written.
    pub fn texel_reads(&self, source: &Source) -> u64 {
        self.taps.iter().map(|tap| source.texel_reads(tap.level)).sum()
    }
}

/// The level whose texels are as large as the share of the sphere that one of `count` samples of density `pdf` stands for: twin
/// of `filter_level` in `shaders/bake/source.wgsl`.
pub fn filter_level(face_size: usize, pdf: f64, count: u32, bias: f64) -> f64 {
    level_of_share(face_size, 1.0 / (f64::from(count) * pdf).max(1e-12), bias)
}

/// The level whose texels are as large as `sample_sr`, plus `bias`, at least 0.
pub(crate) fn level_of_share(face_size: usize, sample_sr: f64, bias: f64) -> f64 {
    let texel_sr = 4.0 * PI / (6.0 * (face_size as f64).powi(2));
    (0.5 * libm::log2(sample_sr / texel_sr) + bias).max(0.0)
}

/// The direction that a view along the normal is mirrored to by a half vector.
pub(crate) fn mirrored([x, y, z]: [f64; 3]) -> [f64; 3] {
    [2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0]
}

/// sin²θ of a local direction.
pub(crate) fn sine2([x, y, _]: [f64; 3]) -> f64 {
    x * x + y * y
}

/// Below this α a lobe is a mirror: `ALPHA_MIN` of `shaders/lib/constants.wgsl`.
pub(crate) const MIRROR: f64 = 1e-8;

/// A pass that reads the environment as it is.
pub(crate) fn mirror() -> Taps {
    Taps::normalised(vec![Tap { light: [0.0, 0.0, 1.0], level: 0.0, weight: 1.0 }])
}
