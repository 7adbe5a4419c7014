//! Actions of `[env.NAME]`: decode, analyse, and one for each map level.

use std::sync::Arc;

use kiln_bake::{
    Accuracy, Analysis, AnalysisRequest, BakeError, Bulk, Cancel, Cancelled, EncodedLevel, TexelFormat,
};
use kiln_build::{
    Action, ActionId, ActionOutput, Command, Engine, Error, Input, Inputs, MemoryNeed, little_memory,
};
use kiln_diagnostic::Diagnostic;
use kiln_image::{Cube, DecodeError, Decoded, Limits, Panorama, TexelError, TexelPolicy, check_texels};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::blob::{decode_panorama, encode_panorama, panorama_size};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use crate::{EnvConfig, Range};

/// Levels of a specular chain end at this face size: smaller ones cannot carry a rough lobe's gradient
/// through bilinear lookups.
const SMALLEST_SPECULAR_FACE: usize = 4;
/// Skybox faces follow the panorama (a quarter of its width sees as many texels), within these limits.
const SKYBOX_FACES: std::ops::RangeInclusive<usize> = 16..=2048;
/// Radiance coefficients published as `env/NAME/sh`: bands 0 … 2.
const SH_ORDER: usize = 2;
const SH_CONVENTION: &str = "value(direction) = sum over l, m of c[l(l+1)+m] Y_lm(direction); real orthonormal basis \
    without Condon-Shortley phase over world axes (+Y up): Y_00 = 0.282095, Y_1-1 = 0.488603 y, Y_10 = 0.488603 z, \
    Y_11 = 0.488603 x; linear Rec. 709; irradiance_over_pi holds E/pi";

/// The environment at the size of the specular chain's first level: an output of the skybox action, which has that
/// level already unless the chain is larger than the skybox.
const MIRROR: &str = "mirror";

/// The one output of an action that makes one level. Which level of which target it becomes is not the action's business:
/// equal maps share a key.
const LEVEL: &str = "level";

/// The skybox's levels: outputs `levels/mip0` … of its action.
const LEVELS: &str = "levels";

/// What later steps must know of a decoded panorama without reading it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Report {
    width: usize,
    height: usize,
    max: f32,
}

/// Adds the actions and targets of one environment.
pub(crate) fn plan_environment(planner: &mut Planner, engine: &Engine, name: &str, env: &EnvConfig) {
    let steps = Steps { name, env };
    let decode = planner.graph.add(steps.decode(engine));
    let analyse = planner.graph.add(steps.analyse(decode));
    let skybox = planner.graph.add(steps.skybox(decode));
    for action in [decode, skybox] {
        planner.subjects.insert(action, env.source.clone());
    }
    let irradiance = planner.graph.add(steps.irradiance(decode, analyse));
    let sh = planner.graph.add(steps.sh(analyse));
    let target = |map: &str| format!("env/{name}/{map}");
    planner.target(target("skybox"), "cube", json!({}), vec![PartSpec::Levels(skybox)]);
    let meta = json!({"size": env.irradiance_size, "levels": 1});
    planner.target(
        target("irradiance"),
        "cube",
        meta,
        vec![PartSpec::One { action: irradiance, output: LEVEL.to_owned(), part: "mip0".to_owned() }],
    );
    planner.target(target("sh"), "sh", json!({"order": SH_ORDER}), vec![PartSpec::one(sh, "json")]);
    let count = specular_level_count(env.size);
    let levels = (0..count).map(|level| {
        let part = format!("mip{level}");
        // Roughness 0 sees the environment itself.
        if level == 0 {
            return PartSpec::One { action: skybox, output: MIRROR.to_owned(), part };
        }
        let action = planner.graph.add(steps.specular_level(decode, analyse, level, count));
        PartSpec::One { action, output: LEVEL.to_owned(), part }
    });
    let levels = levels.collect();
    let meta = json!({"size": env.size, "levels": count, "law": "roughness = mip / (levels - 1)"});
    planner.target(target("specular"), "cube", meta, levels);
}

