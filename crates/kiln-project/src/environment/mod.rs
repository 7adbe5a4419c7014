//! Actions of `[env.NAME]`: decode, analyse, one for each map level, and a measure of them all.

mod encode;
mod measure;
mod source;

use std::sync::Arc;

use kiln_bake::{
    Accuracy, Analysis, AnalysisRequest, BakeError, Bulk, Cancel, Cancelled, EncodedLevel, Lobe, Prefiltered,
};
use kiln_build::{
    Action, ActionId, ActionOutput, Command, Engine, Error, Input, Inputs, MemoryNeed, little_memory,
};
use kiln_diagnostic::Diagnostic;
use kiln_image::{Environment, Layout, Panorama, TexelPolicy};
use serde_json::{Value, json};

use crate::EnvDemand;
use crate::blob::{decode_environment, environment_size};
use crate::env_config::{EnvConfig, Range, format_name};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use encode::Encode;
use measure::Subject;
use source::Report;

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

/// Adds the actions and targets of what is read of one environment.
pub(crate) fn plan_environment(
    planner: &mut Planner,
    engine: &Engine,
    name: &str,
    env: &EnvConfig,
    demand: &EnvDemand,
) {
    let steps = Steps { name, env };
    let decode = planner.graph.add(steps.decode(engine));
    let skybox = planner.graph.add(steps.skybox(decode));
    for action in [decode, skybox] {
        planner.subjects.insert(action, env.sources[0].clone());
    }
    let target = |map: &str| format!("env/{name}/{map}");
    planner.target(target("skybox"), "cube", json!({}), vec![PartSpec::Folder(skybox, LEVELS)]);
    if env.is_sun_extracted {
        let sun = PartSpec::One { action: decode, output: "sun".to_owned(), part: "json".to_owned() };
        planner.target(target("sun"), "light", json!({}), vec![sun]);
    }
    if !demand.is_light_read() {
        return;
    }
    let mut plan = EnvPlan { planner, steps, decode, skybox, accuracy: Vec::new() };
    let ggx_levels = EnvDemand::levels(&demand.specular);
    if !demand.light.is_empty() || !ggx_levels.is_empty() {
        let analyse = plan.planner.graph.add(plan.steps.analyse(decode, LobeKind::Ggx));
        if !demand.light.is_empty() {
            plan.add_light(analyse);
        }
        if !ggx_levels.is_empty() {
            plan.add_chain("specular", LobeKind::Ggx, analyse, ggx_levels);
        }
    }
    if demand.is_sheen_read() {
        // Apart from the other lobes': what they are made of stays as it is when the first cloth appears.
        let analyse = plan.planner.graph.add(plan.steps.analyse(decode, LobeKind::Charlie));
        plan.add_chain("sheen", LobeKind::Charlie, analyse, EnvDemand::levels(&demand.sheen));
    }
    let EnvPlan { planner, accuracy, .. } = plan;
    if !accuracy.is_empty() {
        planner.target(target("accuracy"), "accuracy", json!({}), accuracy);
    }
}

/// Adds the one action that reads an environment's source.
pub(crate) fn plan_decode(planner: &mut Planner, engine: &Engine, name: &str, env: &EnvConfig) -> ActionId {
    let decode = planner.graph.add(Steps { name, env }.decode(engine));
    planner.graph.want(decode);
    decode
}

/// An environment's actions as they are added.
struct EnvPlan<'a, 'p> {
    planner: &'p mut Planner,
    steps: Steps<'a>,
    decode: ActionId,
    skybox: ActionId,
    /// What measured the maps so far.
    accuracy: Vec<PartSpec>,
}

impl EnvPlan<'_, '_> {
    /// Irradiance and its harmonics.
    fn add_light(&mut self, analyse: ActionId) {
        let Steps { name, env } = self.steps;
        let irradiance = self.planner.graph.add(self.steps.irradiance(self.decode, analyse));
        let sh = self.planner.graph.add(self.steps.sh(analyse));
        let meta = json!({"order": env.sh_order});
        self.planner.target(format!("env/{name}/sh"), "sh", meta, vec![PartSpec::one(sh, "json")]);
        let meta = json!({"size": env.irradiance_size, "levels": 1});
        let subject = Subject { level: irradiance, lobe: Lobe::Lambert, face_size: env.irradiance_size };
        let facts = self.measure("irradiance", vec![subject]);
        let parts = vec![level_part(irradiance, 0), facts];
        self.planner.target(format!("env/{name}/irradiance"), "cube", meta, parts);
    }

