//! The estimators behind one interface.

use kiln_bake::{AnalysisRequest, Lobe, Prefiltered, analyse, irradiance, sheen_level, specular_level};
use kiln_image::{Cancel, Cancelled, Panorama};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::chain::{Level, LobeKind};
use crate::passes::prefilter::{UNFILTERED, prefilter};
use crate::passes::prefilter_eevee::{level_bias, prefilter_eevee, sample_count};
use crate::passes::prefilter_jittered::prefilter_jittered;
use crate::passes::prefilter_visible::prefilter_visible;
use crate::passes::{Taps, irradiance as sampled_irradiance, prefilter_jittered, prefilter_khronos};
use crate::work::Work;

/// A way to make prefiltered maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// Kiln's own: a product of spherical harmonics.
    Convolution,
    /// Plain GGX importance sampling, the source's largest level.
    Importance,
    /// The same, mips by density: Karis 2013 as tutorials have it.
    ImportanceMips,
    /// One level more: filtered importance sampling.
    Filtered,
    /// Eevee's light probes before Blender 4.
    Eevee,
    /// The common Vulkan samples.
    Vulkan,
    /// Khronos' sampler.
    Khronos,
    /// Visible normals.
    Visible,
    /// Irradiance on an even grid of angles.
    Grid,
    /// Irradiance by directions distributed as the cosine.
    Cosine,
}

/// What a user turns to buy less error with more time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Knob {
    /// The error asked for.
    Error,
    /// Samples a texel.
    Samples,
    /// Factor of all sample counts.
    Quality,
    /// Radians between directions.
    Step,
}

/// A name that no estimator has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("no estimator is called `{name}`{}; there are: {}", suggest(.suggestion), Estimator::names())]
pub struct UnknownEstimator {
    /// What was asked for.
    pub name: String,
    /// What may have been meant.
    pub suggestion: Option<&'static str>,
}

fn suggest(suggestion: &Option<&'static str>) -> String {
    suggestion.map_or_else(String::new, |name| format!(", did you mean `{name}`"))
}

impl Estimator {
    /// All of them.
    pub const ALL: [Estimator; 10] = [
        Estimator::Convolution,
        Estimator::Importance,
        Estimator::ImportanceMips,
        Estimator::Filtered,
        Estimator::Eevee,
        Estimator::Vulkan,
        Estimator::Khronos,
        Estimator::Visible,
        Estimator::Grid,
        Estimator::Cosine,
    ];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Estimator::Convolution => "convolution",
            Estimator::Importance => "importance",
            Estimator::ImportanceMips => "importance-mips",
            Estimator::Filtered => "filtered",
            Estimator::Eevee => "eevee",
            Estimator::Vulkan => "vulkan",
            Estimator::Khronos => "khronos",
            Estimator::Visible => "visible",
            Estimator::Grid => "grid",
            Estimator::Cosine => "cosine",
        }
    }

    /// What it is, for people.
    pub fn title(self) -> &'static str {
        match self {
            Estimator::Convolution => "Kiln: convolution on the sphere",
            Estimator::Importance => "GGX importance sampling, no mips (Karis 2013)",
            Estimator::ImportanceMips => "GGX importance sampling, mips by density (OpenGL tutorials)",
            Estimator::Filtered => "Filtered importance sampling (Křivánek and Colbert 2008)",
            Estimator::Eevee => "Eevee's light probes (Blender before 4)",
            Estimator::Vulkan => "Vulkan samples: jittered Hammersley, one mip up",
            Estimator::Khronos => "Khronos' glTF sampler",
            Estimator::Visible => {
                "GGX visible normals, mips by density (seen along the normal: the same points)"
            }
            Estimator::Grid => "Irradiance on an even grid of angles (tutorials)",
            Estimator::Cosine => "Irradiance by cosine-weighted samples, mips by density",
        }
    }

    /// All names, for messages.
    pub fn names() -> String {
        Estimator::ALL.map(Estimator::name).join(", ")
    }

    /// The estimator of a name.
    ///
    /// # Errors
    /// [`UnknownEstimator`] with the nearest name.
    pub fn parse(name: &str) -> Result<Estimator, UnknownEstimator> {
        let found = Estimator::ALL.into_iter().find(|estimator| estimator.name() == name);
        found.ok_or_else(|| {
            let near = Estimator::ALL.map(|known| (strsim::jaro_winkler(known.name(), name), known.name()));
            let nearest = near.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
            let suggestion = nearest.filter(|(score, _)| *score > 0.75).map(|(_, name)| name);
            UnknownEstimator { name: name.to_owned(), suggestion }
        })
    }

    /// Whether it makes maps of a lobe.
    pub fn estimates(self, kind: LobeKind) -> bool {
        match self {
            Estimator::Convolution | Estimator::Khronos => true,
            Estimator::Grid | Estimator::Cosine => kind == LobeKind::Lambert,
            _ => kind == LobeKind::Ggx,
        }
    }

    /// What is turned.
    pub fn knob(self) -> Knob {
        match self {
            Estimator::Convolution => Knob::Error,
            Estimator::Eevee => Knob::Quality,
            Estimator::Grid => Knob::Step,
            _ => Knob::Samples,
        }
    }

    /// Where a curve is measured, from the cheapest.
    pub fn knobs(self) -> &'static [f64] {
        match self.knob() {
            Knob::Samples if self == Estimator::Vulkan => &[8.0, 16.0, 32.0, 64.0, 256.0, 1024.0],
            Knob::Error => &[1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5],
            Knob::Samples => &[16.0, 64.0, 256.0, 1024.0, 2048.0, 4096.0],
            Knob::Quality => &[0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0],
            Knob::Step => &[0.4, 0.2, 0.1, 0.05, 0.025, 0.0125],
        }
    }

    /// What those whose estimator it is use.
    pub fn usual_knob(self) -> f64 {
        match self {
            Estimator::Convolution => 1e-3,
            Estimator::Eevee => 1.0,
            Estimator::Grid => 0.025,
            Estimator::Vulkan => 32.0,
            _ => 1024.0,
        }
    }

    /// A sampled estimator made ready for a level and a source of `face_size`; `None` for the convolution, which is none, and
    /// for lobes that it does not estimate.
    pub fn taps(self, level: &Level, face_size: usize, knob: f64) -> Option<Taps> {
        let count = (knob.round() as u32).max(1);
        let alpha = level.alpha();
        let taps = match (self, level.lobe) {
            (Estimator::Khronos, Lobe::Lambert) => prefilter_khronos::lambert(face_size, count),
            (Estimator::Khronos, Lobe::Ggx { .. }) => prefilter_khronos::ggx(face_size, alpha, count),
            (Estimator::Khronos, Lobe::Charlie { .. }) => prefilter_khronos::charlie(face_size, alpha, count),
            (Estimator::Grid, Lobe::Lambert) => sampled_irradiance::irradiance_grid(knob),
            (Estimator::Cosine, Lobe::Lambert) => {
                sampled_irradiance::irradiance_cosine(face_size, count, 0.0)
            }
            (Estimator::Importance, Lobe::Ggx { .. }) => prefilter(face_size, alpha, count, UNFILTERED),
            (Estimator::ImportanceMips, Lobe::Ggx { .. }) => prefilter(face_size, alpha, count, 0.0),
            (Estimator::Filtered, Lobe::Ggx { .. }) => prefilter(face_size, alpha, count, 1.0),
            (Estimator::Visible, Lobe::Ggx { .. }) => prefilter_visible(face_size, alpha, count, 0.0),
            (Estimator::Vulkan, Lobe::Ggx { .. }) => prefilter_jittered(face_size, alpha, count),
            (Estimator::Eevee, Lobe::Ggx { .. }) => {
                let count = (f64::from(sample_count(level.mip)) * knob).round().max(1.0) as u32;
                prefilter_eevee(face_size, alpha, count, level_bias(level.mip))
            }
            _ => return None,
        };
        Some(taps)
    }

    /// The number of a texel that looks along `normal`, for estimators that turn their samples texel by texel.
    pub fn jitter(self, normal: [f64; 3]) -> f64 {
        if self == Estimator::Vulkan { prefilter_jittered::jitter(normal) } else { 0.0 }
    }
}

