//! What lights a scene: its numbers before any repair, its seams, and what texel formats make of it.

use half::f16;
use kiln_diagnostic::Severity;
use kiln_image::colour::luminance;
use kiln_image::texel::rgb9e5;
use kiln_image::{
    Cancel, Cancelled, DecodedEnvironment, Defect, Environment, TexelReport, Texels, check_texels,
    repair_texels,
};
use rayon::prelude::*;

use crate::picture::{Fault, fault_map};
use crate::seams::{Seam, cube_edges, pole_spread, wrap_column};
use crate::weights::{Weights, row_texels};
use crate::{Check, Finding, Subject};

/// The part of the texels whose flux tells of a sun.
pub const SUN_SHARE_OF_TEXELS: f64 = 1e-4;
/// The share of the flux in them from which one is told of it.
const SUN_SHARE_OF_FLUX: f64 = 0.1;
/// Flux that a repair of negative values may move before it is an error.
const NEGATIVE_FLUX_MAX: f64 = 1e-3;
/// A texel is lost to a format that changes its luminance by more.
const LOSS: f64 = 0.01;
/// The share of the sphere that a format may lose before one is told.
const LOST_SHARE_MAX: f64 = 1e-3;

/// Checks an environment as decoded; `with_picture` draws what is wrong where.
///
/// # Errors
/// [`Cancelled`] within a few rows' work.
pub fn check_environment(
    name: &str,
    decoded: &DecodedEnvironment,
    with_picture: bool,
    cancel: Cancel,
) -> Result<Subject, Cancelled> {
    let mut subject = Subject::new(name, "environment");
    subject
        .fact("file", format!("{}, {}, {}", decoded.format, decoded.layout, decoded.environment.size_text()));
    let report = check_texels(decoded, cancel)?;
    values(&report, &mut subject);
    repair(decoded, &report, &mut subject, cancel)?;
    let sums = Sums::of(decoded, kiln_bake::scale_log2(report.max), cancel)?;
    let sun = sums.sun();
    light(&report, &sums, &sun, &mut subject);
    formats(&report, &sums, &mut subject);
    let seams = seams(&decoded.environment, &mut subject);
    if with_picture {
        let fault = |texel: [f32; 3]| Fault::of(texel, sun.threshold);
        subject.pictures.push(fault_map("what is wrong where", &decoded.environment, fault, &seams));
    }
    subject.findings.sort_by_key(|finding| finding.check);
    Ok(subject)
}

/// NaN, infinite, negative and large values.
fn values(report: &TexelReport, subject: &mut Subject) {
    let mut say = |check: Check, severity: Severity, what: &str, defect: &Defect, help: &str| {
        let Some(worst) = defect.worst else { return };
        let values = if defect.count == 1 { "value is" } else { "values are" };
        let finding = Finding::new(check, severity, format!("{} {values} {what}", defect.count));
        subject.findings.push(finding.at(worst.to_string()).with_help(help));
    };
    let mends = "mend the file; a bake fills such texels from their neighbours (`texels = \"repair\"`) or refuses them (`\"error\"`)";
    say(Check::NonFinite, Severity::Error, "NaN", &report.nan, mends);
    say(Check::NonFinite, Severity::Error, "infinite", &report.infinite, mends);
    let wide = "a colour outside Rec. 709: nothing is wrong, and it is kept";
    say(Check::Negative, Severity::Note, "negative as a wide colour has it", &report.out_of_gamut, wide);
    let scales = format!(
        "a bake divides all texels by 2^{}, or keeps 32-bit floats (`range = \"f32\"`); other programs make infinities of them",
        kiln_bake::scale_log2(report.max)
    );
    say(Check::AboveF16, Severity::Warning, "above 65504", &report.above_f16, &scales);
}

/// What a repair would change.
fn repair(
    decoded: &DecodedEnvironment,
    report: &TexelReport,
    subject: &mut Subject,
    cancel: Cancel,
) -> Result<(), Cancelled> {
    if report.is_radiance() {
        subject.fact("repair", "would change nothing");
        return Ok(());
    }
    let mut mended = decoded.clone();
    let repair = repair_texels(&mut mended, cancel)?;
    subject.fact(
        "repair",
        format!(
            "would fill {} and lift {} values: {:.3e} of the flux is moved",
            repair.non_finite, repair.negative, repair.flux_moved
        ),
    );
    if let Some(worst) = report.negative.worst {
        let is_much = repair.flux_moved.is_nan() || repair.flux_moved > NEGATIVE_FLUX_MAX;
        let severity = if is_much { Severity::Error } else { Severity::Warning };
        let message = format!("{} values are negative", report.negative.count);
        let help = "ringing of a resampling filter, most often: a bake lifts them to 0";
        subject
            .findings
            .push(Finding::new(Check::Negative, severity, message).at(worst.to_string()).with_help(help));
    }
    Ok(())
}