    /// Those levels of a chain that are read.
    fn add_chain(
        &mut self,
        map: &'static str,
        lobe: LobeKind,
        analyse: ActionId,
        levels: std::ops::Range<usize>,
    ) {
        let Steps { name, env } = self.steps;
        let count = env.level_count();
        let (mut parts, mut subjects) = (Vec::new(), Vec::new());
        for level in levels.clone() {
            let roughness = env.roughness(level);
            if lobe == LobeKind::Ggx && roughness == 0.0 {
                // Roughness 0 sees the environment itself.
                let (output, part) = (MIRROR.to_owned(), format!("mip{level}"));
                parts.push(PartSpec::One { action: self.skybox, output, part });
                continue;
            }
            let action = self.steps.level(map, lobe, self.decode, analyse, level);
            let action = self.planner.graph.add(action);
            parts.push(level_part(action, level));
            subjects.push(Subject {
                level: action,
                lobe: lobe.of()(roughness),
                face_size: env.face_size(level),
            });
        }
        if !subjects.is_empty() {
            parts.push(self.measure(map, subjects));
        }
        let roughness: Vec<f64> = (0..count).map(|level| env.roughness(level)).collect();
        let law = env.law.formula();
        let mut meta = json!({"size": env.size, "levels": count, "law": law, "roughness": roughness});
        if levels.len() < count {
            meta["first_level"] = json!(levels.start);
            meta["levels_of_law"] = json!(count);
        }
        self.planner.target(format!("env/{name}/{map}"), "cube", meta, parts);
    }

    /// Measures a map; its target knows the result, and so does the environment's.
    fn measure(&mut self, map: &'static str, subjects: Vec<Subject>) -> PartSpec {
        let action = self.planner.graph.add(self.steps.measure(map, self.decode, subjects));
        self.accuracy.push(PartSpec::One { action, output: "json".to_owned(), part: map.to_owned() });
        PartSpec::Facts(action)
    }
}

