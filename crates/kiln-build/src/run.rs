//! Bringing a graph up to date.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use kiln_diagnostic::Diagnostic;

use crate::action::DeclaredInput;
use crate::sources::lock;
use crate::survey::{Declared, Standing, unperformed, upstream_of};
use crate::{
    Action, ActionId, ActionOutput, ActionRecord, ActionResult, BuildNote, Digest, Engine, Error, Graph,
    Input, Inputs, OutputRecord, Reason,
};

/// Contents made in a run are held for their readers up to this share of the run's memory; the others come back from the
/// store.
const HELD_SHARE: u64 = 4;

/// How to run.
pub struct RunOptions<'a> {
    /// Worker threads, at least 1.
    pub jobs: usize,
    /// What the actions at work may take together, in bytes. One that needs more on its own runs alone.
    pub memory_bytes: u64,
    /// Whether to go on after an action whose input is at fault.
    pub keep_going: bool,
    /// Set to stop: within the actions in flight, at their next look.
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
        reason: &'a Reason,
    },
    /// An action is settled, one way or another.
    Settled {
        /// How many are, this one included.
        done: usize,
        /// Of how many.
        total: usize,
    },
    /// Every urgent action ([`Graph::hurry`]) is settled, some of them ran, and others are not settled yet.
    UrgentSettled {
        /// What is settled so far; the rest is [`Status::NotRun`].
        report: &'a RunReport,
    },
}

/// How an action ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// Its result was in the store.
    Reused,
    /// It ran, because of `reason`.
    Ran {
        /// Why.
        reason: Reason,
    },
    /// An action it reads from made nothing.
    Blocked {
        /// Name of that action.
        by: String,
    },
    /// The run was cancelled, or stopped at a failure, before it came to it.
    NotRun,
}

/// One action's result.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Everything known about it; `None` if blocked or not run.
    pub record: Option<Arc<ActionRecord>>,
}

impl Outcome {
    /// Whether the action has outputs.
    pub fn succeeded(&self) -> bool {
        self.record.as_ref().is_some_and(|record| !record.result.outputs.is_empty())
    }

    /// Whether the action's own input is at fault.
    pub fn failed(&self) -> bool {
        self.record.as_ref().is_some_and(|record| record.result.outputs.is_empty())
    }

    /// The output called `name`, if it was made.
    pub fn output(&self, name: &str) -> Option<&OutputRecord> {
        self.record.as_ref()?.result.outputs.iter().find(|output| output.name == name)
    }
}

/// Results in the graph's order.
#[derive(Clone, Debug)]
pub struct RunReport {
    /// One for each action.
    pub outcomes: Vec<Outcome>,
    /// The actions that ran, in the order in which they ended.
    pub ended: Vec<ActionId>,
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

    /// How many results were in the store.
    pub fn reused_count(&self) -> usize {
        self.outcomes.iter().filter(|outcome| outcome.status == Status::Reused).count()
    }

    /// Everything that was said, in the graph's order, with the action that said it.
    pub fn diagnostics(&self) -> impl Iterator<Item = (ActionId, &Diagnostic)> {
        self.outcomes.iter().enumerate().flat_map(|(index, outcome)| {
            let said = outcome.record.iter().flat_map(|record| &record.result.diagnostics);
            said.map(move |diagnostic| (ActionId(index), diagnostic))
        })
    }
}

impl Engine {
    /// Brings every action of the graph up to date: reuses what the store has, runs what it lacks, skips
    /// what depends on a failed action. Equal graphs give equal results for any number of jobs.
    ///
    /// # Errors
    /// The first failure of the tool; failures of inputs are in the report.
    pub fn run(&self, graph: &Graph, options: &RunOptions) -> Result<RunReport, Error> {
        let shared = Shared::new(graph, self.survey(graph));
        let waiting = lock(&shared.progress).unsettled;
        if waiting > 0 {
            std::thread::scope(|scope| {
                for _ in 1..options.jobs.clamp(1, waiting) {
                    scope.spawn(|| self.work(graph, options, &shared));
                }
                self.work(graph, options, &shared);
            });
        }
        let progress = shared.progress.into_inner().unwrap_or_else(PoisonError::into_inner);
        let outcomes = progress.outcomes.into_iter().map(|outcome| outcome.unwrap_or(NOT_RUN)).collect();
        let report = RunReport { outcomes, ended: progress.ended };
        self.remember(graph, &report);
        match progress.error {
            Some(error) => Err(error),
            None => Ok(report),
        }
    }