/// Levels of a chain whose first has `size` texels along an edge.
fn specular_level_count(size: usize) -> usize {
    let smallest = SMALLEST_SPECULAR_FACE.min(size);
    (size / smallest).ilog2() as usize + 1
}

struct Steps<'a> {
    name: &'a str,
    env: &'a EnvConfig,
}

impl Steps<'_> {
    fn action(
        &self,
        step: &str,
        command: Command,
        inputs: Vec<Input>,
        perform: impl Fn(&Inputs) -> Result<ActionOutput, Error> + Send + Sync + 'static,
    ) -> Action {
        let name = format!("{} env/{}{step}", command.kind, self.name);
        let memory = little_memory();
        Action { name, command, inputs, rank: rank::ENVIRONMENT, memory, perform: Arc::new(perform) }
    }

    /// The need of a step that reads an analysis first and makes a map of this size.
    fn map_memory(&self, alpha: f64, face_size: usize) -> Arc<MemoryNeed> {
        let error = self.env.error;
        needs(move |lengths| kiln_bake::memory::specular_level(lengths[0], error, alpha, face_size))
    }

    fn encoding(&self) -> Value {
        json!({"format": format_name(self.env.format), "range": range_name(self.env.range)})
    }

    fn decode(&self, engine: &Engine) -> Action {
        let source = engine.source(&self.env.source);
        let input = Input::Source { path: self.env.source.clone(), digest: source.digest() };
        let policy = self.env.texels;
        let unreadable = unreadable(engine, &self.env.source);
        let params = json!({"texels": policy_name(policy), "unreadable": unreadable});
        let command = command("decode", 2, params, &["panorama", "report"]);
        let action = self.action("", command, vec![input], move |inputs| {
            Ok(match inputs.bytes(0)? {
                Some(bytes) => decode(&bytes, policy, cancel(inputs))?,
                None => failure(no_content("environment", unreadable.as_deref())),
            })
        });
        Action { memory: needs(|lengths| kiln_bake::memory::decode(lengths[0])), ..action }
    }

    fn analyse(&self, decode: ActionId) -> Action {
        let count = specular_level_count(self.env.size);
        let roughness = if count > 1 { kiln_bake::roughness_of_level(1, count) } else { 1.0 };
        let request = AnalysisRequest {
            alpha_min: roughness * roughness,
            sheen_alpha_min: None,
            error: self.env.error,
        };
        let params = json!({"alpha_min": request.alpha_min, "error": request.error});
        let command = command("analyse", 1, params, &["analysis"]);
        let action = self.action("", command, vec![output(decode, "panorama")], move |inputs| {
            let cancel = cancel(inputs);
            let panorama = panorama(inputs, 0)?;
            let analysis = kiln_bake::analyse(&panorama, &request, cancel).map_err(ended)?;
            let meta = json!({"detail": {"band_limit": analysis.band_limit(), "mean": analysis.mean()}});
            Ok(success("analysis", analysis.to_bytes(cancel).map_err(ended)?, meta))
        });
        Action {
            memory: needs(|lengths| {
                let (width, height) = panorama_size(lengths[0]);
                kiln_bake::memory::analyse(width, height)
            }),
            ..action
        }
    }

    fn skybox(&self, decode: ActionId) -> Action {
        let env = self.env.clone();
        let inputs = vec![output(decode, "panorama"), output(decode, "report")];
        let mut params = self.encoding();
        params["mirror_size"] = json!(env.size);
        let mirror_size = env.size;
        let command = command("skybox", 2, params, &[LEVELS, MIRROR]);
        let action = self.action("", command, inputs, move |inputs| {
            let cancel = cancel(inputs);
            let panorama = panorama(inputs, 0)?;
            let report = report(inputs, 1)?;
            let face_size = skybox_face_size(report.width);
            let levels = kiln_bake::skybox(&panorama, face_size, cancel).map_err(ended)?;
            let encode = Encode::new(&env, &report);
            let encoded: Vec<EncodedLevel> =
                levels.iter().map(|cube| encode.level(cube, cancel)).collect::<Result<_, _>>()?;
            let mut shared = encode.facts();
            shared["size"] = json!(face_size);
            shared["levels"] = json!(levels.len());
            let rounding = encoded.iter().map(|level| level.rounding_rms).fold(0.0, f64::max);
            let meta = json!({"shared": shared, "detail": {"rounding_rms": rounding}});
            let mirror = match levels.iter().position(|level| level.face_size == env.size) {
                Some(level) => encoded[level].bytes.clone(),
                None => {
                    let levels = kiln_bake::skybox(&panorama, env.size, cancel).map_err(ended)?;
                    encode.level(&levels[0], cancel)?.bytes
                }
            };
            let name = |index: usize| format!("{LEVELS}/mip{index}");
            let named = encoded.into_iter().enumerate().map(|(index, level)| (name(index), level.bytes));
            let outputs = named.chain([(MIRROR.to_owned(), mirror)]).collect();
            Ok(ActionOutput { outputs, meta, diagnostics: encode.notes() })
        });
        Action {
            memory: needs(move |lengths| {
                let (width, height) = panorama_size(lengths[0]);
                let own = skybox_face_size(width);
                let mirror =
                    if mirror_size > own { kiln_bake::memory::skybox(width, height, mirror_size) } else { 0 };
                kiln_bake::memory::skybox(width, height, own) + mirror
            }),
            ..action
        }
    }

    fn irradiance(&self, decode: ActionId, analyse: ActionId) -> Action {
        let env = self.env.clone();
        let mut params = self.encoding();
        params["size"] = json!(env.irradiance_size);
        let memory = self.map_memory(1.0, env.irradiance_size);
        let inputs = vec![output(analyse, "analysis"), output(decode, "report")];
        let action = self.action("", command("irradiance", 1, params, &[LEVEL]), inputs, move |inputs| {
            let cancel = cancel(inputs);
            let analysis = analysis(inputs, 0)?;
            let map = kiln_bake::irradiance(&analysis, env.irradiance_size, cancel).map_err(ended)?;
            let detail = accuracy_facts(&map.accuracy);
            Encode::new(&env, &report(inputs, 1)?).output(LEVEL, &map.cube, detail, cancel)
        });
        Action { memory, ..action }
    }

    fn sh(&self, analyse: ActionId) -> Action {
        let params = json!({"order": SH_ORDER});
        self.action("", command("sh", 1, params, &["json"]), vec![output(analyse, "analysis")], |inputs| {
            let analysis = analysis(inputs, 0)?;
            let mut text = serde_json::to_vec_pretty(&json!({
                "convention": SH_CONVENTION,
                "order": SH_ORDER,
                "radiance": kiln_bake::sh(&analysis, SH_ORDER).coefficients,
                "irradiance_over_pi": kiln_bake::irradiance_sh(&analysis).coefficients,
            }))
            .unwrap_or_default();
            text.push(b'\n');
            Ok(success("json", text, json!({})))
        })
    }

    fn specular_level(&self, decode: ActionId, analyse: ActionId, level: usize, count: usize) -> Action {
        let env = self.env.clone();
        let roughness = kiln_bake::roughness_of_level(level, count);
        let face_size = env.size >> level;
        let mut params = self.encoding();
        params["size"] = json!(face_size);
        params["alpha"] = json!(roughness * roughness);
        let memory = self.map_memory(roughness * roughness, face_size);
        let inputs = vec![output(analyse, "analysis"), output(decode, "report")];
        let command = command("prefilter", 1, params, &[LEVEL]);
        let action = self.action(&format!("/specular mip {level}"), command, inputs, move |inputs| {
            let cancel = cancel(inputs);
            let analysis = analysis(inputs, 0)?;
            let alpha = roughness * roughness;
            let map = kiln_bake::specular_level(&analysis, alpha, face_size, cancel).map_err(ended)?;
            let mut detail = accuracy_facts(&map.accuracy);
            detail["roughness"] = json!(roughness);
            Encode::new(&env, &report(inputs, 1)?).output(LEVEL, &map.cube, detail, cancel)
        });
        Action { memory, ..action }
    }
}

