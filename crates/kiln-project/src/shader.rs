//! Actions of `[shader.NAME]` and the BRDF table they read.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use kiln_build::{Action, ActionOutput, Engine, Error, Input, little_memory};
use serde_json::{Value, json};

use crate::environment::{command, failure};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use crate::{Role, ShaderConfig};

/// Version of the compiler behind both the scan and the action.
const COMPILE_RECIPE: u32 = 1;

/// Feature sets that scenes ask of material shaders.
#[derive(Default)]
pub(crate) struct Variants(BTreeMap<String, BTreeSet<BTreeSet<String>>>);

impl Variants {
    pub(crate) fn ask(&mut self, shader: &str, features: BTreeSet<String>) {
        self.0.entry(shader.to_owned()).or_default().insert(features);
    }

    /// What is asked of a shader; without a scene the plain variant, so that its errors are seen.
    fn of(&self, shader: &str, role: Role) -> BTreeSet<BTreeSet<String>> {
        match (role, self.0.get(shader)) {
            (Role::Material, Some(asked)) => asked.clone(),
            _ => BTreeSet::from([BTreeSet::new()]),
        }
    }
}

/// Adds an action and a target for each variant of a shader.
pub(crate) fn plan_shader(
    planner: &mut Planner,
    engine: &Engine,
    name: &str,
    config: &ShaderConfig,
    variants: &Variants,
) -> Result<(), Error> {
    let scan = engine.scan("shader", COMPILE_RECIPE, &config.source, |tracker| {
        let mut read = |path: &str| tracker.read(path).map(|bytes| text(&bytes));
        kiln_shader::scan_dependencies(&config.source, &mut read);
        (Value::Null, Vec::new())
    })?;
    for features in variants.of(name, config.role) {
        let variant = match features.len() {
            0 => "base".to_owned(),
            _ => features.iter().cloned().collect::<Vec<_>>().join("+"),
        };
        let target = format!("shader/{name}/{variant}");
        let inputs = scan.looked_at.iter();
        let inputs = inputs.map(|(path, digest)| Input::Source { path: path.clone(), digest: *digest });
        let meta = json!({"shader": name, "role": config.role.name(), "features": features});
        let (root, files) = (config.source.clone(), scan.clone());
        let unreadable = unreadable(engine, &root);
        let compile = planner.graph.add(Action {
            name: format!("compile {target}"),
            command: command(
                "compile",
                COMPILE_RECIPE,
                json!({"root": root, "features": features, "unreadable": unreadable}),
                &["wgsl", "reflection"],
            ),
            inputs: inputs.collect(),
            rank: rank::SHADER,
            memory: little_memory(),
            perform: Arc::new(move |inputs| {
                let mut contents = BTreeMap::new();
                for (index, (path, _)) in files.looked_at.iter().enumerate() {
                    contents.insert(path.as_str(), inputs.bytes(index)?);
                }
                let mut read = |path: &str| contents.get(path).cloned().flatten().map(|bytes| text(&bytes));
                Ok(match read(&root) {
                    Some(_) => compile(&root, &features, &mut read),
                    None => failure(no_content("shader", unreadable.as_deref())),
                })
            }),
        });
        planner.subjects.insert(compile, config.source.clone());
        let parts = vec![PartSpec::one(compile, "wgsl"), PartSpec::one(compile, "reflection")];
        planner.target(target, "shader", meta, parts);
    }
    Ok(())
}

fn compile(
    root: &str,
    features: &BTreeSet<String>,
    read: &mut dyn FnMut(&str) -> Option<Arc<str>>,
) -> ActionOutput {
    let outcome = kiln_shader::compile(root, features, read);
    let diagnostics = outcome.diagnostics;
    let Some(compiled) = outcome.compiled else { return ActionOutput { diagnostics, ..Default::default() } };
    let reflection = serde_json::to_vec(&compiled.reflection).unwrap_or_default();
    let outputs =
        vec![("wgsl".to_owned(), compiled.wgsl.into_bytes()), ("reflection".to_owned(), reflection)];
    ActionOutput { outputs, meta: Value::Null, diagnostics }
}

/// Shader text that is no UTF-8 shows its wrong bytes as U+FFFD in the diagnostic that follows.
fn text(bytes: &[u8]) -> Arc<str> {
    String::from_utf8_lossy(bytes).into()
}
