//! From kiln.toml and the sources to a graph of actions and the targets they make.

use std::collections::{BTreeMap, BTreeSet};

use kiln_bake::RoughnessLaw;
use kiln_build::{
    ActionId, ActionRecord, Engine, Error, Graph, OutputRecord, Part, RunReport, SourceState, Status, Target,
    TargetState, Targets,
};
use kiln_diagnostic::{Diagnostic, has_errors};
use serde_json::{Map, Value, json};

use crate::demand::env_demands;
use crate::{
    EffectOverrides, EnvDemand, PROJECT_FILE, Project, SceneDemand, environment, lock, lut, parse_project,
    scene, shader,
};

/// What must be done for a project, before any of it is done.
pub struct Plan {
    /// kiln.toml as data.
    pub project: Project,
    /// Every action.
    pub graph: Graph,
    /// What the actions make, by name.
    pub targets: Vec<TargetSpec>,
    /// What each scene calls for.
    pub scenes: Vec<SceneDemand>,
    /// What is read of each environment.
    pub envs: BTreeMap<String, EnvDemand>,
    /// What is wrong with kiln.toml or found while planning.
    pub diagnostics: Vec<Diagnostic>,
    /// Environments that ask for a time and of which `kiln.lock` says nothing that still holds; see [`crate::settle()`].
    pub open: Vec<String>,
    /// What was wanted besides.
    pub wishes: Wishes,
    /// The file that an action's messages are about, where they name none themselves.
    subjects: BTreeMap<ActionId, String>,
}

/// A target and the actions whose outputs it consists of.
pub struct TargetSpec {
    /// As `env/sky/specular`.
    pub name: String,
    /// How to read it.
    pub kind: &'static str,
    /// Facts known before the actions run.
    pub meta: Value,
    /// Its contents in order.
    pub parts: Vec<PartSpec>,
}

/// Where a target's contents come from.
#[derive(Clone, Debug, PartialEq)]
pub enum PartSpec {
    /// One output of an action.
    One {
        /// Which action.
        action: ActionId,
        /// Which of its outputs.
        output: String,
        /// What it is called in the target.
        part: String,
    },
    /// The outputs `FOLDER/mip0`, `FOLDER/mip1` … of an action, however many there are and whatever their names.
    Folder(ActionId, &'static str),
    /// No content: what an action found out about the target, its `facts`, as the target's `measured`.
    Facts(ActionId),
}

impl PartSpec {
    /// An output that keeps its name.
    pub(crate) fn one(action: ActionId, output: &str) -> PartSpec {
        PartSpec::One { action, output: output.to_owned(), part: output.to_owned() }
    }

    /// The action it comes from.
    pub fn action(&self) -> ActionId {
        match self {
            PartSpec::One { action, .. } | PartSpec::Folder(action, _) | PartSpec::Facts(action) => *action,
        }
    }

    /// Whether it has bytes, and is not what was found out about them.
    fn is_content(&self) -> bool {
        !matches!(self, PartSpec::Facts(_))
    }