/// Kiln's own estimator: all levels of a chain, as good as `error`, and the work of it.
///
/// # Errors
/// [`Cancelled`] soon after it is asked for.
pub fn convolve(
    panorama: &Panorama,
    levels: &[Level],
    error: f64,
    cancel: Cancel,
) -> Result<(Vec<Prefiltered>, Work), Cancelled> {
    let alphas = |is_charlie: bool| {
        let of_kind =
            levels.iter().filter(move |level| matches!(level.lobe, Lobe::Charlie { .. }) == is_charlie);
        of_kind.map(Level::alpha).reduce(f64::min)
    };
    let request =
        AnalysisRequest { alpha_min: alphas(false).unwrap_or(1.0), sheen_alpha_min: alphas(true), error };
    let analysis = analyse(panorama, &request, cancel)?;
    let mut work = Work::of_analysis(panorama.width(), panorama.height(), analysis.band_limit());
    let mut maps = Vec::with_capacity(levels.len());
    for level in levels {
        let map = match level.lobe {
            Lobe::Lambert => irradiance(&analysis, level.face_size, cancel)?,
            Lobe::Ggx { alpha } => specular_level(&analysis, alpha, level.face_size, cancel)?,
            Lobe::Charlie { alpha } => sheen_level(&analysis, alpha, level.face_size, cancel)?,
        };
        work = work.plus(Work::of_synthesis(&map));
        maps.push(map);
    }
    Ok((maps, work))
}

#[cfg(test)]
mod tests {
    use super::Estimator;
    use crate::chain::LobeKind;

    #[test]
    fn names_are_read_again_and_an_unknown_one_lists_them_with_a_suggestion() {
        for estimator in Estimator::ALL {
            assert_eq!(Estimator::parse(estimator.name()), Ok(estimator));
            assert!(estimator.knobs().len() >= 6, "{estimator:?}");
            assert!(LobeKind::ALL.into_iter().any(|kind| estimator.estimates(kind)));
        }
        let message = Estimator::parse("kronos").unwrap_err().to_string();
        assert!(
            message.contains("did you mean `khronos`") && message.contains("importance-mips"),
            "{message}"
        );
        let message = Estimator::parse("xyz").unwrap_err().to_string();
        assert!(!message.contains("did you mean"), "{message}");
    }
}
