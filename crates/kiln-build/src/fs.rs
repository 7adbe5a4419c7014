//! The file operations of a store, as a trait so that tests can make every single one of them fail.

use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

use crate::Error;

/// Start of the name of a file that is not yet what it will be.
pub(crate) const TEMPORARY_PREFIX: &str = ".kiln-";

/// What `stat` says of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileFacts {
    /// Its length.
    pub bytes: u64,
    /// When it was written, or last marked as used.
    pub modified: SystemTime,
}

/// Everything a store does with files.
pub trait FileSystem: fmt::Debug + Send + Sync {
    /// The whole of a file.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>>;
    /// Length and time of a file.
    fn facts(&self, path: &Path) -> io::Result<FileFacts>;
    /// Paths of everything in a folder.
    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>>;
    /// Creates a folder and those above it.
    fn create_folder(&self, folder: &Path) -> io::Result<()>;
    /// Creates a file that is not there yet; not durable before [`FileSystem::sync`].
    fn write_new(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;
    /// Returns when a file's content would survive a power failure.
    fn sync(&self, path: &Path) -> io::Result<()>;
    /// Gives a file another name, replacing what had it.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Returns when the names in a folder would survive a power failure.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove(&self, path: &Path) -> io::Result<()>;
    /// Marks a file as used now.
    fn touch(&self, path: &Path) -> io::Result<()>;
}

/// The file system of this machine.
#[derive(Clone, Copy, Debug)]
pub struct Disk;

impl FileSystem for Disk {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        fs::read(path)
    }

    fn facts(&self, path: &Path) -> io::Result<FileFacts> {
        let metadata = fs::metadata(path)?;
        if !metadata.is_file() {
            return Err(io::Error::other("it is not a file"));
        }
        Ok(FileFacts { bytes: metadata.len(), modified: metadata.modified()? })
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
    }

    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)
    }

    fn write_new(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        OpenOptions::new().write(true).create_new(true).open(path)?.write_all(bytes)
    }

    fn sync(&self, path: &Path) -> io::Result<()> {
        OpenOptions::new().write(true).open(path)?.sync_data()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    #[cfg(unix)]
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        File::open(folder)?.sync_all()
    }

    /// Windows has no such call; its journal orders the rename after the data that was synced.
    #[cfg(not(unix))]
    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        File::options().write(true).open(path)?.set_modified(SystemTime::now())
    }
}

/// Writes a file whole, so that a reader, and whoever comes after a crash, sees the old content or the new one:
/// temporary name in the same folder, sync, rename, sync of the folder. Creates the folder.
///
/// # Errors
/// One of the steps failed; the old content stands, and the temporary file is removed if that is possible.
pub fn write_atomically(fs: &dyn FileSystem, path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_all_atomically(fs, &[(path.to_owned(), bytes)])
}

/// [`write_atomically`] for several files in this order, with one sync for each folder.
pub(crate) fn write_all_atomically(fs: &dyn FileSystem, files: &[(PathBuf, &[u8])]) -> Result<(), Error> {
    let mut folders: Vec<&Path> = Vec::new();
    for (path, bytes) in files {
        replace(fs, path, bytes, Durability::Synced)?;
        let folder = folder_of(path);
        if !folders.contains(&folder) {
            folders.push(folder);
        }
    }
    folders
        .into_iter()
        .try_for_each(|folder| fs.sync_folder(folder).map_err(Error::io("sync the folder", folder)))
}

/// Writes a file whole, so that a reader sees the old content or the new one. What a power failure leaves of it may be
/// neither: only for files that are checked when they are read, and whose loss costs nothing but time.
pub(crate) fn write_unsynced(fs: &dyn FileSystem, path: &Path, bytes: &[u8]) -> Result<(), Error> {
    replace(fs, path, bytes, Durability::Unsynced)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Durability {
    Synced,
    Unsynced,
}

fn replace(fs: &dyn FileSystem, path: &Path, bytes: &[u8], durability: Durability) -> Result<(), Error> {
    let folder = folder_of(path);
    let temporary = folder.join(temporary_name());
    let result = write_temporary(fs, folder, &temporary, bytes, durability)
        .and_then(|()| fs.rename(&temporary, path).map_err(Error::io("rename to", path)));
    if result.is_err() {
        // What cannot be removed now is collected later.
        let _ = fs.remove(&temporary);
    }
    result
}

fn write_temporary(
    fs: &dyn FileSystem,
    folder: &Path,
    temporary: &Path,
    bytes: &[u8],
    durability: Durability,
) -> Result<(), Error> {
    // Folders are there nearly always: asking first would cost more than trying.
    let written = fs.write_new(temporary, bytes).or_else(|error| match error.kind() {
        io::ErrorKind::NotFound => {
            fs.create_folder(folder)?;
            if durability == Durability::Synced {
                // The new folder's own name must last, too.
                fs.sync_folder(folder_of(folder))?;
            }
            fs.write_new(temporary, bytes)
        }
        _ => Err(error),
    });
    written.map_err(Error::io("write", temporary))?;
    match durability {
        Durability::Synced => fs.sync(temporary).map_err(Error::io("sync", temporary)),
        Durability::Unsynced => Ok(()),
    }
}

/// The folder of a file; of a bare name the present one.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Unique among the processes and machines that share a folder.
pub(crate) fn temporary_name() -> String {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let chance = RandomState::new().hash_one(SystemTime::now());
    format!("{TEMPORARY_PREFIX}{}-{}-{chance:016x}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}
