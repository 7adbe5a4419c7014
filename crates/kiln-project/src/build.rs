//! Plan, run, resolve: one build of a project.

use std::time::Instant;

use kiln_build::{Engine, Error, RunOptions, RunReport, Targets};
use kiln_diagnostic::Diagnostic;

use crate::plan::{Plan, plan};

/// A finished build.
pub struct Built {
    /// What was planned.
    pub plan: Plan,
    /// What happened.
    pub report: RunReport,
    /// Every target with its state.
    pub targets: Targets,
    /// Everything that was said.
    pub diagnostics: Vec<Diagnostic>,
    /// From the call to the plan, milliseconds.
    pub plan_ms: f64,
    /// From the plan to the end of the last action, milliseconds.
    pub run_ms: f64,
}

/// Builds a project: runs what is out of date and nothing else. Targets whose sources have an error keep the
/// content that `last` has for them. A cancelled build returns `None` and changes nothing that is published.
///
/// # Errors
/// The tool could not do its work (see [`Error`]); the input is not to blame.
pub fn build(engine: &Engine, last: &Targets, options: &RunOptions) -> Result<Option<Built>, Error> {
    let start = Instant::now();
    let plan = plan(engine)?;
    let plan_ms = start.elapsed().as_secs_f64() * 1e3;
    let start = Instant::now();
    let report = engine.run(&plan.graph, options)?;
    let run_ms = start.elapsed().as_secs_f64() * 1e3;
    if !report.is_complete() {
        return Ok(None);
    }
    let (targets, diagnostics) = plan.resolve(&report, last);
    engine.save(targets.clone())?;
    Ok(Some(Built { plan, report, targets, diagnostics, plan_ms, run_ms }))
}
