//! Content-addressed bytes and action records, as plain files.
//!
//! ```text
//! ROOT/v1/cas/ab/abcd…          the bytes whose SHA-256 is abcd…
//! ROOT/v1/actions/ab/abcd….json the record of the action with that key
//! ROOT/v1/scans/ab/abcd….json   what a scan found, with the states of the files it looked at
//! ROOT/v1/projects/abcd….json   per project: source stamps, last good targets
//! ```
//!
//! Every file is written whole under a temporary name, synced and renamed, so that a killed process leaves
//! either the old file or the new one. Everything is checked when read: a blob against its name, a record
//! by parsing it; what fails the check is dropped and counts as absent.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::{ActionRecord, Digest};

/// The tool could not do its work; the input is not to blame.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file operation failed.
    #[error("cannot {operation} {}: {source}", path.display())]
    Io {
        /// As `write`.
        operation: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// An action failed for a reason that is not its input.
    #[error("action `{action}` failed: {reason}")]
    Action {
        /// Its name.
        action: String,
        /// What happened.
        reason: String,
    },
}

impl Error {
    pub(crate) fn io(operation: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.to_owned();
        move |source| Error::Io { operation, path, source }
    }
}

/// Artefacts by digest, and the record of which action made what.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    damaged: AtomicUsize,
}

impl Store {
    /// Opens or creates the store below `root`.
    pub fn open(root: &Path) -> Result<Store, Error> {
        let root = root.join("v1");
        for folder in ["cas", "actions", "scans", "projects"] {
            let folder = root.join(folder);
            fs::create_dir_all(&folder).map_err(Error::io("create the folder", &folder))?;
        }
        Ok(Store { root, damaged: AtomicUsize::new(0) })
    }

    /// Keeps `bytes` and returns their name.
    pub fn put(&self, bytes: &[u8]) -> Result<Digest, Error> {
        let digest = Digest::of(bytes);
        let path = self.path("cas", &digest, "");
        let present = fs::metadata(&path).is_ok_and(|metadata| metadata.len() == bytes.len() as u64);
        if !present {
            write_atomically(&path, bytes)?;
        }
        Ok(digest)
    }

    /// The bytes named `digest`, or `None` if they are absent; damaged ones are removed and count as absent.
    pub fn get(&self, digest: &Digest) -> Result<Option<Arc<[u8]>>, Error> {
        let path = self.path("cas", digest, "");
        let Some(bytes) = read_if_present(&path)? else { return Ok(None) };
        if Digest::of(&bytes) == *digest {
            return Ok(Some(bytes.into()));
        }
        self.drop_damaged(&path);
        Ok(None)
    }

    /// Whether a blob of this name and length is there (its content is checked when it is read).
    pub fn contains(&self, digest: &Digest, bytes: u64) -> bool {
        fs::metadata(self.path("cas", digest, "")).is_ok_and(|metadata| metadata.len() == bytes)
    }

    /// The record of the action with this key, if all it made is still there.
    pub fn record(&self, key: &Digest) -> Result<Option<ActionRecord>, Error> {
        let Some(record) = self.record_of_past(key)? else { return Ok(None) };
        let complete = record.outputs.iter().all(|output| self.contains(&output.digest, output.bytes));
        Ok((complete && record.key() == *key).then_some(record))
    }

    /// The same, even if what it made is gone: for explanations only.
    pub(crate) fn record_of_past(&self, key: &Digest) -> Result<Option<ActionRecord>, Error> {
        self.read_json(&self.path("actions", key, ".json"))
    }

    /// Keeps an action's record under its key.
    pub fn put_record(&self, record: &ActionRecord) -> Result<(), Error> {
        write_json(&self.path("actions", &record.key(), ".json"), record)
    }

    /// How many damaged files were dropped since the store was opened.
    pub fn damaged_count(&self) -> usize {
        self.damaged.load(Ordering::Relaxed)
    }

    pub(crate) fn scan_path(&self, key: &Digest) -> PathBuf {
        self.path("scans", key, ".json")
    }

    pub(crate) fn project_path(&self, key: &Digest) -> PathBuf {
        self.root.join("projects").join(format!("{key}.json"))
    }

    pub(crate) fn read_json<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<T>, Error> {
        let Some(bytes) = read_if_present(path)? else { return Ok(None) };
        let parsed = serde_json::from_slice(&bytes).ok();
        if parsed.is_none() {
            self.drop_damaged(path);
        }
        Ok(parsed)
    }

    fn path(&self, folder: &str, digest: &Digest, suffix: &str) -> PathBuf {
        let name = digest.to_string();
        self.root.join(folder).join(&name[..2]).join(format!("{name}{suffix}"))
    }

    fn drop_damaged(&self, path: &Path) {
        self.damaged.fetch_add(1, Ordering::Relaxed);
        // A read-only cache cannot drop it; the file stays and stays ignored.
        let _ = fs::remove_file(path);
    }
}

fn read_if_present(path: &Path) -> Result<Option<Vec<u8>>, Error> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::io("read", path)(error)),
    }
}

pub(crate) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), Error> {
    let text = serde_json::to_vec(value).map_err(|error| Error::Io {
        operation: "encode",
        path: path.to_owned(),
        source: error.into(),
    })?;
    write_atomically(path, &text)
}

/// Writes a file whole: temporary name in the same folder, sync, rename. Creates the folder.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
    let mut file = tempfile::Builder::new()
        .prefix(".kiln-")
        .tempfile_in(folder)
        .map_err(Error::io("create a temporary file in", folder))?;
    file.write_all(bytes).map_err(Error::io("write", path))?;
    file.as_file().sync_data().map_err(Error::io("sync", path))?;
    set_ordinary_mode(file.as_file()).map_err(Error::io("set the mode of", path))?;
    file.persist(path).map_err(|error| Error::io("rename to", path)(error.error))?;
    Ok(())
}

/// Temporary files are private; what they become is for everybody whom the user's umask lets in.
#[cfg(unix)]
fn set_ordinary_mode(file: &fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    file.set_permissions(fs::Permissions::from_mode(0o666 & !umask()))
}

#[cfg(not(unix))]
fn set_ordinary_mode(_: &fs::File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(unix)]
fn umask() -> u32 {
    // Reading the mask means setting it; doing so once keeps the window small.
    static UMASK: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    *UMASK.get_or_init(|| {
        let mask = rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
        rustix::process::umask(mask);
        mask.as_raw_mode()
    })
}
