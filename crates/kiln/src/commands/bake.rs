//! `kiln bake`: one build, for people and for CI.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use kiln_build::{Engine, Error, Progress, Status, Store};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_project::{
    Built, Choice, Difference, DifferenceKind, HEALING_TRIES_MAX, MANIFEST_FILE, Manifest, Written, build,
    differences, manifest_of, write_outputs,
};
use serde_json::json;

use crate::args::BakeArgs;
use crate::ci::{self, TestCase};
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &BakeArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.build.dir)?;
    let cache_bytes_max = place::cache_bytes_max()?;
    let hold = engine.store().hold();
    let mut tries = 0;
    let choices = choose(&engine, args)?;
    let (built, effect) = loop {
        let built = build_with_progress(&engine, args)?;
        match apply(&engine, args, &built) {
            Ok(effect) => break (built, effect),
            // A damaged artefact was found and dropped: the next build makes it anew.
            Err(error)
                if matches!(error.downcast_ref(), Some(Error::Lost { .. })) && tries < HEALING_TRIES_MAX =>
            {
                tries += 1;
            }
            Err(error) => return Err(error),
        }
    };
    engine.save_memory().context("remembering the build")?;
    let mut report = Report::new(&engine, built, effect);
    report.choices = choices;
    if args.locked {
        report.complaints.extend(report.built.plan.open.iter().map(|env| not_locked(env)));
    }
    if let Some(path) = &args.junit {
        let xml = ci::junit("kiln bake", &report.test_cases());
        kiln_build::write_atomically(&kiln_build::Disk, path, xml.as_bytes())
            .context("writing the JUnit report")?;
    }
    match args.build.json {
        true => say!("{:#}", report.to_json()),
        false => report.print(args.timings),
    }
    if let Some(host) = args.annotate {
        let below = below_repository(&args.build.dir);
        let print = |diagnostic: &Diagnostic| match args.build.json {
            // Standard output holds JSON alone; hosts read both.
            true => eprintln!("{}", ci::annotation(host, &below, diagnostic)),
            false => say!("{}", ci::annotation(host, &below, diagnostic)),
        };
        report.built.diagnostics.iter().chain(&report.complaints).for_each(print);
    }
    if engine.store().damaged_count() > 0 {
        eprintln!("note: {} damaged cache files were dropped and rebuilt", engine.store().damaged_count());
    }
    drop(hold);
    collect_if_due(engine.store(), cache_bytes_max);
    Ok(if report.is_good() { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}

/// What became of the targets.
enum Effect {
    Written(Written),
    /// With the manifest that a bake would write.
    Checked(Vec<Difference>, Manifest),
}

fn apply(engine: &Engine, args: &BakeArgs, built: &Built) -> anyhow::Result<Effect> {
    let output_dir = &built.plan.project.output_dir;
    if !args.check {
        return Ok(Effect::Written(
            write_outputs(engine, &built.targets, output_dir).context("writing baked files")?,
        ));
    }
    let path = args.manifest.clone().unwrap_or_else(|| engine.folder().join(output_dir).join(MANIFEST_FILE));
    let committed = match std::fs::read(&path) {
        Ok(text) => Manifest::parse(&text).ok_or_else(|| {
            place::WrongInput(format!(
                "{} is no manifest that this Kiln reads\n  help: bake again and commit what it writes",
                path.display()
            ))
        })?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound && args.manifest.is_none() => {
            Manifest::default()
        }
        Err(error) => {
            return Err(
                place::WrongInput(format!("cannot read the manifest {}: {error}", path.display())).into()
            );
        }
    };
    let present = manifest_of(engine, &built.targets)?;
    let mut found = differences(&committed, &present);
    // What was not made says nothing of what it would be.
    let is_made = |name: &str| {
        let spec = built.plan.targets.iter().find(|spec| spec.name == name);
        spec.is_none_or(|spec| built.trouble_of(spec).is_none())
    };
    found.retain(|difference| is_made(&difference.target));
    Ok(Effect::Checked(found, present))
}

/// Chooses how good environments are that ask for a time. What a check compares with was chosen when that was baked.
fn choose(engine: &Engine, args: &BakeArgs) -> anyhow::Result<Vec<Choice>> {
    if args.check || args.locked {
        return Ok(Vec::new());
    }
    let cancel = AtomicBool::new(false);
    let options = place::run_options(&args.build, args.keep_going, &cancel, &|_| {});
    kiln_project::settle(engine, &options).context("choosing for the times that kiln.toml asks for")
}

fn not_locked(env: &str) -> Diagnostic {
    Diagnostic::error(format!("kiln.lock does not say how to bake env.{env} within its `time_ms`"))
        .in_file(kiln_project::LOCK_FILE)
        .with_help("`kiln bake` without --locked chooses; commit the kiln.lock that it writes")
}

/// What a choice says, and what it came to.
fn describe_choice(choice: &Choice, built: &Built) -> String {
    let Choice { env, time_ms, expected_ms, locked, fits } = choice;
    let took = built.taken_ms(env).map_or_else(String::new, |ms| format!(", took {}", report::duration(ms)));
    let misfit = if *fits { "" } else { " (nothing coarser to choose)" };
    format!(
        "env/{env}: {} asked, {} expected{misfit}{took}; error {} at {} texels a face, in {}",
        report::duration(*time_ms),
        report::duration(*expected_ms),
        locked.error,
        locked.size,
        kiln_project::LOCK_FILE
    )
}

fn build_with_progress(engine: &Engine, args: &BakeArgs) -> anyhow::Result<Built> {
    let bar = progress_bar();
    let progress = show_progress(&bar);
    let cancel = AtomicBool::new(false);
    let options = place::run_options(&args.build, args.keep_going, &cancel, &progress);
    let built = build(engine, None, &options);
    bar.finish_and_clear();
    built.context("building")?.context("the build was cancelled")
}

/// Draws nothing where standard error is no terminal.
pub(crate) fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {elapsed:>4}  {wide_msg}") {
        bar.set_style(style);
    }
    bar
}

