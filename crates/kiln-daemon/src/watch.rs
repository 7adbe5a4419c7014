//! File events in, settled batches of changed paths out.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher as _};

/// A batch ends when nothing has happened for this long …
const QUIET: Duration = Duration::from_millis(15);
/// The same where one file was saved and closed: only an editor that touches it once more is waited for.
const QUIET_AFTER_SAVE: Duration = Duration::from_millis(2);
/// … or when it has gone on for this long.
const BATCH_MAX: Duration = Duration::from_millis(500);

/// A file that is written to and not closed is taken to be unfinished for this long after the last byte.
pub(crate) const UNFINISHED: Duration = Duration::from_secs(1);

/// Files of the project that changed together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Batch {
    /// Relative to the project where they lie in it.
    pub(crate) files: BTreeSet<String>,
    /// Unix time at which the first of them was noticed, in milliseconds.
    pub(crate) noticed_unix_ms: f64,
}

impl Batch {
    /// Files that are found changed at this moment.
    pub(crate) fn now(files: Vec<String>) -> Batch {
        Batch { files: files.into_iter().collect(), noticed_unix_ms: unix_ms(SystemTime::now()) }
    }

    pub(crate) fn merge(&mut self, other: Batch) {
        self.noticed_unix_ms = match (self.files.is_empty(), other.files.is_empty()) {
            (true, _) => other.noticed_unix_ms,
            (false, true) => self.noticed_unix_ms,
            (false, false) => self.noticed_unix_ms.min(other.noticed_unix_ms),
        };
        self.files.extend(other.files);
    }
}

/// Path, as named and as links lead to it, to the names that it has in the project.
pub(crate) type Relevant = BTreeMap<PathBuf, BTreeSet<String>>;

/// Files that are open for writing, as far as the system tells, and when the last byte was seen.
type Writing = Arc<Mutex<BTreeMap<String, Instant>>>;

/// Watches a project's folder, and the folders of sources that lie elsewhere.
pub(crate) struct Watch {
    watcher: RecommendedWatcher,
    folder: PathBuf,
    /// What the last plan looked at.
    relevant: Arc<Mutex<Relevant>>,
    writing: Writing,
    outside: BTreeSet<PathBuf>,
    /// Whether a source is a link, or lies outside the folder.
    has_links: bool,
}

impl Watch {
    /// Begins to watch; `settled` is called from a thread of its own.
    pub(crate) fn start(folder: &Path, settled: impl Fn(Batch) + Send + 'static) -> notify::Result<Watch> {
        let (sender, events) = channel();
        let mut watcher = notify::recommended_watcher(move |event| {
            // Fails only when the settling thread, and with it the daemon, has ended.
            let _ = sender.send(event);
        })?;
        watcher.watch(folder, RecursiveMode::Recursive)?;
        let relevant = Arc::new(Mutex::new(BTreeMap::new()));
        let writing = Writing::default();
        let (folder_of_thread, relevant_of_thread) = (folder.to_owned(), relevant.clone());
        let writing_of_thread = writing.clone();
        std::thread::spawn(move || {
            let name = |event: &_| {
                let names = name_changes(event, &folder_of_thread, &relevant_of_thread);
                note_writing(event.as_ref().ok(), &names, &writing_of_thread);
                names
            };
            settle(&events, &settled, name, |event| ends_a_save(event.as_ref()));
        });
        let (folder, outside) = (folder.to_owned(), BTreeSet::new());
        Ok(Watch { watcher, folder, relevant, writing, outside, has_links: false })
    }

    /// Files that somebody is in the middle of writing: what is wrong with them may not be wrong when they are whole.
    pub(crate) fn being_written(&self) -> BTreeSet<String> {
        let mut writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        writing.retain(|_, last| last.elapsed() < UNFINISHED);
        writing.keys().cloned().collect()
    }

    /// Whether [`Watch::set_relevant`] depends on more than the sources' names.
    pub(crate) fn has_links(&self) -> bool {
        self.has_links
    }

    /// These files and all other names of the same files: an edit reaches the readers of a file, by whatever name, in
    /// one build.
    pub(crate) fn with_other_names(&self, mut names: Vec<String>) -> Vec<String> {
        let relevant = self.relevant.lock().unwrap_or_else(PoisonError::into_inner);
        let is_same = |known: &&BTreeSet<String>| names.iter().any(|name| known.contains(name));
        let others: Vec<String> = relevant.values().filter(is_same).flatten().cloned().collect();
        names.extend(others);
        names
    }

    /// Says which sources matter (project-relative, missing ones too). Those that lie outside the folder, or are
    /// links to files outside, are watched where they are.
    pub(crate) fn set_relevant(&mut self, names: &[String]) {
        let mut relevant = Relevant::new();
        let mut outside = BTreeSet::new();
        let mut folders = HashMap::new();
        self.has_links = false;
        for name in names {
            let path = normalise(&self.folder.join(name));
            let target = follow_links(&path, &mut folders);
            self.has_links |= target != path || !path.starts_with(&self.folder);
            for path in [path, target] {
                if !path.starts_with(&self.folder)
                    && let Some(parent) = path.parent()
                {
                    outside.insert(parent.to_owned());
                }
                relevant.entry(path).or_default().insert(name.clone());
            }
        }
        *self.relevant.lock().unwrap_or_else(PoisonError::into_inner) = relevant;
        // A folder that cannot be watched, because it does not exist yet, is tried again after the next build.
        let watcher = &mut self.watcher;
        let known = &self.outside;
        let is_watched = |folder: &PathBuf| {
            known.contains(folder) || watcher.watch(folder, RecursiveMode::NonRecursive).is_ok()
        };
        self.outside = outside.into_iter().filter(is_watched).collect();
    }
}

