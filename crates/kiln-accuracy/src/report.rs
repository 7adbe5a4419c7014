//! One environment's report, and what CI holds on to of it.

use kiln_bake::{BruteForce, RoughnessLaw, TexelFormat};
use kiln_image::{Cancel, Cancelled, Cube, Panorama};
use serde::{Deserialize, Serialize};

use crate::chain::{Level, LobeKind, chain};
use crate::curve::{Bench, Curve, Point, sampled_map};
use crate::estimator::{Estimator, convolve};
use crate::ladder::{FORMATS, Ladder, LadderRequest, Price, ladder};
use crate::norms::ErrorNorms;
use crate::passes::brdf_table::TABLES;
use crate::source::Source;
use crate::truth::Truth;
use crate::work::Work;
use crate::{Stopwatch, pictures::Pictures};

/// Version of [`Report`] as JSON.
pub const SCHEMA: u32 = 1;

/// What is asked of an environment.
pub struct Request<'a> {
    /// Its name.
    pub name: &'a str,
    /// Itself: finite, not negative.
    pub panorama: &'a Panorama,
    /// Which lobes.
    pub lobes: &'a [LobeKind],
    /// Which estimators.
    pub estimators: &'a [Estimator],
    /// Edge of the chains' first mip.
    pub face_size: usize,
    /// Law of their roughness.
    pub law: &'a RoughnessLaw,
    /// Error that Kiln is asked for.
    pub error: f64,
    /// Format that Kiln bakes.
    pub format: TexelFormat,
    /// Probes a level; `None`: as many as take some seconds.
    pub probes: Option<usize>,
}

/// Reports of environments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// In order of names.
    pub environments: Vec<Environment>,
}

/// One environment's report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// Its name.
    pub name: String,
    /// Of the panorama, in texels.
    pub width: usize,
    /// Of the panorama, in texels.
    pub height: usize,
    /// Brightest channel of a texel.
    pub peak: f64,
    /// Mean radiance.
    pub mean: [f64; 3],
    /// Edge of the chains' first mip.
    pub face_size: usize,
    /// Name of the law of roughness.
    pub law: String,
    /// Chains, lobe by lobe.
    pub lobes: Vec<LobeReport>,
    /// BRDF tables, which do not depend on the environment.
    pub tables: Vec<TableReport>,
    /// What is off for which reason.
    pub ladder: Option<Ladder>,
    /// What Kiln bakes.
    pub choice: Choice,
}

/// A lobe's chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LobeReport {
    /// Which lobe.
    pub lobe: LobeKind,
    /// Its levels.
    pub levels: Vec<LevelFacts>,
    /// Estimators over their knobs.
    pub curves: Vec<Curve>,
}

/// A level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelFacts {
    /// Which mip.
    pub mip: usize,
    /// Edge of its faces.
    pub face_size: usize,
    /// Perceptual.
    pub roughness: f64,
    /// Directions that were compared.
    pub probes: usize,
}

/// A BRDF table as somebody makes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableReport {
    /// Whose it is.
    pub title: String,
    /// Texels along an edge.
    pub size: usize,
    /// Samples a texel; 0: quadrature.
    pub sample_count: u32,
    /// Its texels beside its own integral, absolute.
    pub error: ErrorNorms,
    /// Beside that of height-correlated Smith, which glTF's renderers assume.
    pub beside_smith: ErrorNorms,
}

/// What Kiln bakes, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// How.
    pub estimator: Estimator,
    /// Error asked for.
    pub error: f64,
    /// Texels.
    pub format: String,
    /// Measured, chain by chain, before encoding.
    pub chains: Vec<ChosenChain>,
    /// Bytes of the GGX chain; 0 where it was not looked at.
    pub bytes: u64,
    /// Sentences for people.
    pub reasons: Vec<String>,
}

/// A chain at the error asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChosenChain {
    /// Which lobe.
    pub lobe: LobeKind,
    /// Of the chain.
    pub error: ErrorNorms,
    /// Largest of the levels' RMS errors, which is what was asked for.
    pub worst_rms: f64,
    /// Counted.
    pub work: Work,
    /// On one core.
    pub seconds: f64,
}