/// Sums over all texels that are light.
struct Sums {
    flux: f64,
    /// Solid angle of texels that binary16 and RGB9E5 change by more than [`LOSS`].
    lost: [f64; 2],
    /// Luminance and solid angle of every lit texel.
    texels: Vec<(f32, f32)>,
}

/// The brightest texels.
struct Brightest {
    /// Their share of the flux.
    share: f64,
    /// Their number.
    count: usize,
    /// The least luminance among them.
    threshold: f64,
}

impl Sums {
    fn of(texels: &impl Texels, scale_log2: i32, cancel: Cancel) -> Result<Sums, Cancelled> {
        let shape = texels.shape();
        let (weights, row) = (Weights::new(shape), row_texels(shape));
        let scale = libm::exp2(f64::from(-scale_log2));
        // Rows are independent, and their sums are added in order.
        let of_row = |(y, values): (usize, &[f32])| {
            cancel.check()?;
            let mut sums = Sums { flux: 0.0, lost: [0.0; 2], texels: Vec::with_capacity(row) };
            for (x, texel) in values.as_chunks::<3>().0.iter().enumerate() {
                let light = luminance(*texel);
                if !texel.iter().all(|value| value.is_finite()) || light <= 0.0 {
                    continue;
                }
                let weight = weights.of(y * row + x);
                sums.flux += light * weight;
                sums.texels.push((light as f32, weight as f32));
                let scaled = texel.map(|value| f64::from(value) * scale);
                let shared = rgb9e5::decode(rgb9e5::encode(scaled));
                let halves = scaled.map(|value| f16::from_f64(value).to_f32());
                for (lost, stored) in sums.lost.iter_mut().zip([halves, shared]) {
                    let is_lost = (luminance(stored) / (light * scale) - 1.0).abs() > LOSS;
                    *lost += if is_lost { weight } else { 0.0 };
                }
            }
            Ok(sums)
        };
        let rows: Vec<(usize, &[f32])> = texels.rgb().chunks(3 * row).enumerate().collect();
        let rows = rows.into_par_iter().map(of_row).collect::<Result<Vec<_>, Cancelled>>()?;
        let mut all = Sums { flux: 0.0, lost: [0.0; 2], texels: Vec::with_capacity(texels.rgb().len() / 3) };
        for row in rows {
            all.flux += row.flux;
            (0..2).for_each(|i| all.lost[i] += row.lost[i]);
            all.texels.extend(row.texels);
        }
        Ok(all)
    }

    /// The brightest [`SUN_SHARE_OF_TEXELS`], at least one texel.
    fn sun(&self) -> Brightest {
        let count =
            ((self.texels.len() as f64 * SUN_SHARE_OF_TEXELS) as usize).clamp(1, self.texels.len().max(1));
        let mut texels = self.texels.clone();
        if texels.is_empty() {
            return Brightest { share: 0.0, count: 0, threshold: f64::INFINITY };
        }
        texels.select_nth_unstable_by(count - 1, |a, b| b.0.total_cmp(&a.0));
        let mut brightest = texels[..count].to_vec();
        brightest.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let flux: f64 = brightest.iter().map(|(light, weight)| f64::from(*light) * f64::from(*weight)).sum();
        let share = if self.flux > 0.0 { flux / self.flux } else { 0.0 };
        Brightest { share, count, threshold: f64::from(brightest[count - 1].0) }
    }

    /// The luminance that this share of the lit texels is below; 0 where nothing is lit.
    fn quantile(&self, share: f64) -> f64 {
        let mut lights: Vec<f32> = self.texels.iter().map(|(light, _)| *light).collect();
        if lights.is_empty() {
            return 0.0;
        }
        let at = ((lights.len() - 1) as f64 * share) as usize;
        f64::from(*lights.select_nth_unstable_by(at, f32::total_cmp).1)
    }
}

