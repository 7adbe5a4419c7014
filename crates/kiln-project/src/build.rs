//! Plan, run, resolve: one build of a project.

use std::sync::atomic::Ordering;
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
    let mut last = last.clone();
    last.retain(|_, target| {
        target.parts.iter().all(|part| engine.store().contains(&part.digest, part.bytes))
    });
    let mut tries = 0;
    loop {
        let damaged_before = engine.store().damaged_count();
        let result = build_once(engine, &last, options);
        // Damage is found, and dropped, one blob at a time; a source that changed while it was read is seen as it is at
        // the second look.
        let is_healing = engine.store().damaged_count() > damaged_before && tries < HEALING_TRIES_MAX;
        if result.is_ok() || options.cancel.load(Ordering::SeqCst) || !(is_healing || tries == 0) {
            return result;
        }
        tries += 1;
    }
}

/// More damaged blobs than this in one build are a broken disk.
const HEALING_TRIES_MAX: usize = 64;

fn build_once(engine: &Engine, last: &Targets, options: &RunOptions) -> Result<Option<Built>, Error> {
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