/// Where a path leads. Its folder is looked up once for all files in it.
fn follow_links(path: &Path, folders: &mut HashMap<PathBuf, Option<PathBuf>>) -> PathBuf {
    let is_link = path.symlink_metadata().is_ok_and(|metadata| metadata.is_symlink());
    let (Some(folder), Some(name), false) = (path.parent(), path.file_name(), is_link) else {
        return path.canonicalize().unwrap_or_else(|_| path.to_owned());
    };
    let folder = folders.entry(folder.to_owned()).or_insert_with(|| folder.canonicalize().ok());
    folder.as_ref().map_or_else(|| path.to_owned(), |folder| folder.join(name))
}

/// Removes `.` and `..` without asking the file system, so that missing files have one spelling too.
pub(crate) fn normalise(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => _ = normal.pop(),
            std::path::Component::CurDir => {}
            other => normal.push(other),
        }
    }
    normal
}

/// The sources that an event is about: itself, or those below a folder that appeared, went or moved.
/// An error (a queue overflow) is about all of them.
pub(crate) fn name_changes(
    event: &notify::Result<notify::Event>,
    folder: &Path,
    relevant: &Mutex<Relevant>,
) -> BTreeSet<String> {
    let relevant = relevant.lock().unwrap_or_else(PoisonError::into_inner);
    let all = || relevant.values().flatten().cloned().collect();
    let Ok(event) = event else { return all() };
    if event.need_rescan() {
        return all();
    }
    // A file that is closed after writing has changed, if only by an event before; one that is read has not.
    if matches!(event.kind, EventKind::Access(_)) && !ends_a_save(Ok(event)) {
        return BTreeSet::new();
    }
    let mut names = BTreeSet::new();
    for path in &event.paths {
        // Being told about the watched folder itself says nothing about a source in it.
        if path == folder {
            continue;
        }
        let below = relevant.range(path.clone()..).take_while(|(source, _)| source.starts_with(path));
        names.extend(below.flat_map(|(_, names)| names.clone()));
    }
    names
}

/// Keeps account of who writes: bytes begin it, closing, moving or removing the file ends it.
fn note_writing(event: Option<&notify::Event>, names: &BTreeSet<String>, writing: &Writing) {
    use notify::event::ModifyKind;
    let mut writing = writing.lock().unwrap_or_else(PoisonError::into_inner);
    match event.map(|event| event.kind) {
        Some(EventKind::Modify(ModifyKind::Data(_))) => {
            writing.extend(names.iter().map(|name| (name.clone(), Instant::now())));
        }
        // The mode or the owner says nothing of bytes to come.
        Some(EventKind::Modify(ModifyKind::Metadata(_)) | EventKind::Create(_)) => {}
        _ => names.iter().for_each(|name| _ = writing.remove(name)),
    }
}

/// Whether a file is whole with this event: whoever wrote it closed it, or moved it to its place.
pub(crate) fn ends_a_save(event: Result<&notify::Event, &notify::Error>) -> bool {
    use notify::event::{AccessKind, AccessMode, ModifyKind, RenameMode};
    event.is_ok_and(|event| {
        matches!(
            event.kind,
            EventKind::Access(AccessKind::Close(AccessMode::Write))
                | EventKind::Modify(ModifyKind::Name(RenameMode::To | RenameMode::Both))
        )
    })
}

/// A batch that may go on.
pub(crate) struct Gathering {
    files: BTreeSet<String>,
    begun: Instant,
    /// When it ends, if nothing more happens.
    pub(crate) end: Instant,
}

impl Gathering {
    pub(crate) fn new(begun: Instant) -> Gathering {
        Gathering { files: BTreeSet::new(), begun, end: begun }
    }

    /// An event about these files. What is about none, as a reader that opens one, keeps nobody waiting.
    pub(crate) fn add(&mut self, files: BTreeSet<String>, is_whole: bool, now: Instant) {
        if files.is_empty() {
            return;
        }
        self.files.extend(files);
        let quiet = if is_whole && self.files.len() == 1 { QUIET_AFTER_SAVE } else { QUIET };
        self.end = (now + quiet).min(self.begun + BATCH_MAX);
    }
}

/// Collects events into batches until the sending side is gone. `ends_save` tells events after which one file is whole.
pub(crate) fn settle<E>(
    events: &Receiver<E>,
    settled: &impl Fn(Batch),
    name: impl Fn(&E) -> BTreeSet<String>,
    ends_save: impl Fn(&E) -> bool,
) {
    while let Ok(mut event) = events.recv() {
        let noticed_unix_ms = unix_ms(SystemTime::now());
        let mut gathering = Gathering::new(Instant::now());
        loop {
            let now = Instant::now();
            gathering.add(name(&event), ends_save(&event), now);
            // More may be queued for ever: a batch ends all the same, and one about nothing has not begun.
            if gathering.end <= now {
                break;
            }
            event = match events.recv_timeout(gathering.end - now) {
                Ok(event) => event,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            };
        }
        if !gathering.files.is_empty() {
            settled(Batch { files: gathering.files, noticed_unix_ms });
        }
    }
}

pub(crate) fn unix_ms(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}

/// A settled batch as an event for the daemon's loop.
pub(crate) fn send_batches<E: Send + 'static>(
    sender: Sender<E>,
    wrap: impl Fn(Batch) -> E + Send + 'static,
) -> impl Fn(Batch) + Send + 'static {
    move |batch| {
        // Fails only when the daemon has ended.
        let _ = sender.send(wrap(batch));
    }
}