pub(crate) fn show_progress(bar: &ProgressBar) -> impl Fn(Progress) + Sync + '_ {
    |progress| match progress {
        Progress::Started { name, .. } => bar.set_message(name.to_owned()),
        Progress::UrgentSettled { .. } => {}
        Progress::Settled { done, total } => {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
    }
}

/// The project's folder as seen from the root of its repository, as CI hosts name files.
fn below_repository(dir: &Path) -> String {
    let Ok(folder) = dir.canonicalize() else { return String::new() };
    let root = folder.ancestors().find(|ancestor| ancestor.join(".git").exists());
    let below = root.and_then(|root| folder.strip_prefix(root).ok());
    below.map_or_else(String::new, |below| below.to_string_lossy().replace('\\', "/"))
}

/// Looks the cache over now and then; a bake never fails over it.
fn collect_if_due(store: &Store, bytes_max: u64) {
    match store.collect_if_due(bytes_max) {
        Ok(Some(collected)) if collected.removed_files > 0 => eprintln!(
            "note: the cache was over {}: {} went, unused for longest (`kiln gc --help`)",
            report::size(bytes_max),
            report::size(collected.removed_bytes)
        ),
        Ok(_) => {}
        Err(error) => eprintln!("warning: the cache was not looked over: {error}"),
    }
}

struct Report {
    built: Built,
    effect: Effect,
    /// Number of the build, if it changed something.
    build_number: Option<u64>,
    hashed: (usize, u64),
    sources: usize,
    damaged: usize,
    /// What the check has to say, besides the build.
    complaints: Vec<Diagnostic>,
    /// What was chosen for times that are asked for, before the build.
    choices: Vec<Choice>,
}

/// Shader variants of a build.
struct Variants {
    /// Targets.
    asked: usize,
    /// Actions behind them: sets of features that can differ.
    compiled: usize,
    /// Texts that came out.
    artefacts: usize,
}

impl Variants {
    fn of(built: &Built) -> Variants {
        let asked = built.plan.targets.iter().filter(|spec| spec.kind == "shader");
        let actions: BTreeSet<_> = asked.clone().map(|spec| spec.parts[0].action()).collect();
        let texts =
            asked.clone().filter_map(|spec| Some(built.targets.get(&spec.name)?.parts.first()?.digest));
        let artefacts: BTreeSet<_> = texts.collect();
        Variants { asked: asked.count(), compiled: actions.len(), artefacts: artefacts.len() }
    }

    fn to_json(&self) -> serde_json::Value {
        json!({"asked": self.asked, "compiled": self.compiled, "artefacts": self.artefacts})
    }
}

impl Report {
    fn new(engine: &Engine, built: Built, effect: Effect) -> Report {
        let mut complaints = Vec::new();
        if let Effect::Checked(differences, _) = &effect {
            complaints.extend(differences.iter().map(complaint));
        }
        let manifest = match &effect {
            Effect::Written(written) => &written.manifest,
            Effect::Checked(_, manifest) => manifest,
        };
        if let Some(bytes_max) =
            built.plan.project.bytes_max.filter(|bytes_max| manifest.bytes() > *bytes_max)
        {
            complaints.push(over_budget(manifest, bytes_max));
        }
        Report {
            build_number: kiln_project::last_build(engine).map(|build| build.number),
            hashed: engine.sources().hashed(),
            sources: engine.sources().looked_at().len(),
            damaged: engine.store().damaged_count(),
            built,
            effect,
            complaints,
            choices: Vec::new(),
        }
    }

