//! The loop.

use std::collections::{BTreeSet, HashSet};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant, SystemTime};

use kiln_build::{Engine, Error, Store};
use kiln_diagnostic::Diagnostic;
use kiln_link::{Answer, Ask, LockError, ProjectLock, RevisionTable, Server, ServerEvent, socket_path};
use kiln_project::Wishes;
use tracing::{debug, error, info, warn};

use crate::accuracy::Accuracy;
use crate::builder::{BuildResult, Builder, BuilderOptions};
use crate::requests::Requests;
use crate::watch::{Batch, UNFINISHED, Watch, send_batches, unix_ms};

/// How to serve a project.
#[derive(Clone, Debug)]
pub struct DaemonOptions {
    /// The project's folder.
    pub folder: PathBuf,
    /// Where the store is.
    pub cache: PathBuf,
    /// Worker threads.
    pub jobs: usize,
    /// What the actions at work may take together, in bytes.
    pub memory_bytes: u64,
    /// What the cache may keep besides what is published, in bytes.
    pub cache_bytes_max: u64,
    /// Whether baked files are written after each build.
    pub write_outputs: bool,
    /// How often an idle daemon looks at all files itself, where the system may not tell of every change.
    pub poll: Option<Duration>,
    /// Where it listens besides its socket: an address of this machine alone.
    pub listen: Option<SocketAddr>,
}

