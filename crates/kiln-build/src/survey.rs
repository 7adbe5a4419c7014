//! What of a graph is up to date, found out without running anything.

use std::sync::Arc;

use crate::memory::ActionMemory;
use crate::run::{Outcome, Status};
use crate::{Action, ActionId, ActionRecord, ActionResult, Engine, Graph, Input, InputRecord, Reason};

/// What a run would do with an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Forecast {
    /// Its result is known: made earlier from the same inputs, here or elsewhere.
    UpToDate,
    /// The same, and that result is that its input is at fault.
    Failed,
    /// It would run.
    Runs {
        /// Why.
        reason: Reason,
        /// What it took when it last ran under this name, in milliseconds.
        last_ms: Option<f64>,
    },
    /// It would run, unless those that run before it make the same again.
    MayRun {
        /// Names of the actions whose outputs decide it.
        after: Vec<String>,
        /// What it took when it last ran under this name, in milliseconds.
        last_ms: Option<f64>,
    },
    /// It cannot run: an action it reads from made nothing.
    Blocked {
        /// Name of that action.
        by: String,
    },
}

/// What is known of an action before anything runs.
pub(crate) enum Standing {
    Settled(Outcome),
    /// All inputs are known, and the store has no result for them.
    Due(ActionRecord),
    /// An input comes from an action that is due, or waits itself.
    Waiting(Vec<ActionId>),
}

impl Engine {
    /// What [`Engine::run`] would do with each action, in the graph's order.
    pub fn forecast(&self, graph: &Graph) -> Vec<Forecast> {
        let standings = self.survey(graph);
        let forecasts = graph.iter().zip(standings).map(|((_, action), standing)| {
            let last_ms = || self.history(&action.name).map(|(record, _)| record.result.wall_ms);
            match standing {
                Standing::Settled(Outcome { status: Status::Blocked { by }, .. }) => Forecast::Blocked { by },
                Standing::Settled(outcome) if outcome.failed() => Forecast::Failed,
                Standing::Settled(_) => Forecast::UpToDate,
                Standing::Due(record) => Forecast::Runs { reason: self.reason(&record), last_ms: last_ms() },
                Standing::Waiting(upstream) => {
                    let after = upstream.into_iter().map(|id| graph.action(id).name.clone()).collect();
                    Forecast::MayRun { after, last_ms: last_ms() }
                }
            }
        });
        forecasts.collect()
    }

    /// Settles what needs no work, in the graph's order, which has every input before its reader.
    pub(crate) fn survey(&self, graph: &Graph) -> Vec<Standing> {
        let mut standings: Vec<Standing> = Vec::with_capacity(graph.len());
        for (_, action) in graph.iter() {
            let outcome = |id: ActionId| match &standings[id.0] {
                Standing::Settled(outcome) => Some(outcome),
                Standing::Due(_) | Standing::Waiting(_) => None,
            };
            let standing = match self.declare(graph, action, outcome) {
                Declared::Waiting(upstream) => Standing::Waiting(upstream),
                Declared::Blocked(by) => {
                    Standing::Settled(Outcome { status: Status::Blocked { by }, record: None })
                }
                Declared::Ready(inputs) => {
                    let record = unperformed(action, inputs);
                    match self.look_up(&record) {
                        Some(record) => {
                            Standing::Settled(Outcome { status: Status::Reused, record: Some(record) })
                        }
                        None => Standing::Due(record),
                    }
                }
            };
            standings.push(standing);
        }
        self.make_lost_ones_due(graph, &mut standings);
        standings
    }

    /// From the readers to what they read: an action whose result is known, but no longer in the store, is due if that
    /// result is wanted or if something that is due reads it.
    fn make_lost_ones_due(&self, graph: &Graph, standings: &mut [Standing]) {
        let mut readers: Vec<Vec<ActionId>> = vec![Vec::new(); graph.len()];
        for (id, action) in graph.iter() {
            upstream_of(action).for_each(|upstream| readers[upstream.0].push(id));
        }
        for index in (0..graph.len()).rev() {
            let Standing::Settled(Outcome { record: Some(record), .. }) = &standings[index] else { continue };
            let is_settled = |id: &ActionId| matches!(standings[id.0], Standing::Settled(_));
            let is_needed =
                graph.wanted[index] || readers[index].is_empty() || !readers[index].iter().all(is_settled);
            if !is_needed || self.is_present(record) {
                continue;
            }
            standings[index] =
                Standing::Due(ActionRecord { result: ActionResult::default(), ..(**record).clone() });
            for reader in &readers[index] {
                // It may be made otherwise this time.
                if let Standing::Due(_) = standings[reader.0] {
                    standings[reader.0] = Standing::Waiting(vec![ActionId(index)]);
                }
            }
        }
    }

