//! Content-addressed bytes and action records, as plain files that any number of processes share.
//!
//! ```text
//! ROOT/v2/cas/ab/abcd…                 the bytes whose SHA-256 is abcd…
//! ROOT/v2/actions/ab/abcd….json        the record of the action with that key
//! ROOT/v2/scans/ab/abcd….json          what a scan found, with the states of the files it looked at
//! ROOT/v2/projects/abcd…/….json        per project: published targets, memory
//! ROOT/v2/lock                         held shared by whoever builds, exclusively by a collection
//! ```
//!
//! Every file is written whole ([`crate::write_atomically`]), so a killed process leaves either the old file or the new
//! one. Artefacts and documents of projects are synced too, so they outlast a power failure; records and scans, which only
//! save time, are not. Everything is checked when read: a blob against its name, a document against the digest it begins with. What
//! fails the check is dropped and counts as absent. A cache that cannot be written is read, and what it lacks goes to a
//! temporary folder.

use std::collections::{HashMap, HashSet};
use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::fs::{FileFacts, temporary_name, write_all_atomically, write_unsynced};
use crate::sources::lock;
use crate::{ActionRecord, Digest, Disk, FileSystem, document};

/// Folder of the present format below a cache's root. Others are of other versions and nobody's business but the
/// collection's.
pub(crate) const FORMAT_FOLDER: &str = "v2";
pub(crate) const BLOBS: &str = "cas";
pub(crate) const RECORDS: &str = "actions";
pub(crate) const SCANS: &str = "scans";
pub(crate) const PROJECTS: &str = "projects";
const LOCK_FILE: &str = "lock";

/// A file is marked as used if its mark is older than this: fine enough to tell old from new, rare enough to cost nothing.
const USE_MARK_AGE: Duration = Duration::from_secs(3600);

/// The tool could not do its work; the input is not to blame.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file operation failed.
    #[error("cannot {operation} {}: {reason}", path.display())]
    Io {
        /// As `write`.
        operation: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's.
        reason: io::Error,
    },
    /// An action failed for a reason that is not its input.
    #[error("action `{action}` failed: {reason}")]
    Action {
        /// Its name.
        action: String,
        /// What happened.
        reason: String,
    },
    /// Contents that the store had are damaged or gone: building again makes them anew.
    #[error("the store no longer has {what}; build again")]
    Lost {
        /// What they are.
        what: String,
    },
    /// A source is no longer what it was when the graph was planned: planning again sees it as it is.
    #[error("{path} changed while the build ran; build again")]
    SourceChanged {
        /// Relative to the project.
        path: String,
    },
    /// The result is not wanted any more.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// Whether there was no room on the disk.
    pub fn is_disk_full(&self) -> bool {
        use io::ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, Error::Io { reason, .. } if matches!(reason.kind(), StorageFull | QuotaExceeded))
    }

    pub(crate) fn io(operation: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Error {
        let path = path.to_owned();
        move |reason| Error::Io { operation, path, reason }
    }
}

/// Blobs that are remembered as hashed.
const HASHED_MAX: usize = 65_536;

/// Artefacts by digest, and the record of which action made what.
#[derive(Debug)]
pub struct Store {
    fs: Arc<dyn FileSystem>,
    root: PathBuf,
    /// Where new files go if the root cannot be written.
    scratch: Option<tempfile::TempDir>,
    /// Files that are of no use and could not be removed.
    useless: Mutex<HashSet<PathBuf>>,
    /// Blobs that were hashed, and what `stat` said of them before.
    hashed: Mutex<HashMap<PathBuf, FileFacts>>,
    damaged: AtomicUsize,
    written_bytes: AtomicU64,
}

/// While it lives no collection takes anything out of the store.
#[derive(Debug)]
pub struct Hold {
    /// Locked until it is closed; `None` where the file system has no locks.
    _lock: Option<File>,
}

impl Store {
    /// Opens or creates the store below `cache`.
    ///
    /// # Errors
    /// The folder can neither be made nor read.
    pub fn open(cache: &Path) -> Result<Store, Error> {
        Store::open_on(Arc::new(Disk), cache)
    }