/// As many probes a level as keep a report within a minute: measured, a probe of a panorama of 2^19 texels takes some
/// milliseconds of one core.
fn probe_count(panorama: &Panorama, kind: LobeKind) -> usize {
    let texels = panorama.width() * panorama.height();
    // Charlie's kernel takes logarithms.
    let budget = if kind == LobeKind::Charlie { 8_usize << 19 } else { 64 << 19 };
    (budget / texels.max(1)).clamp(8, 192)
}

/// Measures an environment; `say` hears what is being done.
///
/// # Errors
/// [`Cancelled`] soon after it is asked for.
pub fn examine(
    request: &Request,
    watch: &dyn Stopwatch,
    say: &dyn Fn(&str),
    cancel: Cancel,
) -> Result<(Environment, Pictures), Cancelled> {
    let Request { panorama, face_size, law, error, .. } = *request;
    let force = BruteForce::new(panorama, cancel)?;
    say("preparing the environment");
    let source = Source::new(panorama, face_size, cancel)?;
    let (mut lobes, mut chosen, mut ladder_found) = (Vec::new(), Vec::new(), None);
    let mut pictures = Pictures::default();
    for &kind in request.lobes {
        let levels = chain(kind, face_size, law);
        say(&format!("{}: brute force at the probes", kind.name()));
        let probes = request.probes.unwrap_or_else(|| probe_count(panorama, kind));
        let truths = levels.iter().map(|level| Truth::new(&force, *level, probes, cancel));
        let truths: Vec<Truth> = truths.collect::<Result<_, _>>()?;
        let bench = Bench { panorama, source: &source, truths: &truths, watch };
        let mut curves = Vec::new();
        for &estimator in request.estimators.iter().filter(|estimator| estimator.estimates(kind)) {
            say(&format!("{}: {}", kind.name(), estimator.name()));
            curves.push(bench.curve(estimator, estimator.knobs(), cancel)?);
        }
        let asked = bench.curve(Estimator::Convolution, &[error], cancel)?.points.swap_remove(0);
        if kind == LobeKind::Ggx && !levels.is_empty() {
            say("ggx: the ladder of errors");
            let request = LadderRequest {
                panorama,
                force: &force,
                levels: &levels,
                face_size,
                law,
                estimator: (error, asked.error),
                format: request.format,
                probes: (probes / 2).max(8),
            };
            ladder_found = Some(ladder(&request, cancel)?);
        }
        say(&format!("{}: pictures", kind.name()));
        pictures.add(kind, &pictured(request, &levels, &source, cancel)?);
        chosen.push(chosen_chain(kind, asked));
        let facts = |truth: &Truth| LevelFacts {
            mip: truth.level.mip,
            face_size: truth.level.face_size,
            roughness: truth.level.roughness,
            probes: truth.probes.len(),
        };
        lobes.push(LobeReport { lobe: kind, levels: truths.iter().map(facts).collect(), curves });
    }
    let choice = choice(request, &lobes, chosen, ladder_found.as_ref());
    let environment = Environment {
        name: request.name.to_owned(),
        width: panorama.width(),
        height: panorama.height(),
        peak: f64::from(panorama.max_value()),
        mean: force.mean(),
        face_size,
        law: law.name().to_owned(),
        lobes,
        tables: Vec::new(),
        ladder: ladder_found,
        choice,
    };
    Ok((environment, pictures))
}

/// BRDF tables beside their integrals.
///
/// # Errors
/// [`Cancelled`] within a row of probes.
pub fn tables(cancel: Cancel) -> Result<Vec<TableReport>, Cancelled> {
    /// Places along each axis.
    const PROBES: usize = 16;
    let report = |table: &crate::passes::brdf_table::TableEstimator| {
        let [error, beside_smith] = table.measure(PROBES, cancel)?;
        let sample_count = table.sample_count.unwrap_or(0);
        Ok(TableReport { title: table.title.to_owned(), size: table.size, sample_count, error, beside_smith })
    };
    TABLES.iter().map(report).collect()
}