    /// Whether all that an action made is in the store. Asked once while plans only hear of changes: what goes meanwhile is
    /// found missing when it is read, and then everything is planned again.
    fn is_present(&self, record: &Arc<ActionRecord>) -> bool {
        let known = |memory: &ActionMemory| Arc::ptr_eq(&memory.record, record) && memory.is_present;
        if self.memory().actions.get(&record.name).is_some_and(known) {
            return true;
        }
        let is_present = self.store().has_outputs(record);
        if let Some(memory) = self.memory().actions.get_mut(&record.name)
            && Arc::ptr_eq(&memory.record, record)
        {
            memory.is_present = is_present;
        }
        is_present
    }

    /// The result for these inputs, if it is known; what it made may be gone from the store.
    pub(crate) fn look_up(&self, unperformed: &ActionRecord) -> Option<Arc<ActionRecord>> {
        let key = unperformed.key();
        if let Some(memory) = self.memory().actions.get(&unperformed.name)
            && memory.key == key
        {
            return Some(memory.record.clone());
        }
        // Whoever made it may call itself and what it read otherwise.
        let result = self.store().record(&key)?.result;
        Some(Arc::new(ActionRecord { result, ..unperformed.clone() }))
    }

    /// Why an action for which there is no result must run.
    pub(crate) fn reason(&self, unperformed: &ActionRecord) -> Reason {
        let before = self.history(&unperformed.name).map(|(record, _)| record);
        Reason::between(before.as_deref(), unperformed)
    }

    /// The inputs of an action with their contents, as far as the outcomes of those before it are known.
    pub(crate) fn declare<'o>(
        &self,
        graph: &Graph,
        action: &Action,
        outcome: impl Fn(ActionId) -> Option<&'o Outcome>,
    ) -> Declared {
        let mut inputs = Vec::with_capacity(action.inputs.len());
        let mut waits_for = Vec::new();
        for input in &action.inputs {
            match input {
                Input::Source { path, digest } => {
                    let bytes = if digest.is_some() { self.sources().bytes(path) } else { 0 };
                    inputs.push(InputRecord { name: path.clone(), digest: *digest, bytes, made_as: None });
                }
                Input::Output { action: upstream, output } => {
                    let name = &graph.action(*upstream).name;
                    let Some(outcome) = outcome(*upstream) else {
                        if !waits_for.contains(upstream) {
                            waits_for.push(*upstream);
                        }
                        continue;
                    };
                    let Some(made) = outcome.output(output) else { return Declared::Blocked(name.clone()) };
                    let name = format!("{name}/{output}");
                    let made_as = Some(output.clone());
                    inputs.push(InputRecord { name, digest: Some(made.digest), bytes: made.bytes, made_as });
                }
            }
        }
        if waits_for.is_empty() { Declared::Ready(inputs) } else { Declared::Waiting(waits_for) }
    }
}

pub(crate) enum Declared {
    Ready(Vec<InputRecord>),
    Blocked(String),
    Waiting(Vec<ActionId>),
}

pub(crate) fn unperformed(action: &Action, inputs: Vec<InputRecord>) -> ActionRecord {
    let result = ActionResult::default();
    ActionRecord { name: action.name.clone(), command: action.command.clone(), inputs, result }
}

/// The actions that an action reads from, each as often as it does.
pub(crate) fn upstream_of(action: &Action) -> impl Iterator<Item = ActionId> {
    action.inputs.iter().filter_map(|input| match input {
        Input::Output { action, .. } => Some(*action),
        Input::Source { .. } => None,
    })
}
