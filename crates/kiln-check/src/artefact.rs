//! Baked maps: ranges, seams, energy and contrast over the levels of a cube; harmonics.

use kiln_bake::ShCoefficients;
use kiln_diagnostic::Severity;
use kiln_image::ktx2::Format;
use kiln_image::{Cancel, Cancelled, Cube, Environment, Texels, check_texels};

use crate::picture::{Fault, fault_map};
use crate::seams::{Lookup, Seam, cube_edges};
use crate::weights::Weights;
use crate::{Check, Finding, Subject};

/// What a chain of levels holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChainKind {
    /// An environment convolved with wider and wider lobes, or averaged: every level has the same mean.
    Radiance,
    /// The same with Charlie's lobes, which do not only grow wider: the mean stays, contrast may come and go.
    Sheen,
    /// One map, as of irradiance.
    Single,
}

/// A cube map as stored.
#[derive(Clone)]
pub struct ChainSubject<'a> {
    /// What to call it.
    pub name: &'a str,
    /// What it holds.
    pub kind: ChainKind,
    /// Level 0 first, as radiance: multiplied by the power of two that they were divided by.
    pub levels: &'a [Cube],
    /// How texels are stored, where that is known.
    pub format: Option<Format>,
    /// Texels were divided by 2 to this power.
    pub scale_log2: i32,
    /// Mean radiance, least and greatest value of what it was made of; level 0 stands for it where it is not known.
    pub source: Option<LevelFacts>,
    /// The source by direction: an edge of something that it shows is no seam.
    pub lookup: Option<Lookup<'a>>,
    /// The relative RMS error that was asked for.
    pub asked: Option<f64>,
    /// The largest one that a bake measured, against brute force.
    pub measured: Option<f64>,
}

/// A level, or the source of a chain, in numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelFacts {
    /// Mean radiance over the sphere, of each channel.
    pub mean: [f64; 3],
    /// Mean squared distance from it, over all channels.
    pub contrast2: f64,
    /// Least finite value.
    pub min: f32,
    /// Greatest finite value.
    pub max: f32,
}

/// Mean radiance off by more is an error: no rounding does that.
const ENERGY_ERROR: f64 = 0.05;
/// … and by more a warning.
const ENERGY_WARNING: f64 = 0.01;
/// Contrast may grow by this between levels: what rounding to RGB9E5 adds.
const CONTRAST_GROWTH: f64 = 1.01;
/// Values may exceed what they were made of by this share of its range: rounding again.
const OVERSHOOT: f64 = 0.01;
/// Rounding from here on is said where nobody asked for an error.
const ROUNDING: f64 = 0.01;
/// Least value of harmonics in relation to their mean that is no negative light.
const SH_NEGATIVE: f64 = -1e-3;

/// Mean radiance and contrast over the sphere, the values that are not finite left out.
///
/// # Errors
/// [`Cancelled`] within a few rows' work.
pub fn mean_radiance<T: Texels + ?Sized>(texels: &T, cancel: Cancel) -> Result<LevelFacts, Cancelled> {
    let weights = Weights::new(texels.shape());
    let (mut sum, mut sum2, mut total) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    let (mut min, mut max) = (f32::INFINITY, f32::NEG_INFINITY);
    for (index, texel) in texels.rgb().as_chunks::<3>().0.iter().enumerate() {
        if index.is_multiple_of(1 << 14) {
            cancel.check()?;
        }
        let weight = weights.of(index);
        for channel in 0..3 {
            let value = texel[channel];
            if value.is_finite() {
                let wide = f64::from(value);
                sum[channel] += wide * weight;
                sum2[channel] += wide * wide * weight;
                total[channel] += weight;
                (min, max) = (min.min(value), max.max(value));
            }
        }
    }
    let mean: [f64; 3] = std::array::from_fn(|i| if total[i] > 0.0 { sum[i] / total[i] } else { 0.0 });
    let variance =
        |i: usize| if total[i] > 0.0 { (sum2[i] / total[i] - mean[i] * mean[i]).max(0.0) } else { 0.0 };
    Ok(LevelFacts { mean, contrast2: (0..3).map(variance).sum::<f64>() / 3.0, min, max })
}

