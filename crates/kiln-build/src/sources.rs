//! The files a person edits, seen through stamps so that unchanged ones are not read again.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
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
    modified_ns: u128,
    changed_ns: i128,
    digest: Digest,
    /// False while the file is too young for its stamp to prove anything.
    settled: bool,
}

/// A project's folder: one view of its files, hashed at most once each until [`SourceTree::refresh`].
#[derive(Debug)]
pub struct SourceTree {
    root: PathBuf,
    stamps: Mutex<BTreeMap<String, Stamp>>,
    seen: Mutex<BTreeMap<String, SourceState>>,
}

impl SourceTree {
    /// The tree below `root`, knowing the stamps of an earlier run.
    pub(crate) fn new(root: PathBuf, stamps: BTreeMap<String, Stamp>) -> SourceTree {
        SourceTree { root, stamps: Mutex::new(stamps), seen: Mutex::default() }
    }

    /// The project's folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Forgets what was seen, so that the next look is at the files as they are now.
    pub fn refresh(&self) {
        lock(&self.seen).clear();
    }

    /// What is at `path` (project-relative) now, or was when it was first looked at since the last refresh.
    pub fn state(&self, path: &str) -> SourceState {
        if let Some(state) = lock(&self.seen).get(path) {
            return state.clone();
        }
        let state = self.examine(path);
        lock(&self.seen).insert(path.to_owned(), state.clone());
        state
    }

    /// The bytes at `path`; `None` if there is no readable file.
    pub fn read(&self, path: &str) -> Option<Arc<[u8]>> {
        let bytes = match read_file(&self.root.join(path)) {
            Ok(bytes) => bytes,
            Err(_) => {
                // Seen as missing or unreadable, so that its appearance counts as a change.
                self.state(path);
                return None;
            }
        };
        lock(&self.seen).entry(path.to_owned()).or_insert_with(|| SourceState::Present(Digest::of(&bytes)));
        Some(bytes.into())
    }

    /// Every path looked at since the last refresh, missing ones too: what a watcher must watch.
    pub fn looked_at(&self) -> Vec<String> {
        lock(&self.seen).keys().cloned().collect()
    }

    /// Paths that are no longer as they were when they were looked at.
    pub fn changed_since_seen(&self) -> Vec<String> {
        let seen = lock(&self.seen).clone();
        seen.into_iter().filter(|(path, state)| self.examine(path) != *state).map(|(path, _)| path).collect()
    }

    pub(crate) fn stamps(&self) -> BTreeMap<String, Stamp> {
        lock(&self.stamps).clone()
    }

    fn examine(&self, path: &str) -> SourceState {
        let full = self.root.join(path);
        let metadata = match fs::metadata(&full) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return SourceState::Missing,
            Err(error) => return SourceState::Unreadable(error.to_string()),
        };
        if !metadata.is_file() {
            return SourceState::Unreadable("it is not a file".to_owned());
        }
        if metadata.len() > SOURCE_BYTES_MAX {
            return SourceState::Unreadable(format!("it is larger than {} GiB", SOURCE_BYTES_MAX >> 30));
        }
        if let Some(stamp) = lock(&self.stamps).get(path)
            && stamp.settled
            && *stamp == Stamp::new(&metadata, stamp.digest, true)
        {
            return SourceState::Present(stamp.digest);
        }
        match read_file(&full) {
            Ok(bytes) => {
                let digest = Digest::of(&bytes);
                let stamp = Stamp::new(&metadata, digest, is_settled(&metadata));
                lock(&self.stamps).insert(path.to_owned(), stamp);
                SourceState::Present(digest)
            }
            Err(error) => SourceState::Unreadable(error.to_string()),
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

fn is_settled(metadata: &fs::Metadata) -> bool {
    let modified = metadata.modified().unwrap_or_else(|_| SystemTime::now());
    SystemTime::now().duration_since(modified).is_ok_and(|age| age > RACY)
}

impl Stamp {
    fn new(metadata: &fs::Metadata, digest: Digest, settled: bool) -> Stamp {
        let modified = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let (inode, changed_ns) = identity(metadata);
        let modified_ns = modified.unwrap_or_default().as_nanos();
        Stamp { inode, bytes: metadata.len(), modified_ns, changed_ns, digest, settled }
    }
}

#[cfg(unix)]
fn identity(metadata: &fs::Metadata) -> (u64, i128) {
    use std::os::unix::fs::MetadataExt as _;
    (metadata.ino(), i128::from(metadata.ctime()) * 1_000_000_000 + i128::from(metadata.ctime_nsec()))
}

#[cfg(not(unix))]
fn identity(_: &fs::Metadata) -> (u64, i128) {
    (0, 0)
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // The maps behind these locks are valid after every statement, so a panic elsewhere does not spoil them.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads a whole file of the tree or says why not.
pub(crate) fn read_declared(tree: &SourceTree, path: &str, digest: Digest) -> Result<Arc<[u8]>, Error> {
    let full = tree.root.join(path);
    let bytes = read_file(&full).map_err(Error::io("read", &full))?;
    if Digest::of(&bytes) == digest {
        return Ok(bytes.into());
    }
    let changed = std::io::Error::other("it changed while the build ran; build again");
    Err(Error::Io { operation: "use", path: full, source: changed })
}
