//! What accuracy costs: estimators of prefiltered maps side by side.
//!
//! Start at [`Estimator`]: Kiln's convolution and the sampled ways that others go, behind one interface. [`Truth`] is what
//! they are compared with, brute force in `f64` at probes.
//!
//! Conventions: those of `kiln-bake`. Errors are relative: RMS to the exact map's RMS, the largest to the place's own value
//! plus a hundredth of the mean radiance. Equal inputs give equal numbers but for seconds, which a [`Stopwatch`] that the
//! caller brings measures; nothing here looks at a clock.
//!
//! Not here: files and the command line (`kiln`), what is baked for a project (`kiln-project`).

mod baseline;
mod chain;
mod curve;
mod estimator;
mod html;
mod ladder;
mod norms;
pub mod passes;
mod pictures;
mod report;
mod source;
#[cfg(test)]
mod tests;
mod truth;
mod work;

pub use kiln_bake::BruteForce;

pub use baseline::{Regression, over_limit, regressions};
pub use chain::{Level, LobeKind, chain, eevee_probe_law, level_count};
pub use curve::{Bench, Curve, Point, Predicted, sampled_map};
pub use estimator::{Estimator, Knob, UnknownEstimator, convolve};
pub use html::page;
pub use ladder::{Encoding, FORMATS, Ladder, LadderRequest, Price, Rung, difference, ladder};
pub use norms::{ErrorNorms, Weighted};
pub use pictures::{HEAT, Picture, Pictures};
pub use report::{
    Choice, ChosenChain, Environment, LevelFacts, LobeReport, Report, Request, SCHEMA, TableReport, examine,
    number, tables,
};
pub use source::{Rgb, Source};
pub use truth::{Probe, Truth, texel_centre};
pub use work::Work;

/// Measures what work takes on one thread.
pub trait Stopwatch {
    /// Runs `work` once and says how many seconds of one core it took.
    fn seconds(&self, work: &mut (dyn FnMut() + Send)) -> f64;
}