/// Checks a cube map as stored.
///
/// # Errors
/// [`Cancelled`] within a few rows' work.
pub fn check_chain(chain: &ChainSubject, with_picture: bool, cancel: Cancel) -> Result<Subject, Cancelled> {
    let mut subject = Subject::new(chain.name, "chain");
    let size = chain.levels.first().map_or(0, |level| level.face_size);
    let format = chain.format.map_or_else(|| "decoded".to_owned(), |format| format!("{format:?}"));
    subject.fact("map", format!("{} levels from 6 × {size} × {size}, {format}", chain.levels.len()));
    let mut facts = Vec::new();
    for (index, level) in chain.levels.iter().enumerate() {
        ranges(index, level, &mut subject, cancel)?;
        edges(index, level, chain.lookup, &mut subject);
        facts.push(mean_radiance(level, cancel)?);
    }
    if facts.is_empty() {
        subject.skip("chain", "it has no level");
        return Ok(subject);
    }
    match chain.kind {
        ChainKind::Radiance => {
            energy(chain, &facts, &mut subject);
            contrast(&facts, &mut subject);
        }
        ChainKind::Sheen | ChainKind::Single => energy(chain, &facts, &mut subject),
    }
    encoding(chain, &mut subject, cancel)?;
    if with_picture {
        let picture = |(index, level): (usize, &Cube)| {
            fault_map(
                &format!("level {index}"),
                &Environment::Cube(level.clone()),
                |texel| Fault::of(texel, f64::INFINITY),
                &[],
            )
        };
        let shown = chain.levels.iter().enumerate().filter(|(_, level)| level.face_size >= 4).take(3);
        subject.pictures.extend(shown.map(picture));
    }
    subject.findings.sort_by_key(|finding| finding.check);
    Ok(subject)
}

fn ranges(index: usize, level: &Cube, subject: &mut Subject, cancel: Cancel) -> Result<(), Cancelled> {
    let report = check_texels(level, cancel)?;
    let defects = [
        (Check::NonFinite, "NaN", &report.nan),
        (Check::NonFinite, "infinite", &report.infinite),
        (Check::Negative, "negative", &report.negative),
    ];
    for (check, what, defect) in defects {
        if let Some(worst) = defect.worst {
            let message = format!("level {index} has {} {what} values", defect.count);
            let help = "whatever reads this map spreads them over a frame; bake it again";
            subject
                .findings
                .push(Finding::new(check, Severity::Error, message).at(worst.to_string()).with_help(help));
        }
    }
    Ok(())
}

fn edges(index: usize, level: &Cube, source: Option<Lookup>, subject: &mut Subject) {
    let visible = cube_edges(level, source).into_iter().filter(|(_, seam)| seam.is_visible());
    let visible: Vec<(String, Seam)> = visible.collect();
    let Some((_, worst)) = visible.iter().max_by(|a, b| a.1.across.total_cmp(&b.1.across)) else { return };
    let message = format!(
        "level {index} has {} visible edges: contrast {:.2} %, {:.2} % beside it",
        visible.len(),
        100.0 * worst.across,
        100.0 * worst.beside
    );
    let mut finding = Finding::new(Check::CubeEdges, Severity::Warning, message);
    finding.places.extend(visible.iter().take(4).map(|(faces, _)| format!("between {faces}")));
    subject.findings.push(
        finding
            .with_help("faces were filtered one by one, turned or exchanged: filter over the whole sphere"),
    );
}

