//! The thread that builds: one batch at a time, cancelled by the next.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use kiln_build::{ActionId, Digest, Engine, Error, Outcome, RunOptions, RunReport, Status};
use kiln_link::{ActionTime, ProgressReport, Revision, RevisionTable, Server, Work};
use kiln_project::{Built, Choice, Early, Wishes, build_wanted_first, settle, write_outputs};

use crate::watch::Batch;

/// A watcher that works tells of a change within this time.
const TOLD_WITHIN: Duration = Duration::from_millis(700);

/// What is to be built: why, and environments at another error than their own.
type Order = (Batch, BTreeMap<String, f64>);

/// A finished build, as the loop sees it.
pub(crate) enum BuildResult {
    /// It is done; the table's number is still to be given.
    Done(Box<RevisionTable>),
    /// What clients want is done, and it goes on.
    Early(Box<RevisionTable>),
    /// A newer edit came in between; these are the edits that the build was for.
    Cancelled(Batch),
    /// The tool could not do its work; what was published stays.
    Failed(Error),
    /// These files are not what the last build saw, and nobody told.
    Overlooked(Vec<String>),
    /// The build is done and published, but its files or the memory of it could not be written.
    OutputsFailed(Error),
}

pub(crate) struct Builder {
    requests: Option<Sender<Order>>,
    cancel: Arc<AtomicBool>,
    /// Requests that the thread has not taken yet.
    waiting: Arc<AtomicUsize>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Drop for Builder {
    /// Waits for the thread, so that nothing is half written and its hold on the socket is gone when the daemon is.
    fn drop(&mut self) {
        self.cancel.store(true, Ordering::SeqCst);
        drop(self.requests.take());
        if let Some(thread) = self.thread.take() {
            // A panic in it has been reported as a failure already.
            let _ = thread.join();
        }
    }
}

pub(crate) struct BuilderOptions {
    pub(crate) jobs: usize,
    pub(crate) memory_bytes: u64,
    pub(crate) cache_bytes_max: u64,
    pub(crate) write_outputs: bool,
    pub(crate) poll: Option<Duration>,
}

impl Builder {
    /// Starts the thread; it ends when the builder is dropped.
    pub(crate) fn start(
        engine: Arc<Engine>,
        server: Arc<Server>,
        options: BuilderOptions,
        built: impl Fn(BuildResult) + Send + Sync + 'static,
    ) -> Builder {
        let (requests, received) = channel();
        let cancel = Arc::new(AtomicBool::new(false));
        let waiting = Arc::new(AtomicUsize::new(0));
        let work =
            BuilderThread { engine, server, options, cancel: cancel.clone(), waiting: waiting.clone() };
        let thread = std::thread::spawn(move || work.run(&received, &built));
        Builder { requests: Some(requests), cancel, waiting, thread: Some(thread) }
    }

    pub(crate) fn request(&self, batch: Batch, errors: BTreeMap<String, f64>) {
        self.cancel.store(false, Ordering::SeqCst);
        if let Some(requests) = &self.requests {
            self.waiting.fetch_add(1, Ordering::SeqCst);
            // The thread lives as long as the builder does.
            let _ = requests.send((batch, errors));
        }
    }