    /// The same on another file system.
    ///
    /// # Errors
    /// The folder can neither be made nor read.
    pub fn open_on(fs: Arc<dyn FileSystem>, cache: &Path) -> Result<Store, Error> {
        let root = cache.join(FORMAT_FOLDER);
        let scratch = match prepare(&*fs, &root) {
            Ok(()) => None,
            Err(error) if is_read_only(&error) && root.join(BLOBS).is_dir() => {
                let scratch = tempfile::tempdir().map_err(Error::io("create a folder for", &root))?;
                prepare(&*fs, scratch.path()).map_err(Error::io("create the folder", scratch.path()))?;
                Some(scratch)
            }
            Err(error) => return Err(Error::io("create the folder", &root)(error)),
        };
        Ok(Store {
            fs,
            root,
            scratch,
            useless: Mutex::default(),
            hashed: Mutex::default(),
            damaged: AtomicUsize::new(0),
            written_bytes: AtomicU64::new(0),
        })
    }

    /// The folder of this format's files.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The file operations it works with.
    pub fn file_system(&self) -> &dyn FileSystem {
        &*self.fs
    }

    /// Whether the cache cannot be written, so that what this process makes ends with it.
    pub fn is_read_only(&self) -> bool {
        self.scratch.is_some()
    }

    /// Keeps collections away; waits for one that runs.
    pub fn hold(&self) -> Hold {
        let lock = self.lock_file().ok().filter(|file| file.lock_shared().is_ok());
        Hold { _lock: lock }
    }

    /// Whether the file system can keep a collection away from builds.
    pub fn has_locks(&self) -> bool {
        self.lock_file().is_ok_and(|file| match file.try_lock_shared() {
            Ok(()) | Err(std::fs::TryLockError::WouldBlock) => true,
            Err(std::fs::TryLockError::Error(_)) => false,
        })
    }

    pub(crate) fn lock_file(&self) -> io::Result<File> {
        let path = self.root.join(LOCK_FILE);
        // A lock can be taken on a file of somebody else's, too.
        OpenOptions::new().write(true).create(true).truncate(false).open(&path).or_else(|_| File::open(&path))
    }