    fn is_good(&self) -> bool {
        !has_errors(&self.built.diagnostics) && !has_errors(&self.complaints)
    }

    fn print(&self, timings: bool) {
        let built = &self.built;
        let work = kiln_daemon::to_work(built);
        let lines = if timings {
            let line = |action: &kiln_link::ActionTime| {
                format!("{:<44} {:>9}   {}", action.name, report::duration(action.wall_ms), action.reason)
            };
            work.ran.iter().map(line).collect()
        } else {
            report::work_lines(&work)
        };
        lines.iter().for_each(|line| say!("{line}"));
        let Variants { asked, compiled, artefacts } = Variants::of(built);
        if work.ran.iter().any(|action| action.name.starts_with("compile ")) {
            let shared = asked.saturating_sub(artefacts);
            say!("shader variants: {asked} asked, {compiled} compiled, {shared} shared");
        }
        self.choices.iter().for_each(|choice| say!("{}", describe_choice(choice, built)));
        report::print_diagnostics(&built.diagnostics, !work.ran.is_empty());
        report::print_diagnostics(&self.complaints, true);
        say!(
            "{} ran, {} reused{} in {} (plan {}); {}, {}",
            report::count(work.ran.len(), "action"),
            work.reused,
            self.trouble(),
            report::duration(built.plan_ms + built.run_ms),
            report::duration(built.plan_ms),
            report::count(built.targets.len(), "target"),
            self.effect_in_words(),
        );
    }

    fn trouble(&self) -> String {
        let of = |wanted: &str| {
            self.built.report.outcomes.iter().filter(|outcome| status(outcome) == wanted).count()
        };
        let (failed, blocked, not_run) = (of("failed"), of("blocked"), of("not run"));
        let mut text = String::new();
        if failed + blocked > 0 {
            text += &format!(", {failed} failed, {blocked} not possible because of them");
        }
        if not_run > 0 {
            text += &format!(", {not_run} not begun (--keep-going does)");
        }
        text
    }

    fn effect_in_words(&self) -> String {
        let output_dir = &self.built.plan.project.output_dir;
        match &self.effect {
            Effect::Written(written) => {
                format!("{} written to {output_dir}", report::count(written.written.len(), "file"))
            }
            Effect::Checked(differences, _)
                if differences.is_empty() && has_errors(&self.built.diagnostics) =>
            {
                "the rest is as the manifest says".to_owned()
            }
            Effect::Checked(differences, manifest) if differences.is_empty() => {
                format!("the manifest is as it must be, {} in its files", report::size(manifest.bytes()))
            }
            Effect::Checked(differences, _) => {
                let count = report::count(differences.len(), "target");
                match has_errors(&self.built.diagnostics) {
                    true => format!("{count} would change"),
                    false => format!("{count} would change: bake and commit {output_dir}/{MANIFEST_FILE}"),
                }
            }
        }
    }

    fn test_cases(&self) -> Vec<TestCase> {
        let complaints: BTreeMap<&str, &Diagnostic> = match &self.effect {
            Effect::Written(_) => BTreeMap::new(),
            Effect::Checked(differences, _) => differences
                .iter()
                .map(|difference| difference.target.as_str())
                .zip(&self.complaints)
                .collect(),
        };
        let case = |spec: &kiln_project::TargetSpec| {
            let actions = spec.parts.iter().map(kiln_project::PartSpec::action);
            let outcomes = actions.map(|action| self.built.report.outcome(action));
            let ran = outcomes.filter(|outcome| matches!(outcome.status, Status::Ran { .. }));
            let records = ran.filter_map(|outcome| outcome.record.as_ref());
            let trouble =
                self.built.trouble_of(spec).map(|said| said.iter().map(Diagnostic::to_string).collect());
            let complaint = complaints.get(spec.name.as_str()).map(|complaint| vec![complaint.to_string()]);
            TestCase {
                class: spec.kind.to_owned(),
                name: spec.name.clone(),
                seconds: records.map(|record| record.result.wall_ms / 1e3).sum(),
                failure: trouble.or(complaint).map(|texts: Vec<String>| texts.join("\n\n")),
            }
        };
        let mut cases: Vec<TestCase> = self.built.plan.targets.iter().map(case).collect();
        let known = |name: &str| self.built.plan.targets.iter().any(|spec| spec.name == name);
        let general =
            self.built.plan.diagnostics.iter().filter(|said| has_errors(std::slice::from_ref(*said)));
        let removed = complaints.iter().filter(|(name, _)| !known(name)).map(|(_, complaint)| *complaint);
        let budget = self.complaints.iter().skip(complaints.len());
        let general: Vec<String> = general.chain(removed).chain(budget).map(Diagnostic::to_string).collect();
        cases.push(TestCase {
            class: "project".to_owned(),
            name: kiln_project::PROJECT_FILE.to_owned(),
            seconds: self.built.plan_ms / 1e3,
            failure: (!general.is_empty()).then(|| general.join("\n\n")),
        });
        cases
    }

