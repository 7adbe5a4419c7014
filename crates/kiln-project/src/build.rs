//! Plan, run, resolve, publish: one build of a project.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use kiln_build::{ActionId, Engine, Error, Progress, RunOptions, RunReport, TargetState, Targets};
use kiln_diagnostic::{Diagnostic, Severity};

use crate::Project;
use crate::plan::{PartSpec, Plan, TargetSpec, Wishes, plan_project, plan_with};

/// A finished build.
pub struct Built {
    /// What was planned.
    pub plan: Plan,
    /// What happened.
    pub report: RunReport,
    /// Every target with its state, as published.
    pub targets: Arc<Targets>,
    /// Everything that was said.
    pub diagnostics: Vec<Diagnostic>,
    /// From the call to the plan, milliseconds.
    pub plan_ms: f64,
    /// From the plan to the end of the last action, milliseconds.
    pub run_ms: f64,
}

/// Builds a project: runs what is out of date and nothing else, and publishes the result in the store. Targets whose
/// sources have an error keep the content that was published last. `changed` names the files that may be different since
/// this engine's last build; `None` stands for all. A cancelled build returns `None` and changes nothing that is
/// published. [`Engine::save_memory`] is left to the caller, who may have more urgent things to do first.
///
/// # Errors
/// The tool could not do its work (see [`Error`]); the input is not to blame.
pub fn build(
    engine: &Engine,
    changed: Option<&[String]>,
    options: &RunOptions,
) -> Result<Option<Built>, Error> {
    build_with(engine, changed, Wishes::default(), options)
}

/// Does what [`build`] does, for somebody with wishes of their own.
///
/// # Errors
/// As [`build`].
pub fn build_with(
    engine: &Engine,
    changed: Option<&[String]>,
    wishes: Wishes,
    options: &RunOptions,
) -> Result<Option<Built>, Error> {
    build_in_order(engine, changed, wishes, options, |plan, _| run_plan(engine, plan, options))
}

/// What happened in a run, and for how many milliseconds; `None` if it was cancelled.
type Ran = Option<(RunReport, f64)>;

fn build_in_order(
    engine: &Engine,
    changed: Option<&[String]>,
    wishes: Wishes,
    options: &RunOptions,
    run: impl Fn(&mut Plan, f64) -> Result<Ran, Error>,
) -> Result<Option<Built>, Error> {
    let mut changed = changed;
    heal(options, |is_first| {
        if !is_first {
            changed = None;
        }
        let start = Instant::now();
        let mut plan = plan_with(engine, changed, wishes.clone())?;
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        let Some((report, run_ms)) = run(&mut plan, plan_ms)? else { return Ok(None) };
        let (targets, diagnostics) = plan.resolve(engine, &report);
        let targets = Arc::new(targets);
        engine.publish(&targets)?;
        Ok(Some(Built { plan, report, targets, diagnostics, plan_ms, run_ms }))
    })
}

/// What a build has when all that is wanted most is up to date, and the rest is not.
pub struct Early {
    /// Every target: the wanted ones as they are now, those that wait for their actions as they were published last.
    pub targets: Targets,
    /// Names of those that wait, also of new ones that have no content yet.
    pub building: Vec<String>,
    /// What was said so far.
    pub diagnostics: Vec<Diagnostic>,
    /// What happened so far.
    pub report: RunReport,
    /// From the call to the plan, milliseconds.
    pub plan_ms: f64,
    /// From the plan until now, milliseconds.
    pub run_ms: f64,
}

/// Does what [`build_with`] does; shaders, tables and the targets that `is_wanted` names go first, and `early` is told when they are done
/// and others are not. Nothing of that is published in the store yet.
///
/// # Errors
/// As [`build`].
pub fn build_wanted_first(
    engine: &Engine,
    changed: Option<&[String]>,
    wishes: Wishes,
    is_wanted: &dyn Fn(&str) -> bool,
    early: &(dyn Fn(Early) + Sync),
    options: &RunOptions,
) -> Result<Option<Built>, Error> {
    build_in_order(engine, changed, wishes, options, |plan, plan_ms| {
        plan.hurry(is_wanted);
        let start = Instant::now();
        let plan: &Plan = plan;
        let tell = |progress: Progress| match progress {
            Progress::UrgentSettled { report } => {
                let run_ms = start.elapsed().as_secs_f64() * 1e3;
                let (targets, building, diagnostics) = plan.resolve_early(engine, report);
                early(Early { targets, building, diagnostics, report: report.clone(), plan_ms, run_ms });
            }
            other => (options.progress)(other),
        };
        run_plan(engine, plan, &RunOptions { progress: &tell, ..*options })
    })
}