fn decode(bytes: &[u8], policy: TexelPolicy, cancel: Cancel) -> Result<ActionOutput, Error> {
    let fail = |error: &dyn std::fmt::Display| Ok(failure(Diagnostic::error(error.to_string())));
    let decoded = match kiln_image::decode(bytes, &Limits::default(), cancel) {
        Ok(decoded) => decoded,
        Err(DecodeError::Cancelled(cancelled)) => return Err(ended(cancelled)),
        Err(error) => {
            let help = "export the panorama again as .hdr or .exr";
            return Ok(failure(Diagnostic::error(error.to_string()).with_help(help)));
        }
    };
    let Decoded { mut image, format, notes } = decoded;
    let mut diagnostics: Vec<Diagnostic> = notes.into_iter().map(Diagnostic::note).collect();
    match policy.apply(&mut image, cancel) {
        Err(TexelError::Cancelled(cancelled)) => return Err(ended(cancelled)),
        Err(error) => return fail(&error),
        Ok(repair) if repair.non_finite + repair.negative > 0 => {
            let message = format!(
                "repaired {} non-finite and {} negative values; relative flux moved {:.2e}",
                repair.non_finite, repair.negative, repair.flux_moved
            );
            diagnostics.push(Diagnostic::warning(message));
        }
        Ok(_) => {}
    }
    let max = check_texels(&image, cancel).map_err(ended)?.max;
    let (width, height) = (image.width, image.height);
    let panorama = match Panorama::new(image) {
        Ok(panorama) => panorama,
        Err(error) => return fail(&error),
    };
    let report = serde_json::to_vec(&Report { width, height, max }).unwrap_or_default();
    let meta = json!({"detail": {"format": format, "width": width, "height": height, "max": max}});
    let panorama = Bulk::new(panorama);
    let stored = encode_panorama(&panorama, cancel).map_err(ended)?;
    let outputs = vec![("panorama".to_owned(), stored), ("report".to_owned(), report)];
    Ok(ActionOutput { outputs, meta, diagnostics })
}