    /// Notes every outcome, so that the next build can say what is different.
    fn remember(&self, graph: &Graph, report: &RunReport) {
        let mut memory = self.memory();
        let was_changed = std::mem::take(&mut memory.is_changed);
        for outcome in &report.outcomes {
            if let Some(record) = &outcome.record {
                memory.settle(record, matches!(outcome.status, Status::Ran { .. }));
            }
        }
        if memory.is_changed {
            let note = BuildNote {
                number: memory.next_build(),
                unix_s: SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs(),
                ran: report.ended.len(),
                reused: report.reused_count(),
                failed: report.outcomes.iter().filter(|outcome| outcome.failed()).count(),
            };
            memory.end_build(note);
        }
        memory.is_changed |= was_changed;
        drop(memory);
        if report.is_complete() {
            self.forget_others(graph);
        }
    }

    fn work(&self, graph: &Graph, options: &RunOptions, shared: &Shared) {
        while let Some(id) = shared.next(options.cancel) {
            // A panic must not leave the other workers waiting for this action for ever.
            let settled = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                self.settle(graph, id, options, shared)
            }));
            let settled = settled.unwrap_or_else(|panic| {
                Err(Error::Action { action: graph.action(id).name.clone(), reason: panic_text(&*panic) })
            });
            let (done, early) = shared.settle(graph, id, settled, options);
            (options.progress)(Progress::Settled { done, total: graph.len() });
            if let Some(report) = early {
                (options.progress)(Progress::UrgentSettled { report: &report });
            }
        }
    }

    fn settle(
        &self,
        graph: &Graph,
        id: ActionId,
        options: &RunOptions,
        shared: &Shared,
    ) -> Result<Settled, Error> {
        let action = graph.action(id);
        let unperformed = match shared.declare(self, graph, id) {
            Turn::Unperformed(record) => record,
            Turn::Settled(outcome) => return Ok(Settled { outcome, blobs: Vec::new() }),
        };
        // Two actions of a graph may be the same work: the second finds the first one's result.
        let _claim = shared.claim(unperformed.key());
        if let Some(record) = self.look_up(&unperformed).filter(|known| self.store().has_outputs(known)) {
            let outcome = Outcome { status: Status::Reused, record: Some(record) };
            return Ok(Settled { outcome, blobs: Vec::new() });
        }
        let lengths: Vec<u64> = unperformed.inputs.iter().map(|input| input.bytes).collect();
        let need_bytes = (action.memory)(&lengths);
        if !shared.enter(Place::of(graph, id.0), need_bytes, options) {
            return Ok(Settled { outcome: NOT_RUN, blobs: Vec::new() });
        }
        let _room = Room { shared, need_bytes };
        let reason = self.reason(&unperformed);
        (options.progress)(Progress::Started { name: &action.name, reason: &reason });
        let declared = shared.inputs(action, &unperformed);
        let start = Instant::now();
        let made = (action.perform)(&Inputs { engine: self, declared, cancel: options.cancel })?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        self.keep(unperformed, made, wall_ms, reason)
    }

    fn keep(
        &self,
        mut record: ActionRecord,
        made: ActionOutput,
        wall_ms: f64,
        reason: Reason,
    ) -> Result<Settled, Error> {
        check_declared(&record, &made)?;
        let mut outputs = Vec::with_capacity(made.outputs.len());
        let mut blobs: Vec<Arc<[u8]>> = Vec::with_capacity(made.outputs.len());
        for (name, bytes) in made.outputs {
            outputs.push(OutputRecord { name, digest: Digest::of(&bytes), bytes: bytes.len() as u64 });
            blobs.push(bytes.into());
        }
        record.result = ActionResult { outputs, meta: made.meta, diagnostics: made.diagnostics, wall_ms };
        self.store().put_result(&record, &blobs)?;
        Ok(Settled {
            outcome: Outcome { status: Status::Ran { reason }, record: Some(Arc::new(record)) },
            blobs,
        })
    }
}