/// Means, contrasts and ranges over the chain.
fn energy(chain: &ChainSubject, facts: &[LevelFacts], subject: &mut Subject) {
    let source = chain.source.unwrap_or(facts[0]);
    let of = if chain.source.is_some() { "its source" } else { "level 0" };
    let size = source.mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
    let mut worst = 0.0f64;
    for (index, level) in facts.iter().enumerate() {
        let off = (0..3).map(|i| (level.mean[i] - source.mean[i]).abs()).fold(0.0, f64::max);
        let off = if size > 0.0 { off / size } else { off };
        worst = worst.max(off);
        if off > ENERGY_WARNING || off.is_nan() {
            let severity = if off <= ENERGY_ERROR { Severity::Warning } else { Severity::Error };
            let message =
                format!("the mean radiance of level {index} is off by {:.2} % from {of}", 100.0 * off);
            let help = "a sampler that reads mip levels loses or makes light; so does clamping, and mips without solid angles";
            subject.findings.push(
                Finding::new(Check::MipEnergy, severity, message)
                    .at(format!("level {index}"))
                    .with_help(help),
            );
        }
    }
    subject.fact("energy", format!("all levels within {:.4} % of {of}", 100.0 * worst));
    let range = f64::from(source.max) - f64::from(source.min);
    for (index, level) in facts.iter().enumerate() {
        let over =
            (f64::from(level.max) - f64::from(source.max)).max(f64::from(source.min) - f64::from(level.min));
        if over > OVERSHOOT * range {
            let message =
                format!("level {index} goes {:.2} % of the range beyond {of}", 100.0 * over / range);
            let help =
                "ringing of a cut-off spectrum next to a light: means of light lie between its extremes";
            subject.findings.push(
                Finding::new(Check::Overshoot, Severity::Warning, message)
                    .at(format!("level {index}"))
                    .with_help(help),
            );
        }
    }
}

/// Wider lobes only smooth.
fn contrast(facts: &[LevelFacts], subject: &mut Subject) {
    let size = facts[0].mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
    for (index, pair) in facts.windows(2).enumerate() {
        // Levels that are constant up to rounding have no contrast to compare.
        let floor = 1e-6 * size * size;
        if pair[1].contrast2 > CONTRAST_GROWTH * pair[0].contrast2 + floor {
            let message = format!(
                "level {} has more contrast than level {index}: {:.3e} after {:.3e} (mean square)",
                index + 1,
                pair[1].contrast2,
                pair[0].contrast2
            );
            let help = "noise of a sampler, or levels out of order: wider lobes only smooth";
            subject.findings.push(
                Finding::new(Check::MipContrast, Severity::Warning, message)
                    .at(format!("level {}", index + 1))
                    .with_help(help),
            );
        }
    }
}

/// What rounding to the texels' format costs, from the steps at the values that are stored.
fn encoding(chain: &ChainSubject, subject: &mut Subject, cancel: Cancel) -> Result<(), Cancelled> {
    let check = Check::EncodingError;
    let largest = |of: &dyn Fn([f64; 3]) -> [f64; 3]| -> Result<f64, Cancelled> {
        let scale = libm::exp2(f64::from(-chain.scale_log2));
        let mut largest = 0.0f64;
        for level in chain.levels {
            cancel.check()?;
            let (mut steps2, mut values2) = (0.0, 0.0);
            for texel in level.rgb.as_chunks::<3>().0 {
                let value = texel.map(|value| f64::from(value) * scale);
                if value.iter().all(|value| value.is_finite()) {
                    steps2 += of(value).iter().map(|step| step * step).sum::<f64>();
                    values2 += value.iter().map(|value| value * value).sum::<f64>();
                }
            }
            // A value lies anywhere within a step: RMS of step / √12.
            largest = largest.max(if values2 > 0.0 { (steps2 / 12.0 / values2).sqrt() } else { 0.0 });
        }
        Ok(largest)
    };
    let float = |mantissa_bits: i32, least: i32| {
        move |value: [f64; 3]| {
            value.map(|value| libm::ldexp(1.0, exponent(value.abs()).max(least) - mantissa_bits))
        }
    };
    let rounding = match chain.format {
        Some(Format::R16G16B16A16_SFLOAT | Format::R16G16B16_SFLOAT | Format::R16G16_SFLOAT) => {
            largest(&float(10, -14))?
        }
        Some(Format::R32G32B32A32_SFLOAT | Format::R32G32B32_SFLOAT | Format::R32G32_SFLOAT) => {
            largest(&float(23, -126))?
        }
        Some(Format::B10G11R11_UFLOAT_PACK32) => largest(&|value: [f64; 3]| {
            std::array::from_fn(|i| {
                libm::ldexp(1.0, exponent(value[i]).max(-14) - if i == 2 { 5 } else { 6 })
            })
        })?,
        Some(Format::E5B9G9R9_UFLOAT_PACK32) => largest(&|value: [f64; 3]| {
            let brightest = value.iter().fold(0.0, |most: f64, value| most.max(*value));
            [libm::ldexp(1.0, exponent(brightest).max(-16) - 8); 3]
        })?,
        Some(Format::R8G8B8A8_UNORM) => largest(&|_| [1.0 / 255.0; 3])?,
        Some(Format::BC6H_UFLOAT_BLOCK) => {
            subject.skip(
                check.name(),
                "blocks do not tell what they were made of; the bake that wrote them measured it",
            );
            return measured(chain, subject);
        }
        None => {
            subject.skip(check.name(), "the texels' format is not known here");
            return measured(chain, subject);
        }
    };
    subject.fact("rounding", format!("{rounding:.2e} relative RMS, from the format's steps"));
    let limit = chain.asked.unwrap_or(ROUNDING);
    if rounding > limit {
        let message = format!("rounding to texels costs {rounding:.2e}, where {limit:.2e} is the limit");
        let help = "choose a wider `format`, or ask for a larger `error`";
        subject.findings.push(Finding::new(check, Severity::Warning, message).with_help(help));
    }
    measured(chain, subject)
}