    pub(crate) fn cancel(&self) {
        self.cancel.store(true, Ordering::SeqCst);
    }
}

struct BuilderThread {
    engine: Arc<Engine>,
    server: Arc<Server>,
    options: BuilderOptions,
    cancel: Arc<AtomicBool>,
    waiting: Arc<AtomicUsize>,
}

impl BuilderThread {
    fn run(&self, requests: &Receiver<Order>, built: &(impl Fn(BuildResult) + Sync)) {
        // The watcher tells what changes from here on; before it, anything may have.
        let mut knows_all = false;
        let mut next = None;
        while let Some((batch, errors)) = next.take().or_else(|| self.wait(requests, built)) {
            self.waiting.fetch_sub(1, Ordering::SeqCst);
            let changed: Option<Vec<String>> =
                (knows_all && !batch.files.is_empty()).then(|| batch.files.iter().cloned().collect());
            // No collection may take what a build counts on.
            let hold = self.engine.store().hold();
            match Self::guarded(|| self.build(changed.as_deref(), &batch, &errors, built)) {
                Ok(None) => built(BuildResult::Cancelled(batch)),
                Ok(Some(done)) => {
                    knows_all = true;
                    let has_other_maps = done.plan.wishes.change_maps();
                    let (targets, output_dir) = (done.targets.clone(), done.plan.project.output_dir.clone());
                    built(BuildResult::Done(Box::new(to_table(done, batch))));
                    // Clients first; files for engines and the memory can follow.
                    let write = || match self.options.write_outputs && !has_other_maps {
                        true => write_outputs(&self.engine, &targets, &output_dir).map(drop),
                        false => Ok(()),
                    };
                    let results = [Self::guarded(write), Self::guarded(|| self.engine.save_memory())];
                    results
                        .into_iter()
                        .filter_map(Result::err)
                        .for_each(|error| built(BuildResult::OutputsFailed(error)));
                }
                Err(error) => {
                    knows_all = false;
                    built(BuildResult::Failed(error));
                }
            }
            drop(hold);
            // What cannot be collected now can be later.
            let _ = self.engine.store().collect_if_due(self.options.cache_bytes_max);
            next = self.look_for_overlooked(requests, built);
        }
    }

    /// The next request; while there is none, files are looked at as often as asked for.
    fn wait(&self, requests: &Receiver<Order>, built: &impl Fn(BuildResult)) -> Option<Order> {
        let Some(poll) = self.options.poll else { return requests.recv().ok() };
        loop {
            match requests.recv_timeout(poll) {
                Ok(order) => return Some(order),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Some(order) = self.look_for_overlooked(requests, built) {
                return Some(order);
            }
        }
    }

    /// A file system may not tell of every change (a network's, a link that leads elsewhere now): while there is nothing
    /// else to do all files are looked at, by `stat` alone. A change that is told of a moment later is no such one: then
    /// its request is returned.
    fn look_for_overlooked(&self, requests: &Receiver<Order>, built: &impl Fn(BuildResult)) -> Option<Order> {
        let is_idle = || self.waiting.load(Ordering::SeqCst) == 0 && !self.cancel.load(Ordering::SeqCst);
        let sources = self.engine.sources();
        let changed = sources.changed_since_seen(&sources.looked_at(), is_idle);
        if changed.is_empty() {
            return None;
        }
        match requests.recv_timeout(self.options.poll.map_or(TOLD_WITHIN, |poll| poll.min(TOLD_WITHIN))) {
            Ok(order) => Some(order),
            Err(_) => {
                built(BuildResult::Overlooked(changed));
                None
            }
        }
    }

    fn build(
        &self,
        changed: Option<&[String]>,
        batch: &Batch,
        errors: &BTreeMap<String, f64>,
        built: &(impl Fn(BuildResult) + Sync),
    ) -> Result<Option<Built>, Error> {
        let (done, total) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let report = |current: &str| {
            let (done, total) = (done.load(Ordering::Relaxed), total.load(Ordering::Relaxed));
            self.server.report_progress(&ProgressReport { done, total, current: current.to_owned() });
        };
        let progress = |progress: kiln_build::Progress| match progress {
            kiln_build::Progress::Started { name, .. } => report(name),
            kiln_build::Progress::Settled { done: now, total: all } => {
                done.store(now, Ordering::Relaxed);
                total.store(all, Ordering::Relaxed);
            }
            kiln_build::Progress::UrgentSettled { .. } => {}
        };
        let options = RunOptions {
            jobs: self.options.jobs,
            memory_bytes: self.options.memory_bytes,
            keep_going: true,
            cancel: &self.cancel,
            progress: &progress,
        };
        let early = |early: Early| {
            let Early { targets, building, diagnostics, report, plan_ms, run_ms } = early;
            let work = noticed(work_of(&report, plan_ms, run_ms), batch.clone());
            built(BuildResult::Early(Box::new(RevisionTable {
                number: 0,
                targets,
                diagnostics,
                work,
                building,
            })));
        };
        let wants = self.server.wanted();
        let wishes = Wishes { errors: errors.clone(), ..Wishes::among(wants.targets.iter()) };
        let is_wanted = |target: &str| wants.include(target);
        // Only what the folder says may change has been looked at anew; a choice looks at everything.
        for choice in self.choices(changed, &options)? {
            tracing::info!(target: "build", "env/{}: error {} for {} ms", choice.env, choice.locked.error, choice.time_ms);
        }
        let result = build_wanted_first(&self.engine, changed, wishes, &is_wanted, &early, &options);
        report("");
        result
    }

    /// Chooses how good environments are that ask for a time, where their sources or kiln.toml may have changed.
    fn choices(&self, changed: Option<&[String]>, options: &RunOptions) -> Result<Vec<Choice>, Error> {
        let is_about = |path: &String| {
            let ending = path.rsplit('.').next().unwrap_or_default();
            !["wgsl", "glsl", "vert", "frag", "comp", "gltf", "glb", "bin"].contains(&ending)
        };
        match changed {
            Some(files) if !files.iter().any(is_about) => Ok(Vec::new()),
            _ => settle(&self.engine, options),
        }
    }

    /// A panic outside an action ends neither the thread nor the daemon.
    fn guarded<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).unwrap_or_else(|_| {
            let reason = "it panicked; the message stands above".to_owned();
            Err(Error::Action { action: "build".to_owned(), reason })
        })
    }
}

