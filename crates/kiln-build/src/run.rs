//! Bringing a graph up to date.

use std::collections::{BTreeSet, HashMap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Instant;

use kiln_diagnostic::Diagnostic;

use crate::action::DeclaredInput;
use crate::sources::lock;
use crate::{
    Action, ActionId, ActionOutput, ActionRecord, Digest, Engine, Error, Graph, Input, InputRecord, Inputs,
    OutputRecord, explain,
};

/// How to run.
pub struct RunOptions<'a> {
    /// Worker threads, at least 1.
    pub jobs: usize,
    /// Set to stop after the actions in flight.
    pub cancel: &'a AtomicBool,
    /// Told what happens, from worker threads.
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

/// What a run says while it works.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// An action must run, because `reason`.
    Started {
        /// Its name.
        name: &'a str,
        /// Why it runs.
        reason: &'a str,
    },
    /// An action is settled, one way or another.
    Settled {
        /// How many are, this one included.
        done: usize,
        /// Of how many.
        total: usize,
    },
}

/// How an action ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// Its result was in the store.
    Reused,
    /// It ran, because of `reason`.
    Ran {
        /// In words.
        reason: String,
    },
    /// An action it reads from made nothing.
    Blocked {
        /// Name of that action.
        by: String,
    },
    /// The run was cancelled before it came to it.
    NotRun,
}

/// One action's result.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Everything known about it; `None` if blocked or not run.
    pub record: Option<ActionRecord>,
}

impl Outcome {
    /// Whether the action has outputs.
    pub fn succeeded(&self) -> bool {
        self.record.as_ref().is_some_and(|record| !record.outputs.is_empty())
    }

    /// Whether the action's own input is at fault.
    pub fn failed(&self) -> bool {
        self.record.as_ref().is_some_and(|record| record.outputs.is_empty())
    }

    /// The output called `name`, if it was made.
    pub fn output(&self, name: &str) -> Option<&OutputRecord> {
        self.record.as_ref()?.outputs.iter().find(|output| output.name == name)
    }
}

/// Results in the graph's order.
#[derive(Clone, Debug)]
pub struct RunReport {
    /// One for each action.
    pub outcomes: Vec<Outcome>,
    /// Names of the actions that ran, in the order in which they ended.
    pub ended: Vec<String>,
}

impl RunReport {
    /// The result of an action.
    pub fn outcome(&self, id: ActionId) -> &Outcome {
        &self.outcomes[id.0]
    }

    /// Whether every action was settled.
    pub fn is_complete(&self) -> bool {
        !self.outcomes.iter().any(|outcome| outcome.status == Status::NotRun)
    }

    /// Everything that was said, in the graph's order.
    pub fn diagnostics(&self) -> impl Iterator<Item = &Diagnostic> {
        self.outcomes
            .iter()
            .filter_map(|outcome| outcome.record.as_ref())
            .flat_map(|record| &record.diagnostics)
    }
}

impl Engine {
    /// Brings every action of the graph up to date: reuses what the store has, runs what it lacks, skips
    /// what depends on a failed action. Equal graphs give equal results for any number of jobs.
    ///
    /// # Errors
    /// The first failure of the tool; failures of inputs are in the report.
    pub fn run(&self, graph: &Graph, options: &RunOptions) -> Result<RunReport, Error> {
        let shared = Shared::new(graph);
        std::thread::scope(|scope| {
            for _ in 1..options.jobs.max(1) {
                scope.spawn(|| self.work(graph, options, &shared));
            }
            self.work(graph, options, &shared);
        });
        let progress = shared.progress.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        match progress.error {
            Some(error) => Err(error),
            None => Ok(RunReport {
                outcomes: progress.outcomes.into_iter().map(|outcome| outcome.unwrap_or(NOT_RUN)).collect(),
                ended: progress.ended,
            }),
        }
    }

