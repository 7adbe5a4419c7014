//! Why a target is as it is: what changed when, and why the rest was left alone.

use kiln_build::{ActionId, BuildNote, ChangeNote, Digest, Engine, Forecast, Graph, Input};
use serde::Serialize;

use crate::Plan;

/// What is known of one action behind a target.
#[derive(Clone, Debug, Serialize)]
pub struct ActionWhy {
    /// Its name.
    pub action: String,
    /// What a build would do with it now, in words.
    pub now: String,
    /// Whether a build would, or might, run it now.
    pub is_out_of_date: bool,
    /// Whether it makes nothing, because its input, or that of an action before it, is at fault.
    pub is_at_fault: bool,
    /// What was different when it last got another result; `None` if it was never built.
    pub change: Option<ChangeNote>,
    /// Actions before it that ran later and made the same again, so that it did not have to.
    pub cut_off_by: Vec<CutOff>,
}

/// An action that ran and made what was there already.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CutOff {
    /// Its name.
    pub action: String,
    /// The build in which it ran.
    pub build: u64,
    /// Which of its outputs.
    pub output: String,
    /// What that still is.
    pub digest: Digest,
}

/// Explains the actions of a target, or one action, and everything they read from: what is nearest to the target comes
/// first. `None` if the plan has nothing of that name.
pub fn why(engine: &Engine, plan: &Plan, name: &str) -> Option<Vec<ActionWhy>> {
    let first = plan.actions_of(name)?;
    let forecasts = engine.forecast(&plan.graph);
    let explain = |id: ActionId| explain(engine, &plan.graph, id, &forecasts[id.index()]);
    Some(plan.graph.with_upstream(&first).into_iter().map(explain).collect())
}

/// The last build that changed something in this project.
pub fn last_build(engine: &Engine) -> Option<BuildNote> {
    engine.builds().pop()
}

fn explain(engine: &Engine, graph: &Graph, id: ActionId, forecast: &Forecast) -> ActionWhy {
    let action = graph.action(id);
    let change = engine.history(&action.name).map(|(_, change)| change);
    let now = match forecast {
        Forecast::UpToDate => "up to date".to_owned(),
        Forecast::Failed => "its input is at fault, and has not changed since that was found".to_owned(),
        Forecast::Runs { reason, .. } => format!("would run now: {}", with_values(reason)),
        Forecast::MayRun { after, .. } => {
            format!("would run now, unless {} makes the same again", after.join(", "))
        }
        Forecast::Blocked { by } => format!("cannot run: `{by}` made nothing"),
    };
    let is_out_of_date = matches!(forecast, Forecast::Runs { .. } | Forecast::MayRun { .. });
    let is_at_fault = matches!(forecast, Forecast::Failed | Forecast::Blocked { .. });
    let own_build = change.as_ref().map_or(0, |change| change.build);
    let cut_off_by = action.inputs.iter().filter_map(|input| {
        let Input::Output { action: upstream, output } = input else { return None };
        let upstream = &graph.action(*upstream).name;
        let (record, change) = engine.history(upstream)?;
        let made = record.result.outputs.iter().find(|made| made.name == *output)?;
        (change.build > own_build).then(|| CutOff {
            action: upstream.clone(),
            build: change.build,
            output: output.clone(),
            digest: made.digest,
        })
    });
    ActionWhy {
        action: action.name.clone(),
        now,
        is_out_of_date,
        is_at_fault,
        change,
        cut_off_by: cut_off_by.collect(),
    }
}

/// A reason with old and new values.
pub fn with_values(reason: &kiln_build::Reason) -> String {
    match reason {
        kiln_build::Reason::Changed(changes) => {
            changes.iter().map(kiln_build::Change::with_values).collect::<Vec<_>>().join(", ")
        }
        other => other.to_string(),
    }
}