/// How the maps of one environment are stored: all with the same format and scale.
struct Encode {
    format: TexelFormat,
    scale_log2: i32,
    max: f32,
}

impl Encode {
    fn new(env: &EnvConfig, report: &Report) -> Encode {
        let scale_log2 = kiln_bake::scale_log2(report.max);
        let (format, scale_log2) = match (env.format, env.range) {
            (TexelFormat::Rgba32Float, _) => (TexelFormat::Rgba32Float, 0),
            (TexelFormat::Rgba16Float, Range::F32) if scale_log2 > 0 => (TexelFormat::Rgba32Float, 0),
            (format, _) => (format, scale_log2),
        };
        Encode { format, scale_log2, max: report.max }
    }

    fn level(&self, cube: &Cube, cancel: Cancel) -> Result<EncodedLevel, Error> {
        kiln_bake::encode_level(cube, self.format, self.scale_log2, cancel).map_err(ended)
    }

    fn facts(&self) -> Value {
        json!({"format": format_name(self.format), "scale_log2": self.scale_log2})
    }

    fn output(
        &self,
        name: &str,
        cube: &Cube,
        mut detail: Value,
        cancel: Cancel,
    ) -> Result<ActionOutput, Error> {
        let level = self.level(cube, cancel)?;
        detail["rounding_rms"] = json!(level.rounding_rms);
        Ok(success(name, level.bytes, json!({"shared": self.facts(), "detail": detail})))
    }