    fn work(&self, graph: &Graph, options: &RunOptions, shared: &Shared) {
        while let Some(id) = shared.next(options.cancel) {
            // A panic must not leave the other workers waiting for this action for ever.
            let settled = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                self.settle(graph.action(id), &shared.declare(graph, id), options)
            }));
            let settled = settled.unwrap_or_else(|panic| {
                Err(Error::Action { action: graph.action(id).name.clone(), reason: panic_text(&*panic) })
            });
            let done = shared.settle(graph, id, settled);
            (options.progress)(Progress::Settled { done, total: graph.len() });
        }
    }

    fn settle(&self, action: &Action, declared: &Declared, options: &RunOptions) -> Result<Settled, Error> {
        let inputs = match declared {
            Declared::Ready(inputs) => inputs,
            Declared::Blocked(by) => {
                let status = Status::Blocked { by: by.clone() };
                return Ok(Settled { outcome: Outcome { status, record: None }, blobs: Vec::new() });
            }
        };
        let mut record = unperformed(action, inputs.iter().map(|input| input.record.clone()).collect());
        let key = record.key();
        if let Some(mut known) = self.store().record(&key)? {
            known.name.clone_from(&action.name);
            self.remember_key(&action.name, key);
            let outcome = Outcome { status: Status::Reused, record: Some(known) };
            return Ok(Settled { outcome, blobs: Vec::new() });
        }
        let before =
            self.last_key(&action.name).and_then(|key| self.store().record_of_past(&key).ok().flatten());
        let reason = explain(before.as_ref(), &record);
        (options.progress)(Progress::Started { name: &action.name, reason: &reason });
        let declared = inputs.iter().map(|input| input.source()).collect();
        let start = Instant::now();
        let made = (action.perform)(&Inputs { engine: self, declared })?;
        record.wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let blobs = self.keep(&mut record, made)?;
        self.remember_key(&action.name, key);
        Ok(Settled { outcome: Outcome { status: Status::Ran { reason }, record: Some(record) }, blobs })
    }

    fn keep(&self, record: &mut ActionRecord, made: ActionOutput) -> Result<Vec<Arc<[u8]>>, Error> {
        let mut blobs = Vec::with_capacity(made.outputs.len());
        for (name, bytes) in made.outputs {
            let digest = self.store().put(&bytes)?;
            record.outputs.push(OutputRecord { name, digest, bytes: bytes.len() as u64 });
            blobs.push(bytes.into());
        }
        record.meta = made.meta;
        record.diagnostics = made.diagnostics;
        self.store().put_record(record)?;
        Ok(blobs)
    }
}

const NOT_RUN: Outcome = Outcome { status: Status::NotRun, record: None };

fn unperformed(action: &Action, inputs: Vec<InputRecord>) -> ActionRecord {
    ActionRecord {
        name: action.name.clone(),
        kind: action.kind.to_owned(),
        recipe: action.recipe,
        params: action.params.clone(),
        inputs,
        outputs: Vec::new(),
        meta: serde_json::Value::Null,
        diagnostics: Vec::new(),
        wall_ms: 0.0,
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("no message"))
}

struct Settled {
    outcome: Outcome,
    /// Bytes of the outputs of an action that ran, in the record's order.
    blobs: Vec<Arc<[u8]>>,
}

/// What the workers share.
struct Shared {
    progress: Mutex<RunProgress>,
    changed: Condvar,
}

#[derive(Default)]
struct RunProgress {
    /// (rank, index) of the actions whose inputs are settled.
    ready: BTreeSet<(u32, usize)>,
    /// Number of distinct unsettled actions each waits for.
    waiting_for: Vec<usize>,
    readers: Vec<Vec<usize>>,
    /// Number of distinct actions that have still to read each one's outputs.
    unread_by: Vec<usize>,
    ranks: Vec<u32>,
    outcomes: Vec<Option<Outcome>>,
    in_flight: usize,
    done: usize,
    ended: Vec<String>,
    /// Contents made in this run, so that readers need not go back to the disk.
    held: HashMap<Digest, Arc<[u8]>>,
    error: Option<Error>,
}

enum Declared {
    Ready(Vec<ReadyInput>),
    Blocked(String),
}

struct ReadyInput {
    record: InputRecord,
    /// For outputs of this run: the bytes, still in memory.
    held: Option<Arc<[u8]>>,
    is_source: bool,
}

impl ReadyInput {
    fn source(&self) -> DeclaredInput {
        match (self.is_source, self.record.digest) {
            (false, Some(digest)) => DeclaredInput::Blob { digest, held: self.held.clone() },
            (_, digest) => DeclaredInput::Source { path: self.record.name.clone(), digest },
        }
    }
}