fn light(report: &TexelReport, sums: &Sums, sun: &Brightest, subject: &mut Subject) {
    if sums.texels.is_empty() {
        let finding = Finding::new(Check::Black, Severity::Warning, "no texel holds light");
        subject.findings.push(finding.with_help("maps baked of it are black, which is what they should be"));
        return;
    }
    let (dark, middle) = (sums.quantile(0.001), sums.quantile(0.5));
    let brightest = f64::from(report.max);
    subject.fact(
        "values",
        format!("{:.4e} to {:.4e}, mean luminance {:.4e}", report.min, report.max, report.mean_luminance),
    );
    subject.fact(
        "dynamic range",
        format!(
            "{:.1} stops above the median luminance, {:.1} below (0.1 % of the lit texels are darker)",
            libm::log2(brightest / middle),
            libm::log2(middle / dark)
        ),
    );
    let share = format!("{:.2} % of the flux", 100.0 * sun.share);
    let texels = format!(
        "brightest {}",
        if sun.count == 1 { "texel".to_owned() } else { format!("{} texels", sun.count) }
    );
    subject.fact("sun", format!("{texels} (0.01 %): {share}, from {:.4e} on", sun.threshold));
    if sun.share > SUN_SHARE_OF_FLUX {
        let message = format!("the {texels} hold {share}");
        let help = "samplers miss them or show fireflies; Kiln convolves them exactly, and `sun = \"extract\"` makes a light of them";
        subject.findings.push(Finding::new(Check::SunFlux, Severity::Note, message).with_help(help));
    }
}

fn formats(report: &TexelReport, sums: &Sums, subject: &mut Subject) {
    let scale = kiln_bake::scale_log2(report.max);
    let scaled = if scale > 0 { format!(" divided by 2^{scale}") } else { String::new() };
    let formats = [(Check::F16Loss, "rgba16f", sums.lost[0]), (Check::Rgb9e5Loss, "rgb9e5", sums.lost[1])];
    for (check, format, lost) in formats {
        let share = lost / (4.0 * std::f64::consts::PI);
        subject.fact(
            format,
            format!("changes the luminance of {:.4} % of the sphere by more than 1 %{scaled}", 100.0 * share),
        );
        if share > LOST_SHARE_MAX {
            let message = format!(
                "{format}{scaled} changes the luminance of {:.2} % of the sphere by more than 1 %",
                100.0 * share
            );
            let help = "what is that dark beside such a sun is hardly seen; `format = \"rgba32f\"` keeps it";
            subject.findings.push(Finding::new(check, Severity::Note, message).with_help(help));
        }
    }
}

/// Where an image does not continue; names of the borders for the picture.
fn seams(environment: &Environment, subject: &mut Subject) -> Vec<&'static str> {
    let mut marked = Vec::new();
    let mut judge = |subject: &mut Subject,
                     check: Check,
                     what: String,
                     seam: Seam,
                     border: Option<&'static str>| {
        let numbers =
            format!("contrast {:.2} %, {:.2} % beside it", 100.0 * seam.across, 100.0 * seam.beside);
        if seam.is_visible() {
            let help =
                "the panorama was cropped, resized without wrapping, or stitched: mend it where it was made";
            subject.findings.push(
                Finding::new(check, Severity::Warning, format!("{what} is a seam: {numbers}"))
                    .with_help(help),
            );
            marked.extend(border);
        }
        numbers
    };
    match environment {
        Environment::Panorama(panorama) => {
            match wrap_column(panorama) {
                Some(seam) => {
                    let numbers =
                        judge(subject, Check::WrapColumn, "the wrap column".to_owned(), seam, Some("wrap"));
                    subject.fact("wrap column", numbers);
                }
                None => subject
                    .skip(Check::WrapColumn.name(), "fewer than 8 columns have no inside to compare with"),
            }
            for (is_last, pole) in [(false, "top"), (true, "bottom")] {
                let Some(spread) = pole_spread(panorama, is_last) else {
                    subject.skip(Check::Poles.name(), "fewer than 17 rows have no inside to compare with");
                    break;
                };
                subject.fact(
                    &format!("{pole} row"),
                    format!(
                        "contrast {:.2} %, {:.2} % eight rows further",
                        100.0 * spread.across,
                        100.0 * spread.beside
                    ),
                );
                // Around a point contrast grows with the distance from it: nothing of the picture is left at half a row.
                if spread.across > 0.05 && spread.across > 0.5 * spread.beside {
                    let message = format!(
                        "the {pole} row is one point and holds many values: contrast {:.2} %",
                        100.0 * spread.across
                    );
                    let help = "harmless for light, as the row is small; the skybox shows a star there: cropped, padded, or resized without filtering";
                    subject
                        .findings
                        .push(Finding::new(Check::Poles, Severity::Note, message).with_help(help));
                    marked.push(pole);
                }
            }
        }
        Environment::Cube(cube) => {
            let edges = cube_edges(cube, None);
            if edges.is_empty() {
                subject.skip(Check::CubeEdges.name(), "faces under 8 texels have no inside to compare with");
            }
            for (faces, seam) in edges {
                _ = judge(subject, Check::CubeEdges, format!("the edge of {faces}"), seam, None);
            }
        }
    }
    marked
}