fn level_part(action: ActionId, level: usize) -> PartSpec {
    PartSpec::One { action, output: LEVEL.to_owned(), part: format!("mip{level}") }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum LobeKind {
    Ggx,
    Charlie,
}

/// A lobe by perceptual roughness.
type LobeOf = fn(f64) -> Lobe;

impl LobeKind {
    fn of(self) -> LobeOf {
        match self {
            LobeKind::Ggx => |roughness| Lobe::Ggx { alpha: roughness * roughness },
            LobeKind::Charlie => |roughness| Lobe::Charlie { alpha: sheen_alpha(roughness) },
        }
    }
}

#[derive(Clone, Copy)]
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
        let input =
            |path: &String| Input::Source { path: path.clone(), digest: engine.source(path).digest() };
        let inputs = self.env.sources.iter().map(input).collect();
        let unreadable = self.env.sources.iter().find_map(|path| unreadable(engine, path));
        let mut params = json!({"texels": policy_name(self.env.texels), "unreadable": unreadable});
        // What is not asked for is no part of the key.
        let optional = [
            ("layout", self.env.layout.map(|layout| json!(layout.name()))),
            ("max_radiance", self.env.radiance_max.map(|max| json!(max))),
            ("sun", self.env.is_sun_extracted.then(|| json!("extract"))),
        ];
        for (key, value) in optional {
            if let Some(value) = value {
                params[key] = value;
            }
        }
        let mut outputs = vec!["environment", "report"];
        if self.env.is_sun_extracted {
            outputs.push("sun");
        }
        if self.env.texels == TexelPolicy::Keep {
            outputs.push("light");
        }
        let env = self.env.clone();
        let action = self.action("", command("decode", 4, params, &outputs), inputs, move |inputs| {
            let files: Vec<Option<Arc<[u8]>>> =
                (0..env.sources.len()).map(|index| inputs.bytes(index)).collect::<Result<_, _>>()?;
            let present: Vec<&[u8]> = files.iter().flatten().map(|bytes| &**bytes).collect();
            if present.len() < files.len() {
                let missing = files.iter().position(Option::is_none).unwrap_or(0);
                let diagnostic = no_content("environment", unreadable.as_deref());
                return Ok(failure(diagnostic.in_file(&env.sources[missing])));
            }
            source::decode(&present, &env, cancel(inputs))
        });
        let is_octahedral = self.env.layout == Some(Layout::Octahedral);
        let is_container = self.env.sources[0].rsplit('.').next().is_some_and(is_container);
        let is_sun_extracted = self.env.is_sun_extracted;
        let is_kept = self.env.texels == TexelPolicy::Keep;
        let memory = move |lengths: &[usize]| {
            let bytes = lengths.iter().sum();
            let decode = if is_octahedral {
                kiln_bake::memory::decode_octahedral(bytes)
            } else if is_container {
                kiln_bake::memory::decode_container(bytes)
            } else {
                kiln_bake::memory::decode(bytes)
            };
            // A second environment without the sun, and one for light maps.
            decode * (1 + usize::from(is_sun_extracted) + usize::from(is_kept))
        };
        Action { memory: needs(memory), ..action }
    }

    /// The transform that all levels of a chain are made of, whichever of them are read: a level's texels do not depend on
    /// what else is read.
    fn analyse(&self, decode: ActionId, lobe: LobeKind) -> Action {
        let roughness = (0..self.env.level_count()).map(|level| self.env.roughness(level));
        let least = roughness.clone().find(|roughness| *roughness > 0.0).unwrap_or(1.0);
        let (alpha_min, sheen) = match lobe {
            LobeKind::Ggx => (least * least, None),
            LobeKind::Charlie => (1.0, Some(sheen_alpha(self.env.roughness(0)))),
        };
        let request = AnalysisRequest { alpha_min, sheen_alpha_min: sheen, error: self.env.error };
        let mut params = json!({"alpha_min": request.alpha_min, "error": request.error});
        if let Some(alpha) = sheen {
            params["sheen_alpha_min"] = json!(alpha);
        }
        let command = command("analyse", 3, params, &["analysis"]);
        let step = if lobe == LobeKind::Charlie { "/sheen" } else { "" };
        let action = self.action(step, command, vec![self.light(decode)], move |inputs| {
            let cancel = cancel(inputs);
            let panorama = panorama(inputs, 0)?;
            let analysis = kiln_bake::analyse(&panorama, &request, cancel).map_err(ended)?;
            let meta = json!({"detail": {"band_limit": analysis.band_limit(), "mean": analysis.mean()}});
            Ok(success("analysis", analysis.to_bytes(cancel).map_err(ended)?, meta))
        });
        let memory = |lengths: &[usize]| {
            let (width, height) = environment_size(lengths[0]);
            // A cube becomes a panorama first.
            kiln_bake::memory::analyse(width, height) + kiln_bake::memory::panorama_of_cube(height / 2)
        };
        Action { memory: needs(memory), ..action }
    }

    /// What light maps are made of: the environment without the texels that only the skybox keeps.
    fn light(&self, decode: ActionId) -> Input {
        output(decode, if self.env.texels == TexelPolicy::Keep { "light" } else { "environment" })
    }

    fn skybox(&self, decode: ActionId) -> Action {
        let env = self.env.clone();
        let inputs = vec![output(decode, "environment"), output(decode, "report"), self.light(decode)];
        let mut params = self.encoding();
        params["error"] = json!(env.error);
        params["mirror_size"] = json!(env.size);
        if let Some(size) = env.skybox_size {
            params["size"] = json!(size);
        }
        let (mirror_size, wanted_size) = (env.size, env.skybox_size);
        let command = command("skybox", 4, params, &[LEVELS, MIRROR]);
        let action = self.action("", command, inputs, move |inputs| {
            let cancel = cancel(inputs);
            let environment = environment(inputs, 0)?;
            let report = report(inputs, 1)?;
            let face_size = env.skybox_size.unwrap_or(report.skybox_size);
            let cubes = |environment: &Environment, face_size: usize| match environment {
                Environment::Panorama(panorama) => kiln_bake::skybox(panorama, face_size, cancel),
                Environment::Cube(cube) => kiln_bake::skybox_of_cube(cube, face_size, cancel),
            };
            let levels = cubes(&environment, face_size).map_err(ended)?;
            let encode = Encode::new(&env, &report);
            let encoded: Vec<EncodedLevel> =
                levels.iter().map(|cube| encode.level(cube, cancel)).collect::<Result<_, _>>()?;
            let mut shared = encode.facts();
            shared["size"] = json!(face_size);
            shared["levels"] = json!(levels.len());
            shared["source"] = report.source.clone();
            let worst = |error: fn(&EncodedLevel) -> f64| encoded.iter().map(error).fold(0.0, f64::max);
            let detail = json!({
                "method": "mean of the source over each texel, by solid angle",
                "rounding_rms": worst(|level| level.rounding_rms),
                "rounding_max": worst(|level| level.rounding_max),
                "clamped_flux": worst(|level| level.clamped_flux),
            });
            let mut diagnostics = encode.notes();
            diagnostics.extend(encode.cost(&encoded[0], env.error));
            let meta = json!({"shared": shared, "detail": detail});
            // The skybox has that level already, unless it keeps texels that reflections must not have.
            let level = levels.iter().position(|level| level.face_size == env.size);
            let mirror = match level.filter(|_| env.texels != TexelPolicy::Keep) {
                Some(level) => encoded[level].bytes.clone(),
                None => {
                    let light = self::environment(inputs, 2)?;
                    encode.level(&cubes(&light, env.size).map_err(ended)?[0], cancel)?.bytes
                }
            };
            let name = |index: usize| format!("{LEVELS}/mip{index}");
            let named = encoded.into_iter().enumerate().map(|(index, level)| (name(index), level.bytes));
            let outputs = named.chain([(MIRROR.to_owned(), mirror)]).collect();
            Ok(ActionOutput { outputs, meta, diagnostics })
        });
        let memory = move |lengths: &[usize]| {
            let (width, height) = environment_size(lengths[0]);
            let own = wanted_size.unwrap_or_else(|| source::skybox_face_size(width));
            let mirror =
                if mirror_size > own { kiln_bake::memory::skybox(width, height, mirror_size) } else { 0 };
            kiln_bake::memory::skybox(width, height, own) + mirror
        };
        Action { memory: needs(memory), ..action }
    }

    fn irradiance(&self, decode: ActionId, analyse: ActionId) -> Action {
        let size = self.env.irradiance_size;
        let mut params = self.encoding();
        params["size"] = json!(size);
        let command = command("irradiance", 3, params, &[LEVEL]);
        let bake =
            move |analysis: &Analysis, cancel: Cancel<'_>| kiln_bake::irradiance(analysis, size, cancel);
        let action = self.map("", command, decode, analyse, json!({}), bake);
        Action { memory: self.map_memory(1.0, size), ..action }
    }

    fn sh(&self, analyse: ActionId) -> Action {
        let (order, is_windowed) = (self.env.sh_order, self.env.is_sh_windowed);
        let mut params = json!({"order": order});
        if is_windowed {
            params["window"] = json!("dering");
        }
        let command = command("sh", 2, params, &["json"]);
        self.action("", command, vec![output(analyse, "analysis")], move |inputs| {
            let analysis = analysis(inputs, 0)?;
            let radiance = kiln_bake::sh(&analysis, order);
            let irradiance = radiance.to_irradiance();
            let mut facts = json!({
                "convention": SH_CONVENTION,
                "order": order,
                "radiance": radiance.coefficients,
                "irradiance_over_pi": irradiance.coefficients,
            });
            if is_windowed {
                let deringed = kiln_bake::dering(&irradiance, cancel(inputs)).map_err(ended)?;
                facts["irradiance_over_pi"] = json!(deringed.sh.coefficients);
                facts["window"] = json!({
                    "factor": "1 / (1 + strength l^2 (l + 1)^2)",
                    "strength": deringed.strength,
                    "minimum_before": deringed.minimum_before,
                    "minimum_after": deringed.minimum_after,
                });
            }
            let mut text = serde_json::to_vec_pretty(&facts).unwrap_or_default();
            text.push(b'\n');
            Ok(success("json", text, json!({})))
        })
    }

    fn level(&self, map: &str, lobe: LobeKind, decode: ActionId, analyse: ActionId, level: usize) -> Action {
        let roughness = self.env.roughness(level);
        let face_size = self.env.face_size(level);
        let alpha = if lobe == LobeKind::Ggx { roughness * roughness } else { sheen_alpha(roughness) };
        let mut params = self.encoding();
        params["size"] = json!(face_size);
        params["alpha"] = json!(alpha);
        params["roughness"] = json!(roughness);
        let kind = if lobe == LobeKind::Ggx { "prefilter" } else { "prefilter sheen" };
        let command = command(kind, 3, params, &[LEVEL]);
        let bake = move |analysis: &Analysis, cancel: Cancel<'_>| match lobe {
            LobeKind::Ggx => kiln_bake::specular_level(analysis, alpha, face_size, cancel),
            LobeKind::Charlie => kiln_bake::sheen_level(analysis, alpha, face_size, cancel),
        };
        let step = format!("/{map} mip {level}");
        let action = self.map(&step, command, decode, analyse, json!({"roughness": roughness}), bake);
        Action { memory: self.map_memory(alpha, face_size), ..action }
    }

    /// A step that makes one map of an analysis.
    fn map(
        &self,
        step: &str,
        command: Command,
        decode: ActionId,
        analyse: ActionId,
        facts: Value,
        bake: impl Fn(&Analysis, Cancel<'_>) -> Result<Prefiltered, Cancelled> + Send + Sync + 'static,
    ) -> Action {
        let env = self.env.clone();
        let inputs = vec![output(analyse, "analysis"), output(decode, "report")];
        self.action(step, command, inputs, move |inputs| {
            let cancel = cancel(inputs);
            let analysis = analysis(inputs, 0)?;
            let map = bake(&analysis, cancel).map_err(ended)?;
            let mut detail = accuracy_facts(&map.accuracy);
            for (key, value) in facts.as_object().into_iter().flatten() {
                detail[key] = value.clone();
            }
            Encode::new(&env, &report(inputs, 1)?).output(LEVEL, &map.cube, detail, cancel)
        })
    }
}

