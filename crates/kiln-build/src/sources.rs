//! The files a person edits, seen through stamps so that unchanged ones are not read again.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::{Digest, Error};

/// Largest source file that is read.
pub const SOURCE_BYTES_MAX: u64 = 4 << 30;

/// A file changed within this time before it was hashed may change again without a new time stamp
/// (coarse clocks, FAT's two seconds), so its stamp is not trusted.
const RACY: Duration = Duration::from_secs(2);

/// What is at a source path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceState {
    /// A readable file with this content.
    Present(Digest),
    /// Nothing.
    Missing,
    /// Something that cannot be read, and why.
    Unreadable(String),
}

impl SourceState {
    /// The content's digest, if there is any.
    pub fn digest(&self) -> Option<Digest> {
        match self {
            SourceState::Present(digest) => Some(*digest),
            SourceState::Missing | SourceState::Unreadable(_) => None,
        }
    }
}

/// Facts of `stat` that change when a file's content does, and the digest it had then.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stamp {
    inode: u64,
    bytes: u64,
    modified_ns: u64,
    changed_ns: i64,
    digest: Digest,
    /// False while the file is too young for its stamp to prove anything.
    settled: bool,
}

/// A project's folder: one view of its files, hashed at most once each until [`SourceTree::refresh`].
#[derive(Debug)]
pub struct SourceTree {
    root: PathBuf,
    stamps: Mutex<BTreeMap<String, Stamp>>,
    /// `None`: to be looked at again.
    seen: Mutex<HashMap<String, Option<Seen>>>,
    /// Counts the changes to the set of paths in `seen`.
    names_version: AtomicU64,
    hashed_files: AtomicUsize,
    hashed_bytes: AtomicU64,
}

/// What was found at a path.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    state: SourceState,
    bytes: u64,
}

impl SourceTree {
    /// The tree below `root`, knowing the stamps of an earlier run.
    pub(crate) fn new(root: PathBuf, stamps: BTreeMap<String, Stamp>) -> SourceTree {
        SourceTree {
            root,
            stamps: Mutex::new(stamps),
            seen: Mutex::default(),
            names_version: AtomicU64::new(0),
            hashed_files: AtomicUsize::new(0),
            hashed_bytes: AtomicU64::new(0),
        }
    }

    /// The project's folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Forgets what was seen, so that the next look is at the files as they are now.
    pub fn refresh(&self) {
        lock(&self.seen).clear();
        self.names_version.fetch_add(1, Ordering::Relaxed);
    }

    /// Forgets what was seen at some paths: whoever is told of every change need not look at the other files again.
    pub fn forget<'a>(&self, paths: impl IntoIterator<Item = &'a String>) {
        let mut seen = lock(&self.seen);
        for path in paths {
            if let Some(seen) = seen.get_mut(path) {
                *seen = None;
            }
        }
    }

    /// Changes when a path is looked at for the first time since the last refresh, and with each refresh.
    pub fn names_version(&self) -> u64 {
        self.names_version.load(Ordering::Relaxed)
    }

    /// What is at `path` (project-relative) now, or was when it was first looked at since the last refresh.
    pub fn state(&self, path: &str) -> SourceState {
        self.look(path).state
    }

    /// Length of the file at `path` as it was seen; 0 if there is none.
    pub(crate) fn bytes(&self, path: &str) -> u64 {
        self.look(path).bytes
    }

    /// Whether the content at `path` is still, or again, the one with this digest.
    pub(crate) fn is(&self, path: &str, digest: Option<Digest>) -> bool {
        if let Some(Some(seen)) = lock(&self.seen).get(path) {
            return seen.state.digest() == digest;
        }
        self.state(path).digest() == digest
    }

    fn look(&self, path: &str) -> Seen {
        if let Some(Some(seen)) = lock(&self.seen).get(path) {
            return seen.clone();
        }
        let seen = self.examine(path);
        if lock(&self.seen).insert(path.to_owned(), Some(seen.clone())).is_none() {
            self.names_version.fetch_add(1, Ordering::Relaxed);
        }
        seen
    }

    /// The bytes at `path` now; `None` if there is no readable file. Either way the path counts as looked at.
    pub fn read(&self, path: &str) -> Option<Arc<[u8]>> {
        self.state(path);
        read_file(&self.root.join(path)).ok().map(Arc::from)
    }

    /// Every path looked at since the last refresh, missing ones too: what a watcher must watch.
    pub fn looked_at(&self) -> Vec<String> {
        let seen = lock(&self.seen);
        let looked_at = seen.iter().filter(|(_, seen)| seen.is_some());
        let mut paths: Vec<String> = looked_at.map(|(path, _)| path.clone()).collect();
        paths.sort_unstable();
        paths
    }

    /// Those of `paths` that are no longer as they were when they were looked at. Ends early when `goes_on` says no.
    pub fn changed_since_seen<'a>(
        &self,
        paths: impl IntoIterator<Item = &'a String>,
        goes_on: impl Fn() -> bool,
    ) -> Vec<String> {
        let seen = |path: &String| lock(&self.seen).get(path).cloned().flatten();
        let is_changed = |path: &&String| seen(path).is_some_and(|seen| self.examine(path) != seen);
        paths.into_iter().take_while(|_| goes_on()).filter(is_changed).cloned().collect()
    }

    /// How many files were read to learn their digest, and how many bytes they had together.
    pub fn hashed(&self) -> (usize, u64) {
        (self.hashed_files.load(Ordering::Relaxed), self.hashed_bytes.load(Ordering::Relaxed))
    }

    fn count_hashed(&self, bytes: u64) {
        self.hashed_files.fetch_add(1, Ordering::Relaxed);
        self.hashed_bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// The stamps of the files that were looked at since the last refresh.
    pub(crate) fn stamps(&self) -> BTreeMap<String, Stamp> {
        let seen = lock(&self.seen);
        lock(&self.stamps)
            .iter()
            .filter(|(path, _)| seen.get(*path).is_some_and(Option::is_some))
            .map(|(path, stamp)| (path.clone(), stamp.clone()))
            .collect()
    }

    fn examine(&self, path: &str) -> Seen {
        let full = self.root.join(path);
        let without_content = |state| Seen { state, bytes: 0 };
        // Before the file is looked at: hashing a large one takes longer than a change needs.
        let now = SystemTime::now();
        let metadata = match fs::metadata(&full) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return without_content(SourceState::Missing);
            }
            Err(error) => return without_content(SourceState::Unreadable(error.to_string())),
        };
        if !metadata.is_file() {
            return without_content(SourceState::Unreadable("it is not a file".to_owned()));
        }
        if metadata.len() > SOURCE_BYTES_MAX {
            let reason = format!("it is larger than {} GiB", SOURCE_BYTES_MAX >> 30);
            return without_content(SourceState::Unreadable(reason));
        }
        let bytes = metadata.len();
        if let Some(stamp) = lock(&self.stamps).get(path)
            && stamp.settled
            && *stamp == Stamp::new(&metadata, stamp.digest, true)
        {
            return Seen { state: SourceState::Present(stamp.digest), bytes };
        }
        self.count_hashed(bytes);
        match fs::File::open(&full).and_then(|file| Digest::of_reader(&mut file.take(SOURCE_BYTES_MAX))) {
            Ok(digest) => {
                let stamp = Stamp::new(&metadata, digest, is_settled(&metadata, now));
                lock(&self.stamps).insert(path.to_owned(), stamp);
                Seen { state: SourceState::Present(digest), bytes }
            }
            Err(error) => without_content(SourceState::Unreadable(error.to_string())),
        }
    }
}