/// An action that made something made all that it declares and nothing else: a result with a gap must never be kept.
fn check_declared(record: &ActionRecord, made: &ActionOutput) -> Result<(), Error> {
    let is_of = |name: &str, declared: &str| {
        name.strip_prefix(declared).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let declared = &record.command.outputs;
    let names = || made.outputs.iter().map(|(name, _)| name);
    let missing = declared.iter().find(|declared| !names().any(|name| is_of(name, declared)));
    let undeclared = names().find(|name| !declared.iter().any(|declared| is_of(name, declared)));
    let reason = match (undeclared, missing) {
        (Some(name), _) => format!("it made `{name}`, which it does not declare"),
        (None, Some(declared)) if !made.outputs.is_empty() => format!("it did not make `{declared}`"),
        (None, _) => return Ok(()),
    };
    Err(Error::Action { action: record.name.clone(), reason })
}

const NOT_RUN: Outcome = Outcome { status: Status::NotRun, record: None };

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("it panicked: {}", text.unwrap_or("no message"))
}

struct Settled {
    outcome: Outcome,
    /// Bytes of the outputs of an action that ran, in the record's order.
    blobs: Vec<Arc<[u8]>>,
}

/// Where an action stands in a queue; the least is next.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    is_late: bool,
    rank: u32,
    index: usize,
}

impl Place {
    fn of(graph: &Graph, index: usize) -> Place {
        Place { is_late: !graph.is_urgent(index), rank: graph.actions[index].rank, index }
    }
}

/// What the workers share.
struct Shared {
    progress: Mutex<RunProgress>,
    changed: Condvar,
}

#[derive(Default)]
struct RunProgress {
    /// The actions whose inputs are settled.
    ready: BTreeSet<Place>,
    /// Actions that the survey found due.
    due: HashMap<usize, ActionRecord>,
    /// Number of distinct unsettled actions each waits for.
    waiting_for: Vec<usize>,
    readers: Vec<Vec<usize>>,
    /// Number of distinct actions that have still to read each one's outputs.
    unread_by: Vec<usize>,
    outcomes: Vec<Option<Outcome>>,
    unsettled: usize,
    /// Urgent ones among them.
    urgent_unsettled: usize,
    in_flight: usize,
    ended: Vec<ActionId>,
    /// Contents made in this run, so that readers need not go back to the disk.
    held: HashMap<Digest, Arc<[u8]>>,
    held_bytes: u64,
    /// What the actions at work need together.
    working_bytes: u64,
    /// The actions that wait for room; the first of them is the next to get it.
    waiting_for_room: BTreeSet<Place>,
    /// Keys of the work that is being done.
    claimed: HashSet<Digest>,
    is_stopped: bool,
    error: Option<Error>,
}

/// What is known of an action whose turn it is.
enum Turn {
    Unperformed(ActionRecord),
    Settled(Outcome),
}

/// The right to do some work, which nobody else in this run does at the same time.
struct Claim<'a> {
    shared: &'a Shared,
    key: Digest,
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        lock(&self.shared.progress).claimed.remove(&self.key);
        self.shared.changed.notify_all();
    }
}

/// Memory set aside for an action at work.
struct Room<'a> {
    shared: &'a Shared,
    need_bytes: u64,
}

impl Drop for Room<'_> {
    fn drop(&mut self) {
        lock(&self.shared.progress).working_bytes -= self.need_bytes;
        self.shared.changed.notify_all();
    }
}