    /// Said once per environment, with the skybox.
    fn notes(&self) -> Vec<Diagnostic> {
        if self.scale_log2 == 0 {
            return Vec::new();
        }
        let message = format!(
            "the peak {:.3e} is above the half float's 65504: texels are stored divided by 2^{}",
            self.max, self.scale_log2
        );
        vec![Diagnostic::note(message).with_help("`range = \"f32\"` stores 32-bit floats instead")]
    }
}

fn accuracy_facts(accuracy: &Accuracy) -> Value {
    json!({
        "band_limit": accuracy.band_limit,
        "rms_bound": accuracy.rms_bound,
        "sup_bound": accuracy.sup_bound,
        "clamped_flux": accuracy.clamped_flux,
    })
}

fn skybox_face_size(width: usize) -> usize {
    (width / 4).max(1).next_power_of_two().clamp(*SKYBOX_FACES.start(), *SKYBOX_FACES.end())
}

fn output(action: ActionId, output: &str) -> Input {
    Input::Output { action, output: output.to_owned() }
}

pub(crate) fn command(kind: &str, recipe: u32, params: Value, outputs: &[&str]) -> Command {
    let outputs = outputs.iter().map(|&output| output.to_owned()).collect();
    Command { kind: kind.to_owned(), recipe, params, outputs }
}

pub(crate) fn success(name: &str, bytes: Vec<u8>, meta: Value) -> ActionOutput {
    ActionOutput { outputs: vec![(name.to_owned(), bytes)], meta, diagnostics: Vec::new() }
}

pub(crate) fn failure(diagnostic: Diagnostic) -> ActionOutput {
    ActionOutput { outputs: Vec::new(), meta: Value::Null, diagnostics: vec![diagnostic] }
}

/// Freed elsewhere: giving a large one back to the system takes longer than a cancelled step may go on.
fn panorama(inputs: &Inputs, index: usize) -> Result<Bulk<Panorama>, Error> {
    decode_panorama(&inputs.required(index)?, cancel(inputs)).map(Bulk::new)
}

fn analysis(inputs: &Inputs, index: usize) -> Result<Analysis, Error> {
    Analysis::from_bytes(&inputs.required(index)?, cancel(inputs)).map_err(|error| match error {
        BakeError::Cancelled(cancelled) => ended(cancelled),
        error => damaged("an analysis", &error),
    })
}

fn report(inputs: &Inputs, index: usize) -> Result<Report, Error> {
    serde_json::from_slice(&inputs.required(index)?).map_err(|error| damaged("a report", &error))
}

pub(crate) fn cancel<'a>(inputs: &'a Inputs) -> Cancel<'a> {
    Cancel::when(inputs.cancel())
}

/// What a step says that was ended early.
pub(crate) fn ended(_: Cancelled) -> Error {
    Error::Cancelled
}

/// A need in the recipes' numbers.
fn needs(estimate: impl Fn(&[usize]) -> usize + Send + Sync + 'static) -> Arc<MemoryNeed> {
    Arc::new(move |lengths| {
        let lengths: Vec<usize> =
            lengths.iter().map(|&length| usize::try_from(length).unwrap_or(usize::MAX)).collect();
        estimate(&lengths) as u64
    })
}

fn damaged(what: &str, error: &dyn std::fmt::Display) -> Error {
    Error::Action { action: format!("read {what}"), reason: error.to_string() }
}

pub(crate) fn format_name(format: TexelFormat) -> &'static str {
    match format {
        TexelFormat::Rgba16Float => "rgba16f",
        TexelFormat::Rgba32Float => "rgba32f",
        TexelFormat::Rgb9e5Ufloat => "rgb9e5",
        TexelFormat::R11g11b10Ufloat => "r11g11b10",
        TexelFormat::Bc6hUfloat => "bc6h",
    }
}

fn range_name(range: Range) -> &'static str {
    match range {
        Range::Scale => "scale",
        Range::F32 => "f32",
    }
}

fn policy_name(policy: TexelPolicy) -> &'static str {
    match policy {
        TexelPolicy::Repair => "repair",
        TexelPolicy::Error => "error",
        TexelPolicy::Keep => "keep",
    }
}