impl Shared {
    fn new(graph: &Graph) -> Shared {
        let count = graph.len();
        let mut progress = RunProgress {
            readers: vec![Vec::new(); count],
            ranks: graph.actions.iter().map(|action| action.rank).collect(),
            outcomes: vec![None; count],
            ..RunProgress::default()
        };
        for (index, action) in graph.actions.iter().enumerate() {
            let upstream: BTreeSet<usize> = action.inputs.iter().filter_map(upstream).collect();
            progress.waiting_for.push(upstream.len());
            if upstream.is_empty() {
                progress.ready.insert((action.rank, index));
            }
            for action in upstream {
                progress.readers[action].push(index);
            }
        }
        progress.unread_by = progress.readers.iter().map(Vec::len).collect();
        Shared { progress: Mutex::new(progress), changed: Condvar::new() }
    }

    /// The next action to settle; waits while others may still make one ready.
    fn next(&self, cancel: &AtomicBool) -> Option<ActionId> {
        let mut progress = lock(&self.progress);
        loop {
            if progress.error.is_some() || cancel.load(Ordering::Relaxed) {
                self.changed.notify_all();
                return None;
            }
            if let Some((_, index)) = progress.ready.pop_first() {
                progress.in_flight += 1;
                return Some(ActionId(index));
            }
            if progress.in_flight == 0 {
                return None;
            }
            progress = self.changed.wait(progress).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }

    fn declare(&self, graph: &Graph, id: ActionId) -> Declared {
        let progress = lock(&self.progress);
        let mut inputs = Vec::new();
        for input in &graph.action(id).inputs {
            let (record, is_source) = match input {
                Input::Source { path, digest } => (InputRecord { name: path.clone(), digest: *digest }, true),
                Input::Output { action, output } => {
                    let name = &graph.action(*action).name;
                    let made =
                        progress.outcomes[action.0].as_ref().and_then(|outcome| outcome.output(output));
                    let Some(made) = made else { return Declared::Blocked(name.clone()) };
                    (InputRecord { name: format!("{name}/{output}"), digest: Some(made.digest) }, false)
                }
            };
            let held = record.digest.and_then(|digest| progress.held.get(&digest).cloned());
            inputs.push(ReadyInput { record, held, is_source });
        }
        Declared::Ready(inputs)
    }

    /// Notes a result and makes its readers ready; returns how many actions are settled.
    fn settle(&self, graph: &Graph, id: ActionId, settled: Result<Settled, Error>) -> usize {
        let mut progress = lock(&self.progress);
        let progress = &mut *progress;
        progress.in_flight -= 1;
        progress.done += 1;
        match settled {
            Err(error) => {
                progress.error.get_or_insert(error);
            }
            Ok(settled) => {
                if matches!(settled.outcome.status, Status::Ran { .. }) {
                    progress.ended.push(graph.action(id).name.clone());
                }
                if let Some(record) = &settled.outcome.record
                    && progress.unread_by[id.0] > 0
                {
                    let digests = record.outputs.iter().map(|output| output.digest);
                    progress.held.extend(digests.zip(settled.blobs));
                }
                progress.outcomes[id.0] = Some(settled.outcome);
                progress.release_inputs(graph.action(id));
                for reader in std::mem::take(&mut progress.readers[id.0]) {
                    progress.waiting_for[reader] -= 1;
                    if progress.waiting_for[reader] == 0 {
                        progress.ready.insert((progress.ranks[reader], reader));
                    }
                }
            }
        }
        self.changed.notify_all();
        progress.done
    }
}

impl RunProgress {
    /// Forgets contents that nobody has still to read: a large environment must not fill the memory until the end.
    fn release_inputs(&mut self, action: &Action) {
        let upstream: BTreeSet<usize> = action.inputs.iter().filter_map(upstream).collect();
        for index in upstream {
            self.unread_by[index] -= 1;
            if self.unread_by[index] == 0
                && let Some(record) =
                    self.outcomes[index].as_ref().and_then(|outcome| outcome.record.as_ref())
            {
                record.outputs.iter().for_each(|output| _ = self.held.remove(&output.digest));
            }
        }
    }
}

fn upstream(input: &Input) -> Option<usize> {
    match input {
        Input::Output { action, .. } => Some(action.0),
        Input::Source { .. } => None,
    }
}