impl Shared {
    fn new(graph: &Graph, standings: Vec<Standing>) -> Shared {
        let count = graph.len();
        let mut progress = RunProgress {
            readers: vec![Vec::new(); count],
            waiting_for: vec![0; count],
            ..Default::default()
        };
        for (index, standing) in standings.into_iter().enumerate() {
            let action = &graph.actions[index];
            let outcome = match standing {
                Standing::Settled(outcome) => Some(outcome),
                Standing::Due(record) => {
                    progress.due.insert(index, record);
                    None
                }
                Standing::Waiting(_) => None,
            };
            if outcome.is_none() {
                progress.unsettled += 1;
                progress.urgent_unsettled += usize::from(graph.is_urgent(index));
                let upstream = distinct_upstream(action);
                progress.waiting_for[index] =
                    upstream.iter().filter(|&&upstream| progress.outcomes[upstream].is_none()).count();
                if progress.waiting_for[index] == 0 {
                    progress.ready.insert(Place::of(graph, index));
                }
                upstream.into_iter().for_each(|upstream| progress.readers[upstream].push(index));
            }
            progress.outcomes.push(outcome);
        }
        progress.unread_by = progress.readers.iter().map(Vec::len).collect();
        Shared { progress: Mutex::new(progress), changed: Condvar::new() }
    }

    fn wait<'a>(&self, progress: MutexGuard<'a, RunProgress>) -> MutexGuard<'a, RunProgress> {
        self.changed.wait(progress).unwrap_or_else(PoisonError::into_inner)
    }

    /// The next action to settle; waits while others may still make one ready.
    fn next(&self, cancel: &AtomicBool) -> Option<ActionId> {
        let mut progress = lock(&self.progress);
        loop {
            if progress.error.is_some() || cancel.load(Ordering::Relaxed) {
                self.changed.notify_all();
                return None;
            }
            if let Some(Place { index, .. }) = progress.ready.pop_first() {
                progress.in_flight += 1;
                return Some(ActionId(index));
            }
            if progress.in_flight == 0 {
                return None;
            }
            progress = self.wait(progress);
        }
    }

    fn declare(&self, engine: &Engine, graph: &Graph, id: ActionId) -> Turn {
        let mut progress = lock(&self.progress);
        if let Some(record) = progress.due.remove(&id.0) {
            return Turn::Unperformed(record);
        }
        let action = graph.action(id);
        match engine.declare(graph, action, |upstream| progress.outcomes[upstream.0].as_ref()) {
            Declared::Ready(inputs) => Turn::Unperformed(unperformed(action, inputs)),
            Declared::Waiting(_) => Turn::Settled(NOT_RUN),
            Declared::Blocked(by) => {
                let is_not_run = |upstream: usize| {
                    progress.outcomes[upstream]
                        .as_ref()
                        .is_some_and(|outcome| outcome.status == Status::NotRun)
                };
                let is_not_run = distinct_upstream(action).into_iter().any(is_not_run);
                let status = if is_not_run { Status::NotRun } else { Status::Blocked { by } };
                Turn::Settled(Outcome { status, record: None })
            }
        }
    }

    /// Waits until nobody does the work of this key.
    fn claim(&self, key: Digest) -> Claim<'_> {
        let mut progress = lock(&self.progress);
        while !progress.claimed.insert(key) {
            progress = self.wait(progress);
        }
        Claim { shared: self, key }
    }

    /// Waits for room; false if the run ends instead.
    fn enter(&self, place: Place, need_bytes: u64, options: &RunOptions) -> bool {
        let mut progress = lock(&self.progress);
        progress.waiting_for_room.insert(place);
        let may_enter = loop {
            if progress.is_stopped || progress.error.is_some() || options.cancel.load(Ordering::Relaxed) {
                break false;
            }
            let taken = progress.working_bytes.saturating_add(progress.held_bytes);
            let fits = taken.saturating_add(need_bytes) <= options.memory_bytes;
            let is_alone = progress.working_bytes == 0;
            if progress.waiting_for_room.first() == Some(&place) && (fits || is_alone) {
                break true;
            }
            progress = self.wait(progress);
        };
        progress.waiting_for_room.remove(&place);
        if may_enter {
            progress.working_bytes += need_bytes;
        }
        self.changed.notify_all();
        may_enter
    }

    fn inputs(&self, action: &Action, record: &ActionRecord) -> Vec<DeclaredInput> {
        let progress = lock(&self.progress);
        let declared = action.inputs.iter().zip(&record.inputs);
        let declared = declared.map(|(input, record)| match (input, record.digest) {
            (Input::Output { .. }, Some(digest)) => {
                DeclaredInput::Blob { digest, held: progress.held.get(&digest).cloned() }
            }
            (_, digest) => DeclaredInput::Source { path: record.name.clone(), digest },
        });
        declared.collect()
    }

    /// Notes a result and makes its readers ready; returns how many actions are settled, and what is known so far if this was
    /// the last urgent one.
    fn settle(
        &self,
        graph: &Graph,
        id: ActionId,
        settled: Result<Settled, Error>,
        options: &RunOptions,
    ) -> (usize, Option<RunReport>) {
        let mut guard = lock(&self.progress);
        let progress = &mut *guard;
        progress.in_flight -= 1;
        progress.unsettled -= 1;
        progress.urgent_unsettled -= usize::from(graph.is_urgent(id.0));
        match settled {
            Err(Error::Cancelled) => {}
            Err(error) => {
                progress.error.get_or_insert(error);
            }
            Ok(settled) => {
                if matches!(settled.outcome.status, Status::Ran { .. }) {
                    progress.ended.push(id);
                }
                progress.is_stopped |= !options.keep_going && settled.outcome.failed();
                progress.hold(id, &settled, options.memory_bytes / HELD_SHARE);
                progress.outcomes[id.0] = Some(settled.outcome);
                progress.release_inputs(graph.action(id));
                for reader in std::mem::take(&mut progress.readers[id.0]) {
                    progress.waiting_for[reader] -= 1;
                    if progress.waiting_for[reader] == 0 {
                        progress.ready.insert(Place::of(graph, reader));
                    }
                }
            }
        }
        self.changed.notify_all();
        let is_last = graph.is_urgent(id.0) && progress.urgent_unsettled == 0 && progress.unsettled > 0;
        let goes_on = progress.error.is_none() && !options.cancel.load(Ordering::Relaxed);
        let early = (is_last && goes_on).then(|| progress.so_far(graph)).flatten();
        (graph.len() - progress.unsettled, early)
    }
}

