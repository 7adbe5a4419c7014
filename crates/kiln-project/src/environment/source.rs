//! From a source's files to what lights a scene: decoded, checked, repaired, its sun apart.

use kiln_bake::{Bulk, Cancel, NoSun, SunExtraction, SunRequest, extract_sun};
use kiln_build::{ActionOutput, Error};
use kiln_diagnostic::Diagnostic;
use kiln_image::{
    DecodeError, DecodedEnvironment, Environment, Layout, Limits, TexelError, TexelPolicy, TexelReport,
    check_texels, decode_environment, environment_from_faces, limit_radiance, repair_texels,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{ended, failure};
use crate::EnvConfig;
use crate::blob::encode_environment;

/// What later steps must know of a decoded environment without reading it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Report {
    /// Edge of a skybox that shows all of it.
    pub(super) skybox_size: usize,
    /// Largest value.
    pub(super) max: f32,
    /// Format, layout, size, and what was wrong with the texels: for the skybox's facts.
    pub(super) source: Value,
}

/// Skybox faces follow the source (a quarter of a panorama's width sees as many texels), within these limits.
const SKYBOX_FACES: std::ops::RangeInclusive<usize> = 16..=2048;

pub(super) fn skybox_face_size(panorama_width: usize) -> usize {
    (panorama_width / 4).max(1).next_power_of_two().clamp(*SKYBOX_FACES.start(), *SKYBOX_FACES.end())
}

/// Decodes a source of one file, or of six.
pub(super) fn decode(files: &[&[u8]], env: &EnvConfig, cancel: Cancel) -> Result<ActionOutput, Error> {
    let limits = Limits::default();
    let decoded = match <[&[u8]; 6]>::try_from(files) {
        Ok(faces) => environment_from_faces(faces, &limits, cancel),
        Err(_) => decode_environment(files[0], env.layout, &limits, cancel),
    };
    let mut decoded = match decoded {
        Ok(decoded) => decoded,
        Err(DecodeError::Cancelled(cancelled)) => return Err(ended(cancelled)),
        Err(error) => return Ok(failure(explain(&error))),
    };
    // That a panorama is one goes without saying; the layout stands in the facts.
    let said = usize::from(decoded.layout == Layout::Equirect && env.layout.is_none());
    // 8 bits hold no sun, and people take such maps for the real thing.
    let is_ldr = ["PNG", "JPEG"].contains(&decoded.format);
    let say = if is_ldr { Diagnostic::warning } else { Diagnostic::note };
    let mut diagnostics: Vec<Diagnostic> = decoded.notes.drain(..).skip(said).map(say).collect();
    let found = check_texels(&decoded, cancel).map_err(ended)?;
    let mut flux_moved = 0.0;
    // Light maps are made of radiance, whatever the skybox keeps.
    let mut light = (env.texels == TexelPolicy::Keep).then(|| Bulk::new(decoded.clone()));
    if let Some(light) = &mut light {
        flux_moved = repair_texels(&mut **light, cancel).map_err(ended)?.flux_moved;
    }
    match env.texels.apply(&mut decoded, cancel) {
        Err(TexelError::Cancelled(cancelled)) => return Err(ended(cancelled)),
        Err(error) => {
            let help = "`texels = \"repair\"` mends such texels and says what that moved";
            return Ok(failure(Diagnostic::error(error.to_string()).with_help(help)));
        }
        Ok(repair) => {
            flux_moved = f64::max(flux_moved, repair.flux_moved);
            diagnostics.extend(defects(&found, env.texels));
            if repair.non_finite + repair.negative > 0 {
                let moved = if repair.flux_moved.is_finite() {
                    format!("relative flux moved {:.2e}", repair.flux_moved)
                } else {
                    "no light is left".to_owned()
                };
                let message = format!(
                    "repaired {} non-finite and {} negative values; {moved}",
                    repair.non_finite, repair.negative
                );
                diagnostics.push(Diagnostic::warning(message));
            }
        }
    }
    if let Some(max) = env.radiance_max {
        let mut limited = limit_radiance(&mut decoded, max as f32, cancel).map_err(ended)?;
        if let Some(light) = &mut light {
            // Kept negative texels would make nonsense of a share of the light.
            limited = limit_radiance(&mut **light, max as f32, cancel).map_err(ended)?;
        }
        if limited.limited.count > 0 {
            let lost = 100.0 * limited.fraction_lost();
            let message = format!(
                "`max_radiance = {max}` cut {} texels; {lost:.3} % of the light is gone",
                limited.limited.count
            );
            diagnostics.push(Diagnostic::warning(message));
        }
    }
    let mut outputs = Vec::new();
    if env.is_sun_extracted {
        let (facts, note) = take_sun(&mut decoded, cancel)?;
        diagnostics.push(note);
        let mut text = serde_json::to_vec_pretty(&facts).unwrap_or_default();
        text.push(b'\n');
        outputs.push(("sun".to_owned(), text));
    }
    let max = check_texels(&decoded, cancel).map_err(ended)?.max;
    let DecodedEnvironment { environment, layout, format, .. } = decoded;
    let skybox_size = match &environment {
        Environment::Panorama(panorama) => skybox_face_size(panorama.width()),
        Environment::Cube(cube) => cube.face_size.min(*SKYBOX_FACES.end()),
    };
    let source = json!({
        "format": format,
        "layout": layout.name(),
        "size": environment.size_text(),
        "texels": {
            "nan": found.nan.count,
            "infinite": found.infinite.count,
            "negative": found.negative.count,
            "out_of_gamut": found.out_of_gamut.count,
            "above_f16": found.above_f16.count,
            "flux_moved": if flux_moved.is_finite() { json!(flux_moved) } else { json!(flux_moved.to_string()) },
        },
    });
    // Where nothing is finite there is no largest value.
    let max = if max.is_finite() { max } else { 0.0 };
    let meta = json!({"detail": source});
    let report = serde_json::to_vec(&Report { skybox_size, max, source }).unwrap_or_default();
    let environment = Bulk::new(environment);
    if let Some(light) = light {
        let light = Bulk::new(light.into_inner().environment);
        outputs.push(("light".to_owned(), encode_environment(&light, cancel).map_err(ended)?));
    }
    let stored = encode_environment(&environment, cancel).map_err(ended)?;
    outputs.extend([("environment".to_owned(), stored), ("report".to_owned(), report)]);
    Ok(ActionOutput { outputs, meta, diagnostics })
}