/// What the bake itself measured, against what was asked for.
fn measured(chain: &ChainSubject, subject: &mut Subject) -> Result<(), Cancelled> {
    let Some(measured) = chain.measured else { return Ok(()) };
    let asked = chain.asked.map_or_else(|| "nothing".to_owned(), |asked| format!("{asked:.2e}"));
    subject.fact(
        "measured",
        format!("{measured:.2e} relative RMS against brute force, encoding included; {asked} was asked for"),
    );
    if let Some(asked) = chain.asked.filter(|asked| measured > *asked) {
        let message = format!("the map is off by {measured:.2e}, where {asked:.2e} was asked for");
        let help = "where encoding is most of it a wider `format` helps; `kiln bake --timings` says what a smaller error costs";
        subject.findings.push(Finding::new(Check::EncodingError, Severity::Warning, message).with_help(help));
    }
    Ok(())
}

/// floor(log2) of a positive value.
fn exponent(value: f64) -> i32 {
    if value > 0.0 { libm::frexp(value).1 - 1 } else { -1022 }
}

/// Checks harmonics of light for directions with negative values: `what` names the function.
pub fn check_harmonics(name: &str, what: &str, harmonics: &ShCoefficients) -> Subject {
    const COUNT: usize = 4096;
    let mut subject = Subject::new(name, "harmonics");
    subject.fact("harmonics", format!("{what}, order {}", harmonics.order));
    // Y_00 is 1/√4π everywhere.
    let y_00 = 0.5 / std::f64::consts::PI.sqrt();
    let mean = harmonics.coefficients.first().map_or([0.0; 3], |c| c.map(|c| c * y_00));
    let size = mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
    let mut least = (f64::INFINITY, [0.0; 3]);
    let mut is_finite = harmonics.coefficients.iter().flatten().all(|c| c.is_finite());
    for index in 0..COUNT {
        let direction = spiral(index, COUNT);
        for value in harmonics.evaluate(direction) {
            is_finite &= value.is_finite();
            if value < least.0 {
                least = (value, direction);
            }
        }
    }
    if !is_finite {
        let finding = Finding::new(Check::NonFinite, Severity::Error, "a coefficient is NaN or infinite");
        subject.findings.push(finding.with_help("bake it again, of an environment without such texels"));
        return subject;
    }
    let relative = if size > 0.0 { least.0 / size } else { 0.0 };
    subject.fact("least value", format!("{relative:.4} of the mean"));
    if relative < SH_NEGATIVE {
        let [x, y, z] = least.1;
        let message = format!("{what} goes down to {relative:.3} of its mean: light that is negative");
        let help = "a strong sun does that to few bands; `sh = \"dering\"` windows them";
        let finding = Finding::new(Check::ShNegative, Severity::Warning, message);
        subject.findings.push(finding.at(format!("towards ({x:.2}, {y:.2}, {z:.2})")).with_help(help));
    }
    subject
}

/// Point `index` of a spiral of `count` points from pole to pole, nearly even over the sphere.
fn spiral(index: usize, count: usize) -> [f64; 3] {
    let y = 1.0 - (2 * index + 1) as f64 / count as f64;
    let radius = (1.0 - y * y).sqrt();
    // The golden angle: no two points line up.
    let (sine, cosine) = libm::sincos(index as f64 * std::f64::consts::PI * (3.0 - 5.0f64.sqrt()));
    [radius * sine, y, radius * cosine]
}
