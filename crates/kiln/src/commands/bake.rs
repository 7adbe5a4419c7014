//! `kiln bake`: one build, for people and for CI.

use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use kiln_build::{Engine, Progress, RunOptions, Status};
use kiln_diagnostic::has_errors;
use kiln_project::{Built, Written, build, write_outputs};
use serde_json::json;

use crate::args::BakeArgs;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &BakeArgs) -> anyhow::Result<ExitCode> {
    let engine = Engine::open(&place::project_folder(&args.build.dir)?, &place::cache_folder()?)
        .context("opening the project")?;
    let (built, written) = loop {
        let damaged_before = engine.store().damaged_count();
        let built = build_with_progress(&engine, place::jobs(args.build.jobs))?;
        let folder = engine.folder().join(&built.plan.project.output_dir);
        match write_outputs(engine.store(), &built.targets, &folder) {
            Ok(written) => break (built, written),
            // A damaged artefact was found and dropped: the next build makes it anew.
            Err(_) if engine.store().damaged_count() > damaged_before => {}
            Err(error) => return Err(error).context("writing baked files"),
        }
    };
    if args.build.json {
        println!("{:#}", to_json(&built, &written));
    } else {
        print_report(args, &built, &written);
    }
    if engine.store().damaged_count() > 0 {
        eprintln!("note: {} damaged cache files were dropped and rebuilt", engine.store().damaged_count());
    }
    Ok(if has_errors(&built.diagnostics) { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS })
}

fn build_with_progress(engine: &Engine, jobs: usize) -> anyhow::Result<Built> {
    // Draws nothing where standard error is no terminal.
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed:>4}  {wide_msg}") {
        bar.set_style(style);
    }
    let progress = |progress: Progress| match progress {
        Progress::Started { name, .. } => bar.set_message(name.to_owned()),
        Progress::Settled { done, total } => {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
    };
    let cancel = AtomicBool::new(false);
    let options = RunOptions { jobs, cancel: &cancel, progress: &progress };
    let last = engine.last_targets();
    let built = build(engine, &last, &options);
    bar.finish_and_clear();
    built.context("building")?.context("the build was cancelled")
}

fn print_report(args: &BakeArgs, built: &Built, written: &Written) {
    let work = kiln_daemon::to_work(built);
    let lines = if args.timings {
        let line = |action: &kiln_link::ActionTime| {
            format!("{:<44} {:>9}   {}", action.name, report::duration(action.wall_ms), action.reason)
        };
        work.ran.iter().map(line).collect()
    } else {
        report::work_lines(&work)
    };
    lines.iter().for_each(|line| println!("{line}"));
    report::print_diagnostics(&built.diagnostics, !work.ran.is_empty());
    let blocked =
        built.report.outcomes.iter().filter(|outcome| matches!(outcome.status, Status::Blocked { .. }));
    let failed = built.report.outcomes.iter().filter(|outcome| outcome.failed());
    let (blocked, failed) = (blocked.count(), failed.count());
    let trouble = match failed + blocked {
        0 => String::new(),
        _ => format!(", {failed} failed, {blocked} not possible because of them"),
    };
    println!(
        "{} ran, {} reused{trouble} in {} (plan {}); {}, {} written to {}",
        report::count(work.ran.len(), "action"),
        work.reused,
        report::duration(built.plan_ms + built.run_ms),
        report::duration(built.plan_ms),
        report::count(built.targets.len(), "target"),
        report::count(written.written.len(), "file"),
        built.plan.project.output_dir,
    );
}

fn to_json(built: &Built, written: &Written) -> serde_json::Value {
    let actions = built.plan.graph.iter().map(|(id, action)| {
        let outcome = built.report.outcome(id);
        let (status, reason) = match &outcome.status {
            Status::Reused => ("reused", None),
            Status::Ran { reason } => ("ran", Some(reason.as_str())),
            Status::Blocked { by } => ("blocked", Some(by.as_str())),
            Status::NotRun => ("not run", None),
        };
        let status = if outcome.failed() { "failed" } else { status };
        let wall_ms = outcome.record.as_ref().map(|record| record.wall_ms);
        json!({"name": action.name, "status": status, "reason": reason, "wall_ms": wall_ms})
    });
    let targets = built.targets.iter().map(|(name, target)| {
        (name.clone(), json!({"kind": target.kind, "state": target.state, "sha256": target.digest(), "bytes": target.bytes()}))
    });
    json!({
        "actions": actions.collect::<Vec<_>>(),
        "targets": targets.collect::<serde_json::Map<_, _>>(),
        "diagnostics": built.diagnostics,
        "plan_ms": built.plan_ms,
        "run_ms": built.run_ms,
        "written": written.written,
        "kept": written.kept,
        "removed": written.removed,
    })
}
