//! `kiln plan`: what scenes call for, and what a bake would do.

use std::process::ExitCode;

use anyhow::Context as _;
use kiln_build::Forecast;
use kiln_diagnostic::has_errors;
use kiln_project::with_values;
use serde_json::json;

use crate::args::PlanArgs;
use crate::commands::demand;
use crate::out::say;
use crate::picture::Picture;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    let start = std::time::Instant::now();
    let engine = place::open_engine(&args.dir)?;
    let _hold = engine.store().hold();
    let plan = kiln_project::plan(&engine, None).context("planning")?;
    let forecasts = engine.forecast(&plan.graph);
    // What was hashed for this need not be hashed again.
    engine.save_memory().context("remembering the sources")?;
    let plan_ms = start.elapsed().as_secs_f64() * 1e3;
    if let Some(path) = &args.svg {
        let svg = Picture::of_demand(&plan, kiln_project::skipped(&engine, &plan)).to_svg();
        kiln_build::write_atomically(&kiln_build::Disk, path, svg.as_bytes())
            .context("writing the picture")?;
    }
    let actions = || plan.graph.iter().map(|(_, action)| action.name.as_str()).zip(&forecasts);
    if args.json {
        let actions: Vec<_> = actions().map(|(name, forecast)| to_json(name, forecast)).collect();
        let (files, bytes) = engine.sources().hashed();
        let sources =
            json!({"looked_at": engine.sources().looked_at().len(), "hashed": files, "hashed_bytes": bytes});
        let targets: Vec<_> = plan.targets.iter().map(|target| &target.name).collect();
        let demand = demand::to_json(&engine, &plan);
        let plan = json!({"demand": demand, "actions": actions, "targets": targets, "diagnostics": plan.diagnostics, "plan_ms": plan_ms, "sources": sources});
        say!("{plan:#}");
    } else {
        if !plan.scenes.is_empty() {
            demand::print(&engine, &plan);
        }
        let mut expected_ms = 0.0;
        for (name, forecast) in actions() {
            if let Forecast::Runs { last_ms, .. } | Forecast::MayRun { last_ms, .. } = forecast {
                expected_ms += last_ms.unwrap_or(0.0);
            }
            if let Some(line) = line(name, forecast) {
                say!("{line}");
            }
        }
        report::print_diagnostics(&plan.diagnostics, true);
        let count =
            |wanted: fn(&Forecast) -> bool| forecasts.iter().filter(|forecast| wanted(forecast)).count();
        say!(
            "{} would run, {} may run, {} up to date, {} cannot; planned in {}{}",
            report::count(count(|forecast| matches!(forecast, Forecast::Runs { .. })), "action"),
            count(|forecast| matches!(forecast, Forecast::MayRun { .. })),
            count(|forecast| matches!(forecast, Forecast::UpToDate)),
            count(|forecast| matches!(forecast, Forecast::Failed | Forecast::Blocked { .. })),
            report::duration(plan_ms),
            if expected_ms > 0.0 {
                format!("; these took {} of work when they ran last", report::duration(expected_ms))
            } else {
                String::new()
            },
        );
    }
    let is_bad = has_errors(&plan.diagnostics) || forecasts.contains(&Forecast::Failed);
    Ok(if is_bad { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS })
}

fn line(name: &str, forecast: &Forecast) -> Option<String> {
    let last = |last_ms: &Option<f64>| last_ms.map_or_else(String::new, report::duration);
    match forecast {
        Forecast::UpToDate => None,
        Forecast::Runs { reason, last_ms } => {
            Some(format!("run      {name:<44} {:>9}   {}", last(last_ms), with_values(reason)))
        }
        Forecast::MayRun { after, last_ms } => Some(format!(
            "may run  {name:<44} {:>9}   if {} makes something else",
            last(last_ms),
            after.join(" or ")
        )),
        Forecast::Failed => Some(format!("fails    {name:<44} {:>9}   as it did; nothing changed since", "")),
        Forecast::Blocked { by } => Some(format!("cannot   {name:<44} {:>9}   `{by}` makes nothing", "")),
    }
}

fn to_json(name: &str, forecast: &Forecast) -> serde_json::Value {
    let (status, reason, after, last_ms) = match forecast {
        Forecast::UpToDate => ("up to date", None, None, None),
        Forecast::Runs { reason, last_ms } => ("would run", Some(reason), None, *last_ms),
        Forecast::MayRun { after, last_ms } => ("may run", None, Some(after.clone()), *last_ms),
        Forecast::Failed => ("fails", None, None, None),
        Forecast::Blocked { by } => ("blocked", None, Some(vec![by.clone()]), None),
    };
    json!({"name": name, "status": status, "reason": reason, "after": after, "last_ms": last_ms})
}