/// The whole of an ordinary file. What is no file (a device, a pipe) could block or never end, and is refused.
fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(std::io::Error::other("it is not a file"));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(metadata.len().min(SOURCE_BYTES_MAX)).unwrap_or(0));
    fs::File::open(path)?.take(SOURCE_BYTES_MAX + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > SOURCE_BYTES_MAX {
        return Err(std::io::Error::other("it is too large"));
    }
    Ok(bytes)
}

/// Whether a file that is hashed at `now` is old enough for its stamp to prove its content from then on. Both its times
/// count: the one can be set by anybody, and the other is the system's. A clock that went back makes files of the future,
/// which never settle and are hashed each time.
fn is_settled(metadata: &fs::Metadata, now: SystemTime) -> bool {
    let Ok(modified) = metadata.modified() else { return false };
    let changed = UNIX_EPOCH.checked_add(Duration::from_nanos(identity(metadata).1.try_into().unwrap_or(0)));
    let latest = changed.map_or(modified, |changed| changed.max(modified));
    now.duration_since(latest).is_ok_and(|age| age > RACY)
}

impl Stamp {
    fn new(metadata: &fs::Metadata, digest: Digest, settled: bool) -> Stamp {
        let modified = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let (inode, changed_ns) = identity(metadata);
        let modified_ns = modified.and_then(|time| time.as_nanos().try_into().ok()).unwrap_or_default();
        Stamp { inode, bytes: metadata.len(), modified_ns, changed_ns, digest, settled }
    }
}

/// Inode and time of the last change to content or attributes, which no program can set.
#[cfg(unix)]
fn identity(metadata: &fs::Metadata) -> (u64, i64) {
    use std::os::unix::fs::MetadataExt as _;
    (metadata.ino(), metadata.ctime().saturating_mul(1_000_000_000).saturating_add(metadata.ctime_nsec()))
}

#[cfg(not(unix))]
fn identity(_: &fs::Metadata) -> (u64, i64) {
    (0, 0)
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // The maps behind these locks are valid after every statement, so a panic elsewhere does not spoil them.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads a whole file of the tree or says why not.
pub(crate) fn read_declared(tree: &SourceTree, path: &str, digest: Digest) -> Result<Arc<[u8]>, Error> {
    match read_file(&tree.root.join(path)) {
        Ok(bytes) if Digest::of(&bytes) == digest => Ok(bytes.into()),
        Ok(_) | Err(_) => Err(Error::SourceChanged { path: path.to_owned() }),
    }
}