    fn to_json(&self) -> serde_json::Value {
        let built = &self.built;
        let actions = built.plan.graph.iter().map(|(id, action)| {
            let outcome = built.report.outcome(id);
            let reason = match &outcome.status {
                Status::Ran { reason } => Some(reason.to_string()),
                Status::Blocked { by } => Some(by.clone()),
                Status::Reused | Status::NotRun => None,
            };
            let wall_ms = outcome.record.as_ref().map(|record| record.result.wall_ms);
            json!({"name": action.name, "status": status(outcome), "reason": reason, "wall_ms": wall_ms})
        });
        let targets = built.targets.iter().map(|(name, target)| {
            (name.clone(), json!({"kind": target.kind, "state": target.state, "sha256": target.digest(), "bytes": target.bytes()}))
        });
        let mut json = json!({
            "actions": actions.collect::<Vec<_>>(),
            "targets": targets.collect::<serde_json::Map<_, _>>(),
            "diagnostics": built.diagnostics.iter().chain(&self.complaints).collect::<Vec<_>>(),
            "shader_variants": Variants::of(built).to_json(),
            "plan_ms": built.plan_ms,
            "run_ms": built.run_ms,
            "build": self.build_number,
            "sources": {"looked_at": self.sources, "hashed": self.hashed.0, "hashed_bytes": self.hashed.1},
            "damaged": self.damaged,
        });
        if !self.choices.is_empty() {
            let choice = |choice: &Choice| {
                json!({
                    "env": choice.env, "time_ms": choice.time_ms, "expected_ms": choice.expected_ms,
                    "taken_ms": built.taken_ms(&choice.env), "fits": choice.fits, "locked": choice.locked,
                })
            };
            json["choices"] = self.choices.iter().map(choice).collect();
        }
        match &self.effect {
            Effect::Written(written) => {
                json["written"] = json!(written.written);
                json["kept"] = json!(written.kept);
                json["removed"] = json!(written.removed);
                json["bytes"] = json!(written.manifest.bytes());
            }
            Effect::Checked(differences, manifest) => {
                json["check"] = json!(differences);
                json["bytes"] = json!(manifest.bytes());
            }
        }
        json
    }
}

fn status(outcome: &kiln_build::Outcome) -> &'static str {
    match &outcome.status {
        _ if outcome.failed() => "failed",
        Status::Reused => "reused",
        Status::Ran { .. } => "ran",
        Status::Blocked { .. } => "blocked",
        Status::NotRun => "not run",
    }
}

fn complaint(difference: &Difference) -> Diagnostic {
    let what = match difference.kind {
        DifferenceKind::Added => "is not in the manifest",
        DifferenceKind::Removed => "is in the manifest, and nothing makes it",
        DifferenceKind::Changed => "is not what the manifest says",
    };
    let mut diagnostic = Diagnostic::error(format!("`{}` {what}", difference.target));
    diagnostic.notes.clone_from(&difference.details);
    diagnostic
}

fn over_budget(manifest: &Manifest, bytes_max: u64) -> Diagnostic {
    let mut largest: Vec<_> = manifest.targets.iter().map(|(name, target)| (target.bytes(), name)).collect();
    largest.sort_by(|a, b| b.cmp(a));
    let message = format!(
        "the baked files take {}, over the budget of {}",
        report::size(manifest.bytes()),
        report::size(bytes_max)
    );
    let mut diagnostic = Diagnostic::error(message)
        .in_file(kiln_project::PROJECT_FILE)
        .with_help("smaller sizes, or another `max_bytes` in [check]");
    diagnostic.notes =
        largest.iter().take(5).map(|(bytes, name)| format!("{name}: {}", report::size(*bytes))).collect();
    diagnostic
}