    /// The parts, if the action made them.
    fn resolve(&self, report: &RunReport) -> Option<Vec<Part>> {
        let outcome = report.outcome(self.action());
        let named = |name: &str, made: &OutputRecord| Part {
            name: name.to_owned(),
            digest: made.digest,
            bytes: made.bytes,
        };
        match self {
            PartSpec::One { output, part, .. } => Some(vec![named(part, outcome.output(output)?)]),
            PartSpec::Facts(_) => outcome.succeeded().then(Vec::new),
            PartSpec::Folder(_, folder) => {
                let outputs = outcome.record.as_ref()?.result.outputs.iter();
                let parts = outputs.filter_map(|output| {
                    Some(named(output.name.strip_prefix(folder)?.strip_prefix('/')?, output))
                });
                let parts: Vec<Part> = parts.collect();
                (!parts.is_empty()).then_some(parts)
            }
        }
    }
}

/// Among actions that could start, these go first: what an artist waits for.
pub(crate) mod rank {
    pub(crate) const SHADER: u32 = 0;
    pub(crate) const SCENE: u32 = 1;
    pub(crate) const ENVIRONMENT: u32 = 2;
    pub(crate) const EMIT: u32 = 3;
}

/// Collects actions and targets.
#[derive(Default)]
pub(crate) struct Planner {
    pub(crate) graph: Graph,
    pub(crate) targets: Vec<TargetSpec>,
    pub(crate) diagnostics: Vec<Diagnostic>,
    pub(crate) subjects: BTreeMap<ActionId, String>,
}

impl Planner {
    pub(crate) fn target(&mut self, name: String, kind: &'static str, meta: Value, parts: Vec<PartSpec>) {
        parts.iter().for_each(|part| self.graph.want(part.action()));
        self.targets.push(TargetSpec { name, kind, meta, parts });
    }
}

/// Why a source that is there cannot be read. Part of the parameters of the action that reports it, so that such a file
/// does not share the key of a missing one.
pub(crate) fn unreadable(engine: &Engine, path: &str) -> Option<String> {
    match engine.source(path) {
        SourceState::Unreadable(reason) => Some(reason),
        SourceState::Present(_) | SourceState::Missing => None,
    }
}

/// What to say of a source without content; the plan adds which.
pub(crate) fn no_content(what: &str, unreadable: Option<&str>) -> Diagnostic {
    match unreadable {
        Some(reason) => Diagnostic::error(format!("the {what}'s file cannot be read: {reason}")),
        None => Diagnostic::error(format!("the {what}'s file was not found"))
            .with_help("create it, or correct `source` in kiln.toml"),
    }
}

/// What somebody wants besides what the project asks for. It is in no manifest and no folder of baked files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// Variants of material shaders that show what a pixel is made of: the targets `inspect/SHADER/VARIANT`.
    pub inspect: bool,
    /// Environments to bake at another relative RMS error than kiln.toml says; names that the project does not have are
    /// passed over.
    pub errors: BTreeMap<String, f64>,
}

impl Wishes {
    /// The group of targets that [`Wishes::inspect`] is about; who wants it by this name gets it.
    pub const INSPECT: &str = "inspect";

    /// The wishes among the names of targets that somebody wants.
    pub fn among<'a>(mut names: impl Iterator<Item = &'a String>) -> Wishes {
        Wishes { inspect: names.any(|name| name == Wishes::INSPECT), ..Wishes::default() }
    }

    /// Whether what kiln.toml asks for is made otherwise: such maps go into no folder of baked files.
    pub fn change_maps(&self) -> bool {
        !self.errors.is_empty()
    }

    /// Whether a target belongs to what is there by wish alone.
    pub fn is_extra(target: &str) -> bool {
        target.strip_prefix(Wishes::INSPECT).is_some_and(|rest| rest.starts_with('/'))
    }
}

/// Plans a project: reads kiln.toml, scans scenes and shaders for what they need. `changed` names the files that may be
/// different since this engine's last plan; `None` stands for all.
///
/// # Errors
/// The store cannot be used. Errors of the project are in [`Plan::diagnostics`].
pub fn plan(engine: &Engine, changed: Option<&[String]>) -> Result<Plan, Error> {
    plan_with(engine, changed, Wishes::default())
}

