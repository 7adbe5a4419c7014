//! Actions of `[shader.NAME]`: one for each feature set that makes a difference.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use kiln_build::{Action, ActionId, ActionOutput, Engine, Error, Input, Scan, little_memory};
use kiln_diagnostic::Diagnostic;
use kiln_shader::{Language, Outcome};
use kiln_worker::{Died, Sources};
use serde_json::{Value, json};

use crate::config::variant_name;
use crate::environment::{command, failure, success};
use crate::plan::{PartSpec, Planner, Wishes, no_content, rank, unreadable};
use crate::{OwnTexture, PROJECT_FILE, Role, ShaderConfig};

/// Version of the compiler behind both the scan and the action.
const COMPILE_RECIPE: u32 = 5;

/// Feature sets that scenes ask of material shaders.
#[derive(Default)]
pub(crate) struct Variants(BTreeMap<String, BTreeSet<BTreeSet<String>>>);

impl Variants {
    pub(crate) fn ask(&mut self, shader: &str, features: BTreeSet<String>) {
        self.0.entry(shader.to_owned()).or_default().insert(features);
    }

    /// What is asked of a shader, by scenes and by its table; where that is nothing the plain variant, so that its errors
    /// are seen.
    fn of(&self, shader: &str, config: &ShaderConfig) -> BTreeSet<BTreeSet<String>> {
        let mut asked = config.variants.clone();
        if config.role == Role::Material {
            asked.extend(self.0.get(shader).into_iter().flatten().cloned());
        }
        if asked.is_empty() {
            asked.insert(BTreeSet::new());
        }
        asked
    }
}

/// Adds a target for each variant of a shader, and an action for each that can differ from the others.
pub(crate) fn plan_shader(
    planner: &mut Planner,
    engine: &Engine,
    name: &str,
    config: &ShaderConfig,
    variants: &Variants,
    is_inspected: bool,
) -> Result<(), Error> {
    let program = &config.program;
    // A scan is known by one file; what else decides what it looks at is part of its kind.
    let kind = format!("shader {}", json!(program));
    let scan = engine.scan(&kind, COMPILE_RECIPE, program.subject(), |tracker| {
        let mut read = |path: &str| tracker.read(path).map(|bytes| text(&bytes));
        (json!(kiln_shader::scan(program, &mut read).features), Vec::new())
    })?;
    let known: BTreeSet<String> = serde_json::from_value(scan.found.clone()).unwrap_or_default();
    let textures = plan_textures(planner, engine, config);
    let srgb: Vec<&String> =
        config.textures.iter().filter(|(_, texture)| texture.is_srgb).map(|(name, _)| name).collect();
    let mut compiled: BTreeMap<BTreeSet<String>, ActionId> = BTreeMap::new();
    for asked in variants.of(name, config) {
        let features = asked.clone();
        let variant = variant_name(&features);
        if let Some(unknown) =
            config.variants.contains(&features).then(|| features.difference(&known).next()).flatten()
        {
            planner.diagnostics.push(unknown_feature(name, &variant, unknown, &known));
        }
        // Features that no condition names make no difference.
        let features: BTreeSet<String> = features.intersection(&known).cloned().collect();
        let compile = *compiled.entry(features).or_insert_with_key(|features| {
            planner.graph.add(compile_action(engine, name, config, features, &scan))
        });
        planner.subjects.insert(compile, program.subject().to_owned());
        for &language in &config.emit {
            let emit = planner.graph.add(emit_action(name, &variant, compile, language));
            planner.subjects.insert(emit, program.subject().to_owned());
            let target = format!("emit/{name}/{variant}/{language}");
            planner.target(
                target,
                "emit",
                json!({"language": language}),
                vec![PartSpec::Folder(emit, FILES)],
            );
        }
        let mut meta = json!({"shader": name, "role": config.role.name(), "features": asked});
        if !srgb.is_empty() {
            meta["srgb_textures"] = json!(srgb);
        }
        let mut parts = vec![PartSpec::one(compile, "wgsl"), PartSpec::one(compile, "reflection")];
        parts.extend(textures.iter().cloned());
        planner.target(format!("shader/{name}/{variant}"), "shader", meta.clone(), parts);
        // A shader whose conditions do not know it would look the same.
        if is_inspected && config.role == Role::Material && known.contains(Wishes::INSPECT) {
            let features = asked.iter().cloned().chain([Wishes::INSPECT.to_owned()]);
            let features: BTreeSet<String> = features.filter(|feature| known.contains(feature)).collect();
            let compile = *compiled.entry(features).or_insert_with_key(|features| {
                planner.graph.add(compile_action(engine, name, config, features, &scan))
            });
            planner.subjects.insert(compile, program.subject().to_owned());
            let mut parts = vec![PartSpec::one(compile, "wgsl"), PartSpec::one(compile, "reflection")];
            parts.extend(textures.iter().cloned());
            planner.target(format!("{}/{name}/{variant}", Wishes::INSPECT), "shader", meta, parts);
        }
    }
    Ok(())
}