impl RunProgress {
    /// What is settled, if an urgent action ran.
    fn so_far(&self, graph: &Graph) -> Option<RunReport> {
        self.ended.iter().any(|id| graph.is_urgent(id.0)).then(|| RunReport {
            outcomes: self.outcomes.iter().map(|outcome| outcome.clone().unwrap_or(NOT_RUN)).collect(),
            ended: self.ended.clone(),
        })
    }

    /// Keeps contents at hand for those that will read them.
    fn hold(&mut self, id: ActionId, settled: &Settled, held_bytes_max: u64) {
        let Some(record) = settled.outcome.record.as_ref().filter(|_| self.unread_by[id.0] > 0) else {
            return;
        };
        for (output, bytes) in record.result.outputs.iter().zip(&settled.blobs) {
            let fits = self.held_bytes + output.bytes <= held_bytes_max;
            if fits && self.held.insert(output.digest, bytes.clone()).is_none() {
                self.held_bytes += output.bytes;
            }
        }
    }

    /// Forgets contents that nobody has still to read: a large environment must not fill the memory until the end.
    fn release_inputs(&mut self, action: &Action) {
        for index in distinct_upstream(action) {
            // Actions that the survey settled have no readers to count, and hold nothing.
            self.unread_by[index] = self.unread_by[index].saturating_sub(1);
            if self.unread_by[index] > 0 {
                continue;
            }
            let record = self.outcomes[index].as_ref().and_then(|outcome| outcome.record.clone());
            for output in record.iter().flat_map(|record| &record.result.outputs) {
                if self.held.remove(&output.digest).is_some() {
                    self.held_bytes -= output.bytes;
                }
            }
        }
    }
}

/// The distinct actions that an action reads from.
fn distinct_upstream(action: &Action) -> BTreeSet<usize> {
    upstream_of(action).map(|id| id.0).collect()
}