/// What a build made as a client would get it: for pictures without a daemon.
///
/// # Errors
/// [`Error::Lost`] if the store no longer has a content of it.
pub fn to_revision(engine: &Engine, built: Built) -> Result<Revision, Error> {
    let lost = |digest: Digest| Error::Lost { what: format!("blob {}", digest.short()) };
    let table = RevisionTable { number: 1, ..to_table(built, Batch::default()) };
    let mut blobs = HashMap::new();
    for part in table.targets.values().flat_map(|target| &target.parts) {
        let bytes = engine.store().get(&part.digest).ok_or_else(|| lost(part.digest))?;
        blobs.insert(part.digest, bytes);
    }
    Revision::new(table, blobs).map_err(lost)
}

fn to_table(built: Built, batch: Batch) -> RevisionTable {
    let work = noticed(to_work(&built), batch);
    // Only the engine, which keeps what is published, may have a share in it still.
    let targets = Arc::unwrap_or_clone(built.targets);
    RevisionTable { targets, diagnostics: built.diagnostics, work, ..RevisionTable::default() }
}

/// What a build did because of these edits.
fn noticed(work: Work, batch: Batch) -> Work {
    let changed_files = batch.files.into_iter().collect();
    Work { changed_files, noticed_unix_ms: batch.noticed_unix_ms, ..work }
}

/// What a build did, as it is published; without the edits that began it, which the build does not know.
pub fn to_work(built: &Built) -> Work {
    work_of(&built.report, built.plan_ms, built.run_ms)
}

fn work_of(report: &RunReport, plan_ms: f64, run_ms: f64) -> Work {
    let time = |id: &ActionId| match report.outcome(*id) {
        Outcome { status: Status::Ran { reason }, record: Some(record) } => Some(ActionTime {
            name: record.name.clone(),
            wall_ms: record.result.wall_ms,
            reason: reason.to_string(),
        }),
        _ => None,
    };
    Work {
        ran: report.ended.iter().filter_map(time).collect(),
        reused: report.reused_count(),
        plan_ms,
        run_ms,
        ..Work::default()
    }
}