/// Does what [`plan`] does, for somebody with wishes of their own.
///
/// # Errors
/// As [`plan`].
pub fn plan_with(engine: &Engine, changed: Option<&[String]>, wishes: Wishes) -> Result<Plan, Error> {
    engine.begin_plan(changed);
    let mut diagnostics = Vec::new();
    let mut project = read_project(engine, &mut diagnostics);
    let open = lock::apply(engine, &mut project, &mut diagnostics);
    for name in &open {
        let error = project.envs[name].error;
        let message = format!("nothing is chosen yet for the `time_ms` of env.{name}: it has error {error}");
        diagnostics.push(
            Diagnostic::note(message)
                .in_file(PROJECT_FILE)
                .with_help("`kiln bake` chooses, and writes kiln.lock"),
        );
    }
    for (name, env) in &mut project.envs {
        env.error = wishes.errors.get(name).copied().unwrap_or(env.error);
    }
    if project.envs.values().any(|env| env.law != RoughnessLaw::Linear) {
        let message = "the preview reads specular levels as linear in roughness; `law` is for engines";
        diagnostics.push(Diagnostic::note(message).in_file(PROJECT_FILE));
    }
    Ok(Plan { open, ..plan_project(engine, project, diagnostics, wishes)? })
}

/// Plans what a project asks for, wherever that was written.
pub(crate) fn plan_project(
    engine: &Engine,
    project: Project,
    diagnostics: Vec<Diagnostic>,
    wishes: Wishes,
) -> Result<Plan, Error> {
    let mut planner = Planner { diagnostics, ..Planner::default() };
    let mut variants = shader::Variants::default();
    let mut scenes = Vec::new();
    // With errors there may be scenes that could not be read.
    let shapes = if has_errors(&planner.diagnostics) { BTreeMap::new() } else { scene::shapes(&project) };
    for (name, config) in project.scenes.iter().chain(&shapes) {
        scenes.push(scene::plan_scene(&mut planner, engine, &project, name, config, &mut variants)?);
    }
    let envs = env_demands(&project, &scenes);
    for (name, config) in &project.shaders {
        shader::plan_shader(&mut planner, engine, name, config, &variants, wishes.inspect)?;
    }
    for (name, config) in &project.envs {
        environment::plan_environment(&mut planner, engine, name, config, &envs[name]);
    }
    // What the preview's shaders read.
    let wanted = [
        ("ggx", &lut::DEFAULT, envs.values().any(|env| !env.light.is_empty())),
        ("charlie", &lut::CHARLIE, envs.values().any(EnvDemand::is_sheen_read)),
    ];
    for (name, config, is_read) in wanted {
        if is_read && !project.is_without_default_lut && !project.luts.contains_key(name) {
            lut::plan_lut(&mut planner, name, config, false);
        }
    }
    for (name, config) in &project.luts {
        lut::plan_lut(&mut planner, name, config, !project.is_without_default_lut);
    }
    let mut meta = json!({
        "name": project.name,
        "scenes": project.scenes.keys().chain(shapes.keys()).collect::<Vec<_>>(),
        "envs": project.envs.keys().collect::<Vec<_>>(),
    });
    let unread = unread_targets(&envs, &planner.targets);
    if !unread.is_empty() {
        meta["unread"] = json!(unread);
    }
    if project.effects != EffectOverrides::default() {
        meta["effects"] = json!(project.effects);
    }
    planner.target("project".to_owned(), "project", meta, Vec::new());
    if wishes.inspect {
        // Which shaders are looked into, so that a client knows that the others cannot be.
        let prefix = format!("{}/", Wishes::INSPECT);
        let name =
            |target: &TargetSpec| Some(target.name.strip_prefix(&prefix)?.split('/').next()?.to_owned());
        let shaders: BTreeSet<String> = planner.targets.iter().filter_map(name).collect();
        planner.target(
            format!("{prefix}shaders"),
            Wishes::INSPECT,
            json!({ "shaders": shaders }),
            Vec::new(),
        );
    }
    let Planner { graph, targets, diagnostics, subjects } = planner;
    let open = Vec::new();
    Ok(Plan { project, graph, targets, scenes, envs, diagnostics, open, wishes, subjects })
}

/// Maps and tables of the preview's shaders that are not made because nothing reads them.
fn unread_targets(envs: &BTreeMap<String, EnvDemand>, made: &[TargetSpec]) -> Vec<String> {
    let maps = ["irradiance", "specular"];
    let of_env = |name: &String| maps.map(|map| format!("env/{name}/{map}"));
    let names = envs.keys().flat_map(of_env).chain(["lut/ggx".to_owned()]);
    names.filter(|name| !made.iter().any(|target| target.name == *name)).collect()
}