/// Builds what `project` asks for with the sources of the engine's folder, and publishes nothing: for exports and
/// one-shot bakes. What could not be made is missing among the targets.
///
/// # Errors
/// As [`build`].
pub fn build_apart(engine: &Engine, project: &Project, options: &RunOptions) -> Result<Option<Built>, Error> {
    heal(options, |_| {
        let start = Instant::now();
        engine.begin_plan(None);
        let plan = plan_project(engine, project.clone(), Vec::new(), Wishes::default())?;
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        let Some((report, run_ms)) = run_plan(engine, &plan, options)? else { return Ok(None) };
        let (targets, diagnostics) = plan.resolve_fresh(&report);
        Ok(Some(Built { plan, report, targets: Arc::new(targets), diagnostics, plan_ms, run_ms }))
    })
}

/// Tries again after damage, which is found, and dropped, one blob at a time, and after a source that changed while it was
/// read.
fn heal(
    options: &RunOptions,
    mut build: impl FnMut(bool) -> Result<Option<Built>, Error>,
) -> Result<Option<Built>, Error> {
    let mut tries = 0;
    loop {
        let result = build(tries == 0);
        let is_healing = matches!(result, Err(Error::Lost { .. } | Error::SourceChanged { .. }));
        if is_healing && options.cancel.load(Ordering::SeqCst) {
            return Ok(None);
        }
        if !is_healing || tries == HEALING_TRIES_MAX {
            return result;
        }
        tries += 1;
    }
}

/// More damaged blobs than this in one build are a broken disk.
pub const HEALING_TRIES_MAX: usize = 64;

fn run_plan(engine: &Engine, plan: &Plan, options: &RunOptions) -> Result<Ran, Error> {
    let start = Instant::now();
    let report = engine.run(&plan.graph, options)?;
    let run_ms = start.elapsed().as_secs_f64() * 1e3;
    let is_cancelled = !report.is_complete() && options.cancel.load(Ordering::SeqCst);
    Ok((!is_cancelled).then_some((report, run_ms)))
}

impl Built {
    /// About how long the maps of an environment took, milliseconds: its share of the build, and the decoding of its source,
    /// whenever that was; `None` if none of them was made.
    pub fn taken_ms(&self, env: &str) -> Option<f64> {
        let of_env = format!("env/{env}");
        let is_its = |name: &str| {
            name.split(' ').any(|word| {
                word.strip_prefix(&of_env).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            })
        };
        let wall_ms = |id: ActionId| {
            let record = self.report.outcome(id).record.as_ref();
            record.map_or(0.0, |record| record.result.wall_ms)
        };
        let name = |id: ActionId| self.plan.graph.action(id).name.as_str();
        let all: f64 = self.report.ended.iter().map(|id| wall_ms(*id)).sum();
        let its: Vec<ActionId> = self.report.ended.iter().copied().filter(|id| is_its(name(*id))).collect();
        let share = its.iter().map(|id| wall_ms(*id)).sum::<f64>() / all.max(f64::MIN_POSITIVE);
        let decode = format!("decode {of_env}");
        let before =
            self.plan.graph.iter().map(|(id, _)| id).find(|id| name(*id) == decode && !its.contains(id));
        (!its.is_empty()).then(|| self.run_ms * share + before.map_or(0.0, wall_ms))
    }

    /// What keeps a target from being what its sources say: the errors of the actions behind it. `None` if it is well.
    pub fn trouble_of(&self, target: &TargetSpec) -> Option<Vec<Diagnostic>> {
        if self.targets.get(&target.name).is_some_and(|target| target.state == TargetState::Fresh) {
            return None;
        }
        let first: Vec<ActionId> = target.parts.iter().map(PartSpec::action).collect();
        let behind = self.plan.graph.with_upstream(&first);
        let mut said: Vec<Diagnostic> = self
            .report
            .diagnostics()
            .filter(|(action, diagnostic)| behind.contains(action) && diagnostic.severity == Severity::Error)
            .map(|(action, diagnostic)| self.plan.with_subject(action, diagnostic))
            .collect();
        if said.is_empty() {
            said.push(Diagnostic::error(format!("`{}` was not made from its present sources", target.name)));
        }
        Some(said)
    }
}