    /// Keeps `bytes` and returns their name.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn put(&self, bytes: &[u8]) -> Result<Digest, Error> {
        let digest = Digest::of(bytes);
        self.write_missing(&[(digest, bytes)], None)?;
        Ok(digest)
    }

    /// Keeps what an action made and then its record.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn put_result(&self, record: &ActionRecord, blobs: &[Arc<[u8]>]) -> Result<(), Error> {
        let digests = record.result.outputs.iter().map(|output| output.digest);
        let blobs: Vec<(Digest, &[u8])> = digests.zip(blobs.iter().map(|bytes| &**bytes)).collect();
        self.write_missing(&blobs, Some(record))
    }

    fn write_missing(&self, blobs: &[(Digest, &[u8])], record: Option<&ActionRecord>) -> Result<(), Error> {
        let mut files: Vec<(PathBuf, &[u8])> = Vec::new();
        for (digest, bytes) in blobs {
            let path = self.new_path(BLOBS, digest, "");
            if !self.contains(digest, bytes.len() as u64) && !files.iter().any(|(known, _)| *known == path) {
                files.push((path, bytes));
            }
        }
        write_all_atomically(&*self.fs, &files)?;
        self.note_written(files.iter().map(|(path, bytes)| (path, bytes.len())));
        let Some(record) = record else { return Ok(()) };
        // After what it speaks of. It is not synced: without it the action runs again.
        self.write_document(&self.new_path(RECORDS, &record.key(), ".json"), record)
    }

    fn note_written<'a>(&self, files: impl IntoIterator<Item = (&'a PathBuf, usize)>) {
        let mut useless = lock(&self.useless);
        for (path, bytes) in files {
            self.written_bytes.fetch_add(bytes as u64, Ordering::Relaxed);
            useless.remove(path);
        }
    }

    /// The bytes named `digest`, or `None` if they are absent; damaged ones are removed and count as absent.
    pub fn get(&self, digest: &Digest) -> Option<Arc<[u8]>> {
        for path in self.paths(BLOBS, digest, "") {
            let Some(bytes) = self.read_if_present(&path) else { continue };
            if Digest::of(&bytes) == *digest {
                return Some(bytes.into());
            }
            self.drop_damaged(&path);
        }
        None
    }

    /// Does what [`Store::get`] does, and does not hash a file again that is as it was: for bytes that many ask for, and that each of
    /// them checks.
    pub fn get_again(&self, digest: &Digest) -> Option<Arc<[u8]>> {
        let paths = self.paths(BLOBS, digest, "");
        let facts = paths.iter().find_map(|path| Some((path, self.fs.facts(path).ok()?)));
        if let Some((path, facts)) = facts
            && lock(&self.hashed).get(path) == Some(&facts)
            && let Some(bytes) = self.read_if_present(path)
            && bytes.len() as u64 == facts.bytes
        {
            return Some(bytes.into());
        }
        let bytes = self.get(digest)?;
        let mut hashed = lock(&self.hashed);
        if hashed.len() >= HASHED_MAX {
            hashed.clear();
        }
        hashed.extend(facts.map(|(path, facts)| (path.clone(), facts)));
        Some(bytes)
    }

    /// Whether a blob of this name and length is there (its content is checked when it is read).
    pub fn contains(&self, digest: &Digest, bytes: u64) -> bool {
        self.paths(BLOBS, digest, "").iter().any(|path| match self.fs.facts(path) {
            Ok(facts) if facts.bytes == bytes && !lock(&self.useless).contains(path) => {
                self.mark_used(path, facts);
                true
            }
            Ok(_) | Err(_) => false,
        })
    }

    /// Whether everything that an action made is there.
    pub(crate) fn has_outputs(&self, record: &ActionRecord) -> bool {
        record.result.outputs.iter().all(|output| self.contains(&output.digest, output.bytes))
    }

    /// The record of the action with this key. What it made may be gone.
    pub fn record(&self, key: &Digest) -> Option<ActionRecord> {
        let record: Option<ActionRecord> = self.read_document(&self.paths(RECORDS, key, ".json"));
        record.filter(|record| record.key() == *key)
    }

    /// How many damaged files were dropped since the store was opened.
    pub fn damaged_count(&self) -> usize {
        self.damaged.load(Ordering::Relaxed)
    }

    /// How many bytes were written since the store was opened.
    pub fn written_bytes(&self) -> u64 {
        self.written_bytes.load(Ordering::Relaxed)
    }

    pub(crate) fn forget_written(&self) {
        self.written_bytes.store(0, Ordering::Relaxed);
    }

    /// Reads a list of earlier scans.
    pub(crate) fn scans<T: DeserializeOwned + Default>(&self, key: &Digest) -> T {
        self.read_document(&self.paths(SCANS, key, ".json")).unwrap_or_default()
    }

    pub(crate) fn put_scans<T: Serialize>(&self, key: &Digest, scans: &T) -> Result<(), Error> {
        self.write_document(&self.new_path(SCANS, key, ".json"), scans)
    }

    /// Reads a document of a project; one that is damaged counts as absent.
    pub(crate) fn project_document<T: DeserializeOwned>(&self, project: &Digest, name: &str) -> Option<T> {
        let below = Path::new(PROJECTS).join(project.to_string()).join(name);
        let paths: Vec<PathBuf> = self.roots().map(|root| root.join(&below)).collect();
        self.read_document(&paths)
    }

    /// Writes a document of a project, unless it is there as it is; returns whether it was written.
    pub(crate) fn put_project_document<T: Serialize>(
        &self,
        project: &Digest,
        name: &str,
        value: &T,
    ) -> Result<bool, Error> {
        let path = self.write_root().join(PROJECTS).join(project.to_string()).join(name);
        let bytes = document::encode(&path, value)?;
        if let Ok(facts) = self.fs.facts(&path)
            && facts.bytes == bytes.len() as u64
            && self.fs.read(&path).is_ok_and(|known| known == bytes)
        {
            self.mark_used(&path, facts);
            return Ok(false);
        }
        write_all_atomically(&*self.fs, &[(path, &bytes)])?;
        Ok(true)
    }

    /// A file of a project that is locked for as long as the returned handle lives; `None` where that cannot be done.
    pub(crate) fn lock_project(&self, project: &Digest, name: &str) -> Option<File> {
        let folder = self.write_root().join(PROJECTS).join(project.to_string());
        self.fs.create_folder(&folder).ok()?;
        let file =
            OpenOptions::new().write(true).create(true).truncate(false).open(folder.join(name)).ok()?;
        file.lock().ok()?;
        Some(file)
    }

    fn read_document<T: DeserializeOwned>(&self, paths: &[PathBuf]) -> Option<T> {
        for path in paths {
            let Some(bytes) = self.read_if_present(path) else { continue };
            match document::decode(path, &bytes) {
                Some(document) => {
                    if let Ok(facts) = self.fs.facts(path) {
                        self.mark_used(path, facts);
                    }
                    return Some(document);
                }
                None => self.drop_damaged(path),
            }
        }
        None
    }

    /// Writes what only saves time.
    fn write_document<T: Serialize>(&self, path: &PathBuf, value: &T) -> Result<(), Error> {
        let bytes = document::encode(path, value)?;
        write_unsynced(&*self.fs, path, &bytes)?;
        self.note_written([(path, bytes.len())]);
        Ok(())
    }

    fn roots(&self) -> impl Iterator<Item = &Path> {
        self.scratch.iter().map(tempfile::TempDir::path).chain([self.root.as_path()])
    }

    fn write_root(&self) -> &Path {
        self.scratch.as_ref().map_or(&self.root, tempfile::TempDir::path)
    }

    fn new_path(&self, folder: &str, digest: &Digest, suffix: &str) -> PathBuf {
        file_of(self.write_root(), folder, digest, suffix)
    }

    /// Where a file may be, the first place first.
    fn paths(&self, folder: &str, digest: &Digest, suffix: &str) -> Vec<PathBuf> {
        self.roots().map(|root| file_of(root, folder, digest, suffix)).collect()
    }

    fn mark_used(&self, path: &Path, facts: FileFacts) {
        // A mark in the future is a clock's mistake and would never grow old.
        if SystemTime::now().duration_since(facts.modified).map_or(true, |age| age > USE_MARK_AGE) {
            // A read-only cache keeps no marks.
            let _ = self.fs.touch(path);
        }
    }

    /// Removes what fails its check; what cannot be removed is not looked at again.
    pub(crate) fn drop_damaged(&self, path: &Path) {
        self.damaged.fetch_add(1, Ordering::Relaxed);
        if self.fs.remove(path).is_err() {
            lock(&self.useless).insert(path.to_owned());
        }
    }

    /// A file that is there and cannot be read is no better than an absent one, and stays: the fault may pass.
    fn read_if_present(&self, path: &Path) -> Option<Vec<u8>> {
        if lock(&self.useless).contains(path) {
            return None;
        }
        match self.fs.read(path) {
            Ok(bytes) => Some(bytes),
            Err(error) => {
                if error.kind() != io::ErrorKind::NotFound {
                    self.damaged.fetch_add(1, Ordering::Relaxed);
                    lock(&self.useless).insert(path.to_owned());
                }
                None
            }
        }
    }
}

fn prepare(fs: &dyn FileSystem, root: &Path) -> io::Result<()> {
    [BLOBS, RECORDS, SCANS, PROJECTS].iter().try_for_each(|folder| fs.create_folder(&root.join(folder)))?;
    // Folders that are there say nothing of whether files can be made in them.
    let probe = root.join(temporary_name());
    fs.write_new(&probe, b"")?;
    fs.remove(&probe)
}

fn is_read_only(error: &io::Error) -> bool {
    use io::ErrorKind::{PermissionDenied, QuotaExceeded, ReadOnlyFilesystem, StorageFull};
    matches!(error.kind(), ReadOnlyFilesystem | PermissionDenied | StorageFull | QuotaExceeded)
}

fn file_of(root: &Path, folder: &str, digest: &Digest, suffix: &str) -> PathBuf {
    let name = digest.to_string();
    root.join(folder).join(&name[..2]).join(name + suffix)
}