fn explain(error: &DecodeError) -> Diagnostic {
    let help = match error {
        DecodeError::UnknownLayout { .. } | DecodeError::WrongLayout { .. } => {
            "set `layout` in kiln.toml (or --layout), or export the map as a 2:1 panorama"
        }
        DecodeError::TooLarge { .. } => "export the map smaller: 16384 x 8192 is the largest",
        _ => "export the map again as .hdr or .exr",
    };
    Diagnostic::error(error.to_string()).with_help(help)
}

/// What is wrong with the texels, with the place of the worst.
fn defects(found: &TexelReport, policy: TexelPolicy) -> Vec<Diagnostic> {
    let mut said = Vec::new();
    let mut say = |what: &str, defect: &kiln_image::Defect| {
        if let (true, Some(worst)) = (defect.count > 0, defect.worst) {
            said.push(Diagnostic::note(format!("{} {what} values, the worst {worst}", defect.count)));
        }
    };
    say("NaN", &found.nan);
    say("infinite", &found.infinite);
    say("negative", &found.negative);
    say("above-65504 (beyond half floats)", &found.above_f16);
    say("out-of-gamut (negative in Rec. 709 by conversion, kept)", &found.out_of_gamut);
    if policy == TexelPolicy::Keep && found.nan.count + found.infinite.count + found.negative.count > 0 {
        let message =
            "`texels = \"keep\"` keeps them in the skybox alone: light maps are made from repaired texels";
        said.push(Diagnostic::note(message));
    }
    said
}

/// Takes the sun out of an environment; a cube becomes a panorama by it.
fn take_sun(decoded: &mut DecodedEnvironment, cancel: Cancel) -> Result<(Value, Diagnostic), Error> {
    let panorama = match &decoded.environment {
        Environment::Panorama(panorama) => panorama.clone(),
        Environment::Cube(cube) => kiln_bake::panorama_of_cube(cube, cancel).map_err(ended)?,
    };
    let found: Result<SunExtraction, NoSun> =
        extract_sun(&panorama, &SunRequest::USUAL, cancel).map_err(ended)?;
    Ok(match found {
        Ok(SunExtraction { sun, remaining, flux }) => {
            decoded.environment = Environment::Panorama(remaining);
            let share = 100.0 * flux.light.iter().sum::<f64>() / flux.original.iter().sum::<f64>();
            let [x, y, z] = sun.direction;
            let note = format!(
                "the sun towards ({x:.3}, {y:.3}, {z:.3}), {:.2} degrees wide, is a light of its own with {share:.1} % of the flux",
                sun.angular_diameter.to_degrees()
            );
            let facts = json!({
                "light": {
                    "direction": sun.direction,
                    "irradiance": sun.irradiance,
                    "colour": sun.colour,
                    "solid_angle_sr": sun.solid_angle_sr,
                    "angular_diameter": sun.angular_diameter,
                    "texels": sun.texel_count,
                },
                "flux": {"original": flux.original, "light": flux.light, "remaining": flux.remaining},
                "convention": "direction points towards the light (right-handed, +Y up); irradiance on a surface that \
                    faces it, in the panorama's radiance times steradian, linear Rec. 709; light + remaining = original",
            });
            (facts, Diagnostic::note(note))
        }
        Err(reason) => {
            let facts = json!({"light": null, "reason": reason.to_string()});
            (facts, Diagnostic::note(format!("no sun was taken out: {reason}")))
        }
    })
}
