//! Time–error curves: an estimator over its knob.

use kiln_image::{Cancel, Cancelled, Cube, Panorama};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::chain::Level;
use crate::estimator::{Estimator, Knob, convolve};
use crate::norms::ErrorNorms;
use crate::source::Source;
use crate::truth::{Truth, texel_centre};
use crate::work::Work;
use crate::{Stopwatch, passes::Taps};

/// What curves are measured on.
pub struct Bench<'a> {
    /// The environment.
    pub panorama: &'a Panorama,
    /// The same as sampled estimators read it.
    pub source: &'a Source,
    /// Exact values of the levels of a chain.
    pub truths: &'a [Truth],
    /// Measures seconds.
    pub watch: &'a dyn Stopwatch,
}

/// One setting of an estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The setting.
    pub knob: f64,
    /// Of the chain: root of the mean square over its levels, the largest of the rest.
    pub error: ErrorNorms,
    /// Of each level.
    pub levels: Vec<ErrorNorms>,
    /// What the whole chain takes on one core. Sampled estimators are timed on some texels of each level.
    pub seconds: f64,
    /// What the whole chain takes, counted.
    pub work: Work,
}

/// An estimator over its knob, cheapest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Whose curve it is.
    pub estimator: Estimator,
    /// What was turned.
    pub knob: Knob,
    /// At least six.
    pub points: Vec<Point>,
}

/// What a curve expects of an error that was not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// Setting.
    pub knob: f64,
    /// Counted floating-point operations.
    pub flops: f64,
    /// Seconds on one core.
    pub seconds: f64,
}

impl Curve {
    /// What an RMS error of the chain will take, on straight lines between the measured points in logarithms; beyond the best
    /// point `None`, and looser than the loosest what that one takes.
    pub fn predict(&self, error: f64) -> Option<Predicted> {
        let of = |point: &Point| Predicted {
            knob: point.knob,
            flops: point.work.flops as f64,
            seconds: point.seconds,
        };
        let reached = self.points.iter().position(|point| point.error.rms <= error)?;
        let high = &self.points[reached];
        let Some(low) = reached.checked_sub(1).map(|before| &self.points[before]) else {
            return Some(of(high));
        };
        let ratio = |from: f64, to: f64, by: f64| {
            (libm::log(by) - libm::log(from)) / (libm::log(to) - libm::log(from))
        };
        let share = ratio(low.error.rms, high.error.rms.max(1e-12), error).clamp(0.0, 1.0);
        let between = |a: f64, b: f64| {
            libm::exp(libm::log(a.max(1e-12)) * (1.0 - share) + libm::log(b.max(1e-12)) * share)
        };
        let (low, high) = (of(low), of(high));
        Some(Predicted {
            knob: between(low.knob, high.knob),
            flops: between(low.flops, high.flops),
            seconds: between(low.seconds, high.seconds),
        })
    }
}

/// Lookups that a level's timing takes at least, some milliseconds of them.
const TIMED_LOOKUPS: usize = 40_000;

impl Bench<'_> {
    /// Measures an estimator at the knobs given; knobs must go from cheap to dear.
    ///
    /// # Errors
    /// [`Cancelled`] soon after it is asked for.
    pub fn curve(&self, estimator: Estimator, knobs: &[f64], cancel: Cancel) -> Result<Curve, Cancelled> {
        let point = |&knob: &f64| match estimator {
            Estimator::Convolution => self.convolved(knob, cancel),
            _ => self.sampled(estimator, knob, cancel),
        };
        let points = knobs.iter().map(point).collect::<Result<_, _>>()?;
        Ok(Curve { estimator, knob: estimator.knob(), points })
    }

    fn convolved(&self, error: f64, cancel: Cancel) -> Result<Point, Cancelled> {
        let levels: Vec<Level> = self.truths.iter().map(|truth| truth.level).collect();
        let mut made = Err(Cancelled);
        let seconds = self.watch.seconds(&mut || made = convolve(self.panorama, &levels, error, cancel));
        let (maps, work) = made?;
        let errors: Vec<ErrorNorms> =
            self.truths.iter().zip(&maps).map(|(truth, map)| truth.compare_map(&map.cube)).collect();
        Ok(Point { knob: error, error: ErrorNorms::of_chain(&errors), levels: errors, seconds, work })
    }

    fn sampled(&self, estimator: Estimator, knob: f64, cancel: Cancel) -> Result<Point, Cancelled> {
        let (mut work, mut seconds, mut errors) = (Work::default(), 0.0, Vec::new());
        for truth in self.truths {
            cancel.check()?;
            let level = &truth.level;
            let Some(taps) = estimator.taps(level, self.source.face_size(), knob) else { continue };
            let values = truth.sample(&taps, self.source, |normal| estimator.jitter(normal), cancel)?;
            errors.push(truth.compare(&values));
            let reads = taps.texel_reads(self.source);
            work = work.plus(Work::of_samples(level.texels(), taps.taps.len(), reads));
            seconds += self.timed(estimator, &taps, level, cancel)?;
        }
        Ok(Point { knob, error: ErrorNorms::of_chain(&errors), levels: errors, seconds, work })
    }

    /// Seconds of a whole level, from texels spread evenly over it; the lesser of two runs.
    fn timed(
        &self,
        estimator: Estimator,
        taps: &Taps,
        level: &Level,
        cancel: Cancel,
    ) -> Result<f64, Cancelled> {
        let all = level.texels();
        let wanted = (TIMED_LOOKUPS / taps.taps.len().max(1)).clamp(2, all);
        let texels: Vec<usize> = (0..wanted).map(|index| index * all / wanted).collect();
        let mut least = f64::INFINITY;
        for _ in 0..2 {
            cancel.check()?;
            let mut sum = 0.0;
            let seconds = self.watch.seconds(&mut || {
                for &texel in &texels {
                    let normal = texel_centre(level.face_size, texel);
                    sum += taps.radiance(self.source, normal, estimator.jitter(normal))[0];
                }
            });
            // The sum is looked at, so the work is not left out.
            least = least.min(if sum.is_nan() { f64::NAN } else { seconds });
        }
        Ok(least * all as f64 / wanted as f64)
    }
}

/// A whole map by a sampled estimator, `None` where it does not estimate the lobe.
///
/// # Errors
/// [`Cancelled`] within a texel.
pub fn sampled_map(
    estimator: Estimator,
    source: &Source,
    level: &Level,
    knob: f64,
    cancel: Cancel,
) -> Result<Option<Cube>, Cancelled> {
    let Some(taps) = estimator.taps(level, source.face_size(), knob) else { return Ok(None) };
    let texel = |texel: usize| {
        cancel.check()?;
        let normal = texel_centre(level.face_size, texel);
        Ok(taps.radiance(source, normal, estimator.jitter(normal)).map(|value| value as f32))
    };
    let texels: Vec<[f32; 3]> =
        (0..level.texels()).into_par_iter().map(texel).collect::<Result<_, Cancelled>>()?;
    Ok(Some(Cube { face_size: level.face_size, rgb: texels.concat() }))
}