pub(crate) fn read_project(engine: &Engine, diagnostics: &mut Vec<Diagnostic>) -> Project {
    let text = match engine.sources().read(PROJECT_FILE) {
        None => {
            let missing = Diagnostic::error("there is no kiln.toml in this folder")
                .in_file(PROJECT_FILE)
                .with_help("`kiln init DIR` makes a project that runs as it is");
            diagnostics.push(missing);
            "version = 1".to_owned()
        }
        Some(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
    };
    let (project, found) = parse_project(&text);
    diagnostics.extend(found);
    project
}

impl Plan {
    /// The actions whose outputs a target consists of, or the action of that name.
    pub fn actions_of(&self, name: &str) -> Option<Vec<ActionId>> {
        if let Some(target) = self.targets.iter().find(|target| target.name == name) {
            let mut actions: Vec<ActionId> = target.parts.iter().map(PartSpec::action).collect();
            actions.dedup();
            return Some(actions);
        }
        let action = self.graph.iter().find(|(_, action)| action.name == name)?;
        Some(vec![action.0])
    }

    /// A message of an action with the file that it is about.
    pub(crate) fn with_subject(&self, action: ActionId, diagnostic: &Diagnostic) -> Diagnostic {
        let mut diagnostic = diagnostic.clone();
        if diagnostic.file.is_none() {
            diagnostic.file = self.subjects.get(&action).cloned();
        }
        diagnostic
    }

    /// Joins what the actions made into targets; without those that could not be made.
    pub(crate) fn resolve_fresh(&self, report: &RunReport) -> (Targets, Vec<Diagnostic>) {
        let made = |spec: &TargetSpec| Some((spec.name.clone(), resolve_target(spec, report, |_| true)?));
        (self.targets.iter().filter_map(made).collect(), self.said(report))
    }

    /// Everything that planning and running said.
    fn said(&self, report: &RunReport) -> Vec<Diagnostic> {
        let mut diagnostics = self.diagnostics.clone();
        for (action, diagnostic) in report.diagnostics() {
            let diagnostic = self.with_subject(action, diagnostic);
            if !diagnostics.contains(&diagnostic) {
                diagnostics.push(diagnostic);
            }
        }
        diagnostics
    }

    /// Lets what is wanted go first, with the shaders and tables that any picture needs; unless nothing is wanted.
    pub(crate) fn hurry(&mut self, is_wanted: &dyn Fn(&str) -> bool) {
        if !self.targets.iter().any(|target| is_wanted(&target.name)) {
            return;
        }
        let goes_first =
            |target: &&TargetSpec| ["shader", "lut"].contains(&target.kind) || is_wanted(&target.name);
        let first = self.targets.iter().filter(goes_first).flat_map(|target| &target.parts);
        // A picture need not wait until the error of its maps is measured.
        let first: Vec<ActionId> = first.filter(|part| part.is_content()).map(PartSpec::action).collect();
        self.graph.hurry(&first);
    }

    /// Joins what the actions made so far into targets; those that wait for others stay as they were published, and are named.
    /// So are those of which all is there but what measures it.
    pub(crate) fn resolve_early(
        &self,
        engine: &Engine,
        report: &RunReport,
    ) -> (Targets, Vec<String>, Vec<Diagnostic>) {
        let mut targets = (*engine.published()).clone();
        let mut building = Vec::new();
        for spec in &self.targets {
            let waits = |part: &PartSpec| report.outcome(part.action()).status == Status::NotRun;
            if spec.parts.iter().any(waits) {
                building.push(spec.name.clone());
            }
            if spec.parts.iter().filter(|part| part.is_content()).any(waits) {
                continue;
            }
            if let Some(target) = resolve_target(spec, report, |part| part.is_content() || !waits(part)) {
                targets.insert(spec.name.clone(), target);
            } else if let Some(target) = engine.last_good(&spec.name) {
                targets.insert(spec.name.clone(), target.into_stale());
            }
        }
        (targets, building, self.said(report))
    }

    /// Joins what the actions made into targets. One whose actions failed keeps the content that was published last,
    /// marked stale; one that nothing asks for any more goes, unless an error may be what hides the wish for it.
    pub fn resolve(&self, engine: &Engine, report: &RunReport) -> (Targets, Vec<Diagnostic>) {
        let mut diagnostics = self.said(report);
        let mut targets = Targets::new();
        if has_errors(&diagnostics) {
            let published = engine.published();
            let last_good = |name: &String| Some((name.clone(), engine.last_good(name)?.into_stale()));
            let is_asked_for = |name: &&String| self.wishes.inspect || !Wishes::is_extra(name);
            targets.extend(published.keys().filter(is_asked_for).filter_map(last_good));
        }
        for spec in &self.targets {
            if let Some(target) = resolve_target(spec, report, |_| true) {
                targets.insert(spec.name.clone(), target);
                continue;
            }
            if spec.parts.iter().all(|part| report.outcome(part.action()).succeeded()) {
                let message =
                    format!("`{}` was made, but not all of its parts; this is a fault of Kiln", spec.name);
                diagnostics.push(Diagnostic::error(message));
            }
            if let Some(target) = engine.last_good(&spec.name) {
                targets.insert(spec.name.clone(), target.into_stale());
            }
        }
        (targets, diagnostics)
    }
}

/// `is_read` tells parts that the target must have.
fn resolve_target(
    spec: &TargetSpec,
    report: &RunReport,
    is_read: impl Fn(&PartSpec) -> bool,
) -> Option<Target> {
    let parts = spec.parts.iter().filter(|part| is_read(part)).map(|part| part.resolve(report));
    let parts: Vec<Vec<Part>> = parts.collect::<Option<_>>()?;
    let parts = parts.into_iter().flatten().collect();
    let meta = gather_meta(spec, report);
    Some(Target { kind: spec.kind.to_owned(), state: TargetState::Fresh, meta, parts })
}

/// What the target's actions found out about all of it ("shared") and about each part ("detail"), how it was made, and
/// the facts of the plan, which win: an action may serve two targets.
fn gather_meta(spec: &TargetSpec, report: &RunReport) -> Value {
    let mut meta = Map::new();
    let content = spec.parts.iter().filter(|part| part.is_content());
    let mut actions: Vec<ActionId> = content.map(PartSpec::action).collect();
    actions.dedup();
    for part in &spec.parts {
        if let PartSpec::Facts(action) = part
            && let Some(record) = &report.outcome(*action).record
            && let Some(facts) = record.result.meta.get("facts")
        {
            meta.insert("measured".to_owned(), facts.clone());
        }
    }
    let records: Vec<&ActionRecord> =
        actions.iter().filter_map(|action| report.outcome(*action).record.as_deref()).collect();
    let mut details = Vec::new();
    for record in &records {
        if let Some(shared) = record.result.meta.get("shared").and_then(Value::as_object) {
            meta.extend(shared.clone());
        }
        if let Some(detail) = record.result.meta.get("detail") {
            details.push(detail.clone());
        }
    }
    if !details.is_empty() {
        meta.insert("details".to_owned(), Value::Array(details));
    }
    let mut recipes: Vec<Value> = Vec::new();
    for record in records {
        let kiln_build::Command { kind, recipe, params, .. } = &record.command;
        let recipe = json!({"kind": kind, "recipe": recipe, "parameters": params});
        recipes.push(recipe);
    }
    if !recipes.is_empty() {
        meta.insert("made_by".to_owned(), Value::Array(recipes));
    }
    meta.extend(spec.meta.as_object().cloned().unwrap_or_default());
    Value::Object(meta)
}