/// Why a daemon could not start.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The store or the project's folder cannot be used.
    #[error(transparent)]
    Build(#[from] Error),
    /// The project has a daemon already.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// The socket cannot be made.
    #[error("cannot listen on {}: {source}", socket.display())]
    Socket {
        /// Where it should be.
        socket: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The address cannot be listened at.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// What was asked for.
        address: SocketAddr,
        /// The reason.
        source: std::io::Error,
    },
    /// The folder cannot be watched.
    #[error("cannot watch the project's folder: {0}")]
    Watch(#[from] notify::Error),
}

/// What a daemon tells its owner.
#[derive(Clone, Debug)]
pub enum Notice {
    /// A batch of edits was noticed and a build begins.
    Building {
        /// Files that changed; empty for the first build.
        files: Vec<String>,
    },
    /// A build is done and nothing that clients see has changed.
    Unchanged {
        /// Files that changed.
        files: Vec<String>,
    },
    /// A new revision is out.
    Published(Arc<RevisionTable>),
    /// These files are being written and cannot be read yet; what is wrong with them is not published until they are whole
    /// or nobody has written to them for a while.
    Unfinished {
        /// Files with an error.
        files: Vec<String>,
    },
    /// The tool could not do its work; what was published stays.
    Failed(String),
    /// A client did something.
    Client(ServerEvent),
}

/// Everything that can happen to a daemon.
enum Event {
    Files(Batch),
    Built(BuildResult),
    Client(ServerEvent),
    /// A client asked for a content that the store no longer has.
    ContentLost,
    Stop,
}

/// Ends a daemon from anywhere.
#[derive(Clone)]
pub struct StopHandle(Sender<Event>);

impl StopHandle {
    /// Asks the daemon to end after the event it handles now.
    pub fn stop(&self) {
        // Fails only when it has ended already.
        let _ = self.0.send(Event::Stop);
    }
}

/// A project being served.
pub struct Daemon {
    events: Receiver<Event>,
    stop: StopHandle,
    engine: Arc<Engine>,
    server: Arc<Server>,
    builder: Builder,
    watch: Watch,
    socket: PathBuf,
    tcp: Option<(SocketAddr, PathBuf)>,
    published: Option<Arc<RevisionTable>>,
    /// Edits that the build in flight has not seen; `None` while no build is in flight.
    building: Option<Batch>,
    /// A client lacks a content of what is published: the next build is published even if it changes nothing.
    is_incomplete: bool,
    /// When to build again what was unfinished, unless somebody goes on writing.
    retry: Option<(Instant, BTreeSet<String>)>,
    /// Sources that are watched.
    relevant: Vec<String>,
    /// [`kiln_build::SourceTree::names_version`] of them.
    relevant_version: u64,
    /// What clients wished for when the last build began.
    built_for: Wishes,
    requests: Requests,
    accuracy: Accuracy,
    /// The build in flight was cancelled because clients wish for something else, and not by an edit.
    is_superseded: bool,
    _lock: ProjectLock,
}

impl Daemon {
    /// Locks the project, begins to watch and to listen, and starts the first build.
    pub fn start(options: &DaemonOptions) -> Result<Daemon, DaemonError> {
        let engine = Arc::new(Engine::open(&options.folder, Store::open(&options.cache)?)?);
        let folder = engine.folder().to_owned();
        let at = |socket: PathBuf| move |source| DaemonError::Socket { socket, source };
        let socket = socket_path(&folder).map_err(at(folder.clone()))?;
        let lock = ProjectLock::take(&socket)?;
        let (sender, events) = channel();
        let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let blobs = engine.clone();
        let lost = sender.clone();
        let blobs = Box::new(move |digest: &_| {
            let bytes = blobs.store().get_again(digest);
            if bytes.is_none() {
                // Fails only when the daemon has ended.
                let _ = lost.send(Event::ContentLost);
            }
            bytes
        });
        let mut server =
            Server::bind(&socket, &name, blobs, client_events(sender.clone())).map_err(at(socket.clone()))?;
        let listen =
            |address| server.listen(address).map_err(|source| DaemonError::Listen { address, source });
        let tcp = options.listen.map(listen).transpose()?;
        let server = Arc::new(server);
        let mut watch = Watch::start(&folder, send_batches(sender.clone(), Event::Files))?;
        watch.set_relevant(&[kiln_project::PROJECT_FILE.to_owned()]);
        let built = sender.clone();
        let builder_options = BuilderOptions {
            jobs: options.jobs,
            memory_bytes: options.memory_bytes,
            cache_bytes_max: options.cache_bytes_max,
            write_outputs: options.write_outputs,
            poll: options.poll,
        };
        let builder = Builder::start(engine.clone(), server.clone(), builder_options, move |result| {
            // Fails only when the daemon has ended.
            let _ = built.send(Event::Built(result));
        });
        let requests = Requests::start(engine.clone(), server.clone());
        let mut daemon = Daemon {
            events,
            stop: StopHandle(sender),
            engine,
            server,
            builder,
            watch,
            socket,
            tcp,
            published: None,
            building: None,
            is_incomplete: false,
            retry: None,
            relevant: Vec::new(),
            relevant_version: 0,
            built_for: Wishes::default(),
            requests,
            accuracy: Accuracy::default(),
            is_superseded: false,
            _lock: lock,
        };
        daemon.begin_build(Batch::default());
        Ok(daemon)
    }

    /// Ends this daemon from another thread.
    pub fn stop_handle(&self) -> StopHandle {
        self.stop.clone()
    }

    /// Where clients connect.
    pub fn socket(&self) -> &std::path::Path {
        &self.socket
    }

    /// Where it listens besides, and the file with the token that clients show there.
    pub fn tcp(&self) -> Option<&(SocketAddr, PathBuf)> {
        self.tcp.as_ref()
    }

    /// Serves until stopped.
    pub fn run(mut self, notify: &mut dyn FnMut(Notice)) {
        notify(Notice::Building { files: Vec::new() });
        while let Some(event) = self.next_event(notify) {
            match event {
                Event::Stop => return self.builder.cancel(),
                Event::Client(event) => {
                    let is_stop = event == ServerEvent::StopAsked;
                    match &event {
                        ServerEvent::Asked { client, request } => match &request.ask {
                            Ask::BakeAtError { env, error } => {
                                self.set_error(*client, request.id, env, *error);
                            }
                            _ => self.requests.ask(*client, request.clone()),
                        },
                        ServerEvent::Gone { client, .. } => self.accuracy.forget(*client),
                        _ => {}
                    }
                    notify(Notice::Client(event));
                    if is_stop {
                        return self.builder.cancel();
                    }
                    self.heed_wishes();
                }
                Event::ContentLost => {
                    warn!(target: "wire", "a content that was asked for is no longer in the store");
                    self.is_incomplete = true;
                    if self.building.is_none() {
                        self.begin_build(Batch::default());
                    }
                }
                Event::Files(batch) => self.take_files(batch, notify),
                Event::Built(BuildResult::Early(table)) => self.publish_early(*table, notify),
                Event::Built(result) => self.end_build(result, notify),
            }
        }
    }

    /// The next event; meanwhile what is due is done. `None` when nobody can send one.
    fn next_event(&mut self, notify: &mut dyn FnMut(Notice)) -> Option<Event> {
        loop {
            let Some((due, _)) = &self.retry else { return self.events.recv().ok() };
            match self.events.recv_timeout(due.saturating_duration_since(Instant::now())) {
                Ok(event) => return Some(event),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
            // A build in flight looks at the files anyway.
            if let Some((_, files)) = self.retry.take()
                && self.building.is_none()
            {
                self.take_files(Batch::now(files.into_iter().collect()), notify);
            }
        }
    }

    fn take_files(&mut self, batch: Batch, notify: &mut dyn FnMut(Notice)) {
        match &mut self.building {
            Some(unseen) => {
                info!(target: "watch", files = batch.files.len(), first = batch.files.first(), "changed during a build");
                unseen.merge(batch);
                self.builder.cancel();
            }
            None => {
                info!(target: "watch", files = batch.files.len(), first = batch.files.first(), "changed");
                notify(Notice::Building { files: batch.files.iter().cloned().collect() });
                self.begin_build(batch);
            }
        }
    }

    fn wishes(&self) -> Wishes {
        Wishes { errors: self.accuracy.errors(), ..Wishes::among(self.server.wanted().targets.iter()) }
    }

    /// Builds anew if clients want something else than the last build was for. Maps that nobody waits for any more are given up.
    fn heed_wishes(&mut self) {
        let wishes = self.wishes();
        if self.building.is_none() {
            if wishes != self.built_for {
                self.begin_build(Batch::default());
            }
        } else if wishes.errors != self.built_for.errors && !self.is_superseded {
            self.is_superseded = true;
            self.builder.cancel();
        }
    }

    /// Notes at which error a client wants an environment; the answer comes with the revision that has it.
    fn set_error(&mut self, client: u64, id: u64, env: &str, error: Option<f64>) {
        let is_known = self.published.as_ref().is_some_and(|table| {
            let envs = table.targets.get("project").and_then(|project| project.meta["envs"].as_array());
            envs.is_some_and(|envs| envs.iter().any(|known| known == env))
        });
        if !is_known {
            let fault =
                Diagnostic::error(format!("the project has no environment `{env}`, or is not built yet"));
            return self.server.answer(client, Answer::refused(id, fault));
        }
        let superseded = self.accuracy.ask(client, id, env, error);
        superseded.into_iter().for_each(|(client, answer)| self.server.answer(client, answer));
        if self.building.is_none() {
            self.answer_fulfilled();
        }
    }

    /// Answers those whose error the last build had.
    fn answer_fulfilled(&mut self) {
        let Some(revision) = self.published.as_ref().map(|table| table.number) else { return };
        for (client, answer) in self.accuracy.fulfil(&self.built_for.errors, revision) {
            self.server.answer(client, answer);
        }
    }

    fn begin_build(&mut self, batch: Batch) {
        // The builder looks again at what is shown when it begins: who comes in between is heard of, and may cost an idle build.
        self.built_for = self.wishes();
        self.is_superseded = false;
        debug!(target: "build", files = batch.files.len(), wishes = ?self.built_for, "begins");
        self.building = Some(Batch::default());
        self.server.set_building(Some(batch.files.iter().cloned().collect()));
        self.builder.request(batch, self.built_for.errors.clone());
    }

    fn end_build(&mut self, result: BuildResult, notify: &mut dyn FnMut(Notice)) {
        let is_failure = matches!(result, BuildResult::Failed(_));
        let is_cancelled = matches!(result, BuildResult::Cancelled(_));
        let mut unseen = match &result {
            // The next build may be running already.
            // Something damaged was dropped: it must be made anew.
            BuildResult::OutputsFailed(Error::Lost { .. }) => {
                if self.building.is_none() {
                    self.begin_build(Batch::default());
                }
                return;
            }
            BuildResult::OutputsFailed(error) => {
                error!(target: "build", %error, "its files were not written");
                return notify(Notice::Failed(error.to_string()));
            }
            BuildResult::Overlooked(files) => {
                warn!(target: "watch", ?files, "nobody told of a change");
                return self.take_files(Batch::now(self.watch.with_other_names(files.clone())), notify);
            }
            BuildResult::Cancelled(batch) => {
                debug!(target: "build", files = batch.files.len(), "cancelled");
                batch.clone()
            }
            BuildResult::Done(_) | BuildResult::Early(_) | BuildResult::Failed(_) => Batch::default(),
        };
        unseen.merge(self.building.take().unwrap_or_default());
        self.server.set_building(None);
        // Before anybody hears of the build: what is edited in answer to it must be noticed.
        // Sources that became relevant with this build may have changed before they were watched, and a link may lead
        // elsewhere now.
        let sources = self.engine.sources();
        if self.relevant_version != sources.names_version() || is_failure || self.watch.has_links() {
            self.relevant_version = sources.names_version();
            let mut relevant = sources.looked_at();
            relevant.push(kiln_project::PROJECT_FILE.to_owned());
            if is_failure {
                // A plan that broke off has not looked at everything that matters.
                relevant.extend(std::mem::take(&mut self.relevant));
            }
            self.watch.set_relevant(&relevant);
            let old: HashSet<&String> = self.relevant.iter().collect();
            let new = relevant.iter().filter(|path| !old.contains(path));
            let changed = sources.changed_since_seen(new, || true);
            unseen.merge(Batch::now(self.watch.with_other_names(changed)));
            self.relevant = relevant;
        }
        match result {
            BuildResult::Done(table) => {
                let table = self.without_unfinished(*table, &unseen, notify);
                self.publish(table, notify);
                self.answer_fulfilled();
            }
            BuildResult::Failed(error) => {
                error!(target: "build", %error, "failed");
                notify(Notice::Failed(error.to_string()));
            }
            BuildResult::Cancelled(_)
            | BuildResult::Early(_)
            | BuildResult::OutputsFailed(_)
            | BuildResult::Overlooked(_) => {}
        }
        let must_begin_again = std::mem::take(&mut self.is_superseded) && is_cancelled;
        if !unseen.files.is_empty() {
            notify(Notice::Building { files: unseen.files.iter().cloned().collect() });
            self.begin_build(unseen);
        } else if must_begin_again {
            self.begin_build(Batch::default());
        }
        self.heed_wishes();
    }

    /// The table as it would be had the files that are just being written not been looked at.
    fn without_unfinished(
        &mut self,
        mut table: RevisionTable,
        unseen: &Batch,
        notify: &mut dyn FnMut(Notice),
    ) -> RevisionTable {
        let Some(last) = &self.published else { return table };
        let mut unfinished = self.watch.being_written();
        unfinished.extend(unseen.files.iter().cloned());
        let failed = hide_errors_of(&mut table, last, &unfinished);
        self.retry = None;
        if !failed.is_empty() {
            info!(target: "watch", ?failed, "being written");
            notify(Notice::Unfinished { files: failed.iter().cloned().collect() });
            self.retry = Some((Instant::now() + UNFINISHED, failed));
        }
        table
    }

    /// Publishes what clients want while the rest is still being made. What a newer edit makes void, and what may be half
    /// written, waits for the end of the build.
    fn publish_early(&mut self, mut table: RevisionTable, notify: &mut dyn FnMut(Notice)) {
        let is_newest = self.building.as_ref().is_some_and(|unseen| unseen.files.is_empty());
        let Some(last) = self.published.clone().filter(|_| is_newest) else { return };
        if !hide_errors_of(&mut table, &last, &self.watch.being_written()).is_empty() {
            return;
        }
        // What is still being made may have the faults that it had.
        let is_old = |fault: &&Diagnostic| {
            let is_of_edit = fault.file.as_ref().is_some_and(|file| table.work.changed_files.contains(file));
            !is_of_edit && !table.diagnostics.contains(fault)
        };
        let old: Vec<Diagnostic> = last.diagnostics.iter().filter(is_old).cloned().collect();
        table.diagnostics.extend(old);
        self.publish(table, notify);
    }

    fn publish(&mut self, mut table: RevisionTable, notify: &mut dyn FnMut(Notice)) {
        let is_incomplete = std::mem::take(&mut self.is_incomplete);
        if let Some(last) = &self.published
            && !is_incomplete
            && last.targets == table.targets
            && last.diagnostics == table.diagnostics
            && last.building == table.building
        {
            debug!(target: "build", run_ms = table.work.run_ms, "changed nothing");
            return notify(Notice::Unchanged { files: table.work.changed_files });
        }
        table.number = self.published.as_ref().map_or(1, |last| last.number + 1);
        table.work.published_unix_ms = unix_ms(SystemTime::now());
        let (number, ran, work) = (table.number, table.work.ran.len(), &table.work);
        info!(target: "build", revision = number, ran, plan_ms = work.plan_ms, run_ms = work.run_ms, "published");
        let table = Arc::new(table);
        self.server.publish(table.clone());
        self.published = Some(table.clone());
        notify(Notice::Published(table));
    }
}

/// Says of these files what the last table said; returns those that have an error now. A target that became stale is as it was,
/// unless something else is wrong too.
fn hide_errors_of(
    table: &mut RevisionTable,
    last: &RevisionTable,
    files: &BTreeSet<String>,
) -> BTreeSet<String> {
    let is_of = |files: &BTreeSet<String>, diagnostic: &Diagnostic| {
        diagnostic.file.as_ref().is_some_and(|file| files.contains(file))
    };
    let errors =
        table.diagnostics.iter().filter(|diagnostic| diagnostic.is_error() && is_of(files, diagnostic));
    let failed: BTreeSet<String> = errors.filter_map(|diagnostic| diagnostic.file.clone()).collect();
    if failed.is_empty() {
        return failed;
    }
    table.diagnostics.retain(|diagnostic| !is_of(&failed, diagnostic));
    let is_new_error =
        |diagnostic: &Diagnostic| diagnostic.is_error() && !last.diagnostics.contains(diagnostic);
    if !table.diagnostics.iter().any(is_new_error) {
        for (name, target) in &mut table.targets {
            if let Some(before) = last.targets.get(name)
                && before.parts == target.parts
                && before.meta == target.meta
            {
                target.state = before.state;
            }
        }
    }
    table
        .diagnostics
        .extend(last.diagnostics.iter().filter(|diagnostic| is_of(&failed, diagnostic)).cloned());
    // In the order of the last table, so that equal ones are seen to be equal.
    let place = |diagnostic: &Diagnostic| last.diagnostics.iter().position(|known| known == diagnostic);
    table.diagnostics.sort_by_key(|diagnostic| place(diagnostic).unwrap_or(usize::MAX));
    failed
}

fn client_events(sender: Sender<Event>) -> Box<dyn Fn(ServerEvent) + Send + Sync> {
    Box::new(move |event| {
        // Fails only when the daemon has ended.
        let _ = sender.send(Event::Client(event));
    })
}