/// Checks the author's own textures: parts `texture.NAME` of each variant, the files as they are.
fn plan_textures(planner: &mut Planner, engine: &Engine, config: &ShaderConfig) -> Vec<PartSpec> {
    let mut parts = Vec::new();
    for (name, OwnTexture { source, .. }) in &config.textures {
        let unreadable = unreadable(engine, source);
        let input = Input::Source { path: source.clone(), digest: engine.source(source).digest() };
        let action = planner.graph.add(Action {
            name: format!("check texture {source}"),
            command: command("texture", 1, json!({"unreadable": unreadable}), &["file"]),
            inputs: vec![input],
            rank: rank::SHADER,
            memory: little_memory(),
            perform: Arc::new(move |inputs| {
                let Some(bytes) = inputs.bytes(0)? else {
                    let help = "create it, or correct `textures` in kiln.toml";
                    return Ok(failure(no_content("texture", unreadable.as_deref()).with_help(help)));
                };
                Ok(match kiln_scene::decode_image(&bytes) {
                    Ok(_) => success("file", bytes.to_vec(), Value::Null),
                    Err(reason) => failure(
                        Diagnostic::error(format!("this texture cannot be read: {reason}"))
                            .with_help("save it as PNG or JPEG"),
                    ),
                })
            }),
        });
        planner.subjects.insert(action, source.clone());
        parts.push(PartSpec::One { action, output: "file".to_owned(), part: format!("texture.{name}") });
    }
    parts
}

/// The outputs of an [`emit_action`]: `files/spv`, or `files/vert.glsl` …, and `files/LANGUAGE.json`, which says what is
/// bound where.
const FILES: &str = "files";

/// Version of the writers of other languages.
const EMIT_RECIPE: u32 = 1;

fn emit_action(name: &str, variant: &str, compile: ActionId, language: Language) -> Action {
    Action {
        name: format!("emit shader/{name}/{variant} as {language}"),
        command: command("emit", EMIT_RECIPE, json!({"language": language}), &[FILES]),
        inputs: vec![Input::Output { action: compile, output: "wgsl".to_owned() }],
        rank: rank::EMIT,
        memory: little_memory(),
        perform: Arc::new(move |inputs| {
            let wgsl = String::from_utf8_lossy(&inputs.required(0)?).into_owned();
            let emitted = match kiln_worker::emit(wgsl, language) {
                Ok(Ok(emitted)) => emitted,
                Ok(Err(diagnostic)) => return Ok(failure(diagnostic)),
                Err(died) => return death(died, ""),
            };
            let facts: Vec<Value> = emitted
                .iter()
                .map(|file| json!({"file": file.file_suffix, "notes": file.notes, "bindings": file.bindings}))
                .collect();
            let mut text = serde_json::to_vec_pretty(&facts).unwrap_or_default();
            text.push(b'\n');
            let files = emitted.into_iter().map(|file| (file_name(&file.file_suffix), file.bytes));
            let outputs = files.chain([(file_name(&format!(".{language}.json")), text)]).collect();
            Ok(ActionOutput { outputs, ..ActionOutput::default() })
        }),
    }
}

fn file_name(suffix: &str) -> String {
    format!("{FILES}/{}", suffix.trim_start_matches('.'))
}

/// What a worker died of is the input's fault, and kept as such; that there is none, or that somebody killed it, is not.
fn death(died: Died, subject: &str) -> Result<ActionOutput, Error> {
    if died.is_of_input() {
        return Ok(failure(died.diagnostic(subject)));
    }
    Err(Error::Action { action: format!("compile {subject}"), reason: died.diagnostic(subject).message })
}

fn unknown_feature(shader: &str, variant: &str, feature: &str, known: &BTreeSet<String>) -> Diagnostic {
    let message =
        format!("[shader.{shader}] lists the variant `{variant}`, but no condition names `{feature}`");
    let help = crate::suggest(feature, known.iter().map(String::as_str)).unwrap_or_else(|| {
        format!("its conditions name: {}", known.iter().cloned().collect::<Vec<_>>().join(", "))
    });
    Diagnostic::warning(message).in_file(PROJECT_FILE).with_help(help)
}

fn compile_action(
    engine: &Engine,
    name: &str,
    config: &ShaderConfig,
    features: &BTreeSet<String>,
    scan: &Scan,
) -> Action {
    let program = config.program.clone();
    let inputs = scan.looked_at.iter();
    let inputs = inputs.map(|(path, digest)| Input::Source { path: path.clone(), digest: *digest });
    let unreadable = program.roots.iter().find_map(|root| unreadable(engine, root));
    let (files, features) = (scan.clone(), features.clone());
    let params = json!({"program": program, "features": features, "unreadable": unreadable});
    Action {
        name: format!("compile shader/{name}/{}", variant_name(&features)),
        command: command("compile", COMPILE_RECIPE, params, &["wgsl", "reflection"]),
        inputs: inputs.collect(),
        rank: rank::SHADER,
        memory: little_memory(),
        perform: Arc::new(move |inputs| {
            let mut sources = Sources::default();
            for (index, (path, _)) in files.looked_at.iter().enumerate() {
                sources.0.insert(path.clone(), inputs.bytes(index)?.map(|bytes| text(&bytes)));
            }
            if let Some(missing) = program.roots.iter().find(|root| sources.read(root).is_none()) {
                return Ok(failure(no_content("shader", unreadable.as_deref()).in_file(missing)));
            }
            match kiln_worker::compile(&program, &features, sources) {
                Ok(outcome) => Ok(compiled(outcome)),
                Err(died) => death(died, program.subject()),
            }
        }),
    }
}

fn compiled(outcome: Outcome) -> ActionOutput {
    let diagnostics = outcome.diagnostics;
    let Some(compiled) = outcome.compiled else {
        return ActionOutput { diagnostics, ..Default::default() };
    };
    // The source map changes with every comment; whoever wants it compiles again, which takes milliseconds.
    let reflection = serde_json::to_vec(&compiled.reflection).unwrap_or_default();
    let outputs =
        vec![("wgsl".to_owned(), compiled.wgsl.into_bytes()), ("reflection".to_owned(), reflection)];
    ActionOutput { outputs, meta: Value::Null, diagnostics }
}

/// Shader text that is no UTF-8 shows its wrong bytes as U+FFFD in the diagnostic that follows.
fn text(bytes: &[u8]) -> Arc<str> {
    String::from_utf8_lossy(bytes).into()
}