/// Maps of one level by each estimator at its usual setting, and the exact one first.
fn pictured(
    request: &Request,
    levels: &[Level],
    source: &Source,
    cancel: Cancel,
) -> Result<Vec<(String, Cube)>, Cancelled> {
    // A level with faces of 32 texels shows enough and costs little.
    let Some(level) = levels.iter().find(|level| level.face_size <= 32) else { return Ok(Vec::new()) };
    let exact = |error: f64| -> Result<Cube, Cancelled> {
        Ok(convolve(request.panorama, &[*level], error, cancel)?.0.swap_remove(0).cube)
    };
    let mut found = vec![("exact".to_owned(), exact(1e-6)?)];
    for &estimator in request.estimators {
        let knob = estimator.usual_knob();
        let map = match estimator {
            Estimator::Convolution => Some(exact(request.error)?),
            _ => sampled_map(estimator, source, level, knob, cancel)?,
        };
        let knob = if estimator == Estimator::Convolution { request.error } else { knob };
        found.extend(map.map(|map| (format!("{} · {}", estimator.name(), number(knob)), map)));
    }
    Ok(found)
}

/// A knob's value as people write it.
pub fn number(value: f64) -> String {
    if value >= 0.01 { format!("{value}") } else { format!("{value:.0e}") }
}

fn chosen_chain(lobe: LobeKind, point: Point) -> ChosenChain {
    let worst_rms = point.levels.iter().map(|level| level.rms).fold(0.0, f64::max);
    ChosenChain { lobe, error: point.error, worst_rms, work: point.work, seconds: point.seconds }
}

fn choice(
    request: &Request,
    lobes: &[LobeReport],
    chains: Vec<ChosenChain>,
    ladder: Option<&Ladder>,
) -> Choice {
    let format = FORMATS.iter().find(|(_, format)| *format == request.format).map_or("?", |(name, _)| name);
    let encoding =
        ladder.and_then(|ladder| ladder.encodings.iter().find(|encoding| encoding.format == format));
    let mut reasons = Vec::new();
    for (lobe, chain) in lobes.iter().zip(&chains) {
        reasons.push(beside_others(lobe, chain));
    }
    if let Some(ladder) = ladder {
        reasons.push(advice(ladder));
    }
    Choice {
        estimator: Estimator::Convolution,
        error: request.error,
        format: format.to_owned(),
        chains,
        bytes: encoding.map_or(0, |encoding| encoding.bytes),
        reasons,
    }
}

/// How the chosen chain stands beside the sampled estimators that were measured.
fn beside_others(lobe: &LobeReport, chain: &ChosenChain) -> String {
    let sampled = lobe.curves.iter().filter(|curve| curve.estimator != Estimator::Convolution);
    let points = sampled.flat_map(|curve| curve.points.iter().map(move |point| (curve.estimator, point)));
    let best = points.min_by(|a, b| a.1.error.rms.total_cmp(&b.1.error.rms));
    let own =
        format!("{}: {:.1e} RMS in {:.3} s of one core", lobe.lobe.name(), chain.error.rms, chain.seconds);
    match best {
        Some((estimator, point)) if point.error.rms > chain.error.rms => format!(
            "{own}; the best sampled one that was measured ({}, {}) leaves {:.1e} in {:.3} s",
            estimator.name(),
            number(point.knob),
            point.error.rms,
            point.seconds
        ),
        Some((estimator, point)) => format!(
            "{own}; {} at {} leaves less, {:.1e} in {:.3} s: ask for a smaller error if that matters",
            estimator.name(),
            number(point.knob),
            point.error.rms,
            point.seconds
        ),
        None => own,
    }
}

/// What would help.
fn advice(ladder: &Ladder) -> String {
    let Some(rung) = ladder.rungs.iter().find(|rung| rung.name == ladder.dominant) else {
        return String::new();
    };
    let help = match rung.price {
        Price::Time => "a smaller error buys a better picture",
        Price::Bytes if rung.name == "encoding" => {
            "a wider format buys a better picture; a smaller error does not"
        }
        Price::Bytes => "larger faces or more mips buy a better picture; a smaller error does not",
        Price::Source => "only a finer panorama buys a better picture",
        Price::Nothing => {
            "no bake buys a better picture: the renderer's shortcut costs more than all the rest"
        }
    };
    format!("the largest rung is the {} with {:.1e}: {help}", rung.name, rung.rms)
}
