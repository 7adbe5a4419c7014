//! `kiln why`: what changed when, and why the rest was left alone.

use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use kiln_build::{BuildNote, Engine};
use kiln_project::{ActionWhy, Plan, with_values};
use serde_json::json;

use crate::args::WhyArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &WhyArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.dir)?;
    let _hold = engine.store().hold();
    let builds = engine.builds();
    let Some(target) = &args.target else {
        print_builds(&builds, args.json);
        return Ok(ExitCode::SUCCESS);
    };
    let plan = kiln_project::plan(&engine, None).context("planning")?;
    let Some(actions) = kiln_project::why(&engine, &plan, target) else {
        eprintln!("error: there is no target `{target}`{}", suggestion(target, &plan));
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    };
    if args.json {
        say!("{:#}", json!({"target": target, "builds": builds, "actions": actions}));
        return Ok(ExitCode::SUCCESS);
    }
    print_summary(&engine, target, &actions, &builds);
    let mut last_text = String::new();
    for action in &actions {
        let text = explanation(action, &builds);
        // The levels of a map have the same story: it is told once.
        if text == last_text {
            say!("{}", action.action);
        } else {
            say!("\n{}", action.action);
            last_text.clone_from(&text);
        }
        let is_last = actions.iter().skip_while(|other| other.action != action.action).nth(1);
        if is_last.is_none_or(|next| explanation(next, &builds) != text) {
            say!("{text}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn print_builds(builds: &[BuildNote], json: bool) {
    if json {
        return say!("{:#}", json!({"builds": builds}));
    }
    if builds.is_empty() {
        say!("this project was not baked yet with this cache");
    }
    for build in builds.iter().rev().take(20) {
        let BuildNote { number, ran, reused, failed, .. } = build;
        say!("build {number:<5} {:<18} {ran} ran, {reused} reused, {failed} failed", ago(build));
    }
}

fn print_summary(engine: &Engine, target: &str, actions: &[ActionWhy], builds: &[BuildNote]) {
    let out_of_date = actions.iter().filter(|action| action.is_out_of_date).count();
    let built = actions.iter().filter_map(|action| action.change.as_ref()).map(|change| change.build).max();
    let last = kiln_project::last_build(engine);
    let state = match (out_of_date, built) {
        (_, None) if actions.is_empty() => "follows from kiln.toml alone".to_owned(),
        (_, None) => "was never built".to_owned(),
        (0, _) if actions.iter().any(|action| action.is_at_fault) => {
            "cannot be made from its present sources: `kiln bake` says why; what was good last is still served".to_owned()
        }
        (0, Some(build)) => match last.filter(|last| last.number > build) {
            Some(last) => {
                format!("is up to date since build {build}; build {} had no reason to touch it", last.number)
            }
            None => format!("is up to date since build {build}{}", time_of(build, builds)),
        },
        (count, Some(_)) => format!("is out of date: {} would or may run", report::count(count, "action")),
    };
    say!("{target} {state}");
}

fn explanation(action: &ActionWhy, builds: &[BuildNote]) -> String {
    let mut lines = vec![format!("  now: {}", action.now)];
    match &action.change {
        None => lines.push("  it was never built here".to_owned()),
        Some(change) => {
            let how = if change.ran { "ran" } else { "was found in the store" };
            let since =
                change.since.map_or_else(String::new, |since| format!(", after the result of build {since}"));
            let when = time_of(change.build, builds);
            lines.push(format!(
                "  {how} in build {}{when}{since}: {}",
                change.build,
                with_values(&change.reason)
            ));
        }
    }
    for cut in &action.cut_off_by {
        lines.push(format!(
            "  not rebuilt in build {}: {} ran and made the same {} ({})",
            cut.build,
            cut.action,
            cut.output,
            cut.digest.short()
        ));
    }
    lines.join("\n")
}

fn time_of(build: u64, builds: &[BuildNote]) -> String {
    builds
        .iter()
        .find(|note| note.number == build)
        .map_or_else(String::new, |note| format!(" ({})", ago(note)))
}

fn ago(build: &BuildNote) -> String {
    let then = UNIX_EPOCH + Duration::from_secs(build.unix_s);
    let seconds = SystemTime::now().duration_since(then).unwrap_or_default().as_secs();
    let (number, unit) = match seconds {
        0..120 => return "just now".to_owned(),
        120..7200 => (seconds / 60, "minutes"),
        7200..172_800 => (seconds / 3600, "hours"),
        _ => (seconds / 86_400, "days"),
    };
    format!("{number} {unit} ago")
}

/// The nearest names, or where to find them.
pub(crate) fn suggestion(wanted: &str, plan: &Plan) -> String {
    let actions = plan.graph.iter().map(|(_, action)| action.name.as_str());
    let names = plan.targets.iter().map(|target| target.name.as_str()).chain(actions);
    match kiln_project::suggest(wanted, names) {
        Some(help) => format!("\n  help: {help}"),
        None => "\n  help: `kiln plan --json` lists the targets".to_owned(),
    }
}