/// Charlie of small roughness is a thin line around the horizon, and of roughness 0 nothing at all: levels below roughness
/// 0.1 are baked for this α.
const SHEEN_ALPHA_MIN: f64 = 0.1 * 0.1;

pub(crate) fn sheen_alpha(roughness: f64) -> f64 {
    (roughness * roughness).max(SHEEN_ALPHA_MIN)
}

fn accuracy_facts(accuracy: &Accuracy) -> Value {
    json!({
        "method": "transform up to band_limit, bright_texels convolved directly",
        "band_limit": accuracy.band_limit,
        "bright_texels": accuracy.bright_texels,
        "rms_bound": accuracy.rms_bound,
        "sup_bound": accuracy.sup_bound,
        "clamped_flux": accuracy.clamped_flux,
    })
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
fn environment(inputs: &Inputs, index: usize) -> Result<Bulk<Environment>, Error> {
    decode_environment(&inputs.required(index)?, cancel(inputs)).map(Bulk::new)
}

/// An environment as a panorama.
fn panorama(inputs: &Inputs, index: usize) -> Result<Bulk<Panorama>, Error> {
    let panorama = match environment(inputs, index)?.into_inner() {
        Environment::Panorama(panorama) => panorama,
        Environment::Cube(cube) => {
            kiln_bake::panorama_of_cube(&Bulk::new(cube), cancel(inputs)).map_err(ended)?
        }
    };
    Ok(Bulk::new(panorama))
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

/// Whether a file of this extension holds texels as a GPU has them.
fn is_container(extension: &str) -> bool {
    ["ktx2", "ktx", "dds"].iter().any(|known| extension.eq_ignore_ascii_case(known))
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
