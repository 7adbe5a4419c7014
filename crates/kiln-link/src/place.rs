//! Where a project's daemon is found, and the lock that keeps it the only one.

use std::fs;
use std::io::{Read as _, Seek as _, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use kiln_build::Digest;
use rustix::fs::FlockOperation;

/// A daemon that is just ending, or somebody who looks whether it has, is waited for as long as this.
const GOING: Duration = Duration::from_millis(100);

/// The socket of the project in `folder` (canonical): a hashed name in a folder that only this user can enter.
///
/// # Errors
/// The folder cannot be made, or it belongs to somebody else.
pub fn socket_path(folder: &Path) -> std::io::Result<PathBuf> {
    let name = Digest::of(folder.as_os_str().as_encoded_bytes()).to_string();
    Ok(private_folder()?.join(format!("{}.sock", &name[..16])))
}

fn private_folder() -> std::io::Result<PathBuf> {
    let user = rustix::process::geteuid().as_raw();
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|path| Path::new(path).is_dir());
    let folder = match runtime {
        Some(runtime) => PathBuf::from(runtime).join("kiln"),
        None => std::env::temp_dir().join(format!("kiln-{user}")),
    };
    match fs::DirBuilder::new().mode(0o700).create(&folder) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let metadata = fs::symlink_metadata(&folder)?;
    if metadata.is_dir() && metadata.uid() == user && metadata.mode() & 0o077 == 0 {
        return Ok(folder);
    }
    let reason = format!("{} must be a folder of yours with mode 0700", folder.display());
    Err(std::io::Error::new(std::io::ErrorKind::PermissionDenied, reason))
}

/// Held by the daemon of a project for as long as it lives; the system frees it when the process ends,
/// however it ends.
#[derive(Debug)]
pub struct ProjectLock {
    _file: fs::File,
}

/// Why a project could not be locked.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another daemon serves it.
    #[error(
        "process {pid} already watches this project; connect to it with `kiln preview`, or end it with `kiln stop`"
    )]
    Held {
        /// The other daemon.
        pid: String,
    },
    /// The lock file cannot be used.
    #[error("cannot lock {}: {source}", path.display())]
    Io {
        /// The lock file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

impl ProjectLock {
    /// Takes the lock beside `socket`.
    pub fn take(socket: &Path) -> Result<ProjectLock, LockError> {
        let path = socket.with_extension("lock");
        let io = |source| LockError::Io { path: path.clone(), source };
        let mut options = fs::OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let mut file = options.open(&path).map_err(io)?;
        match flock_soon(&file, FlockOperation::NonBlockingLockExclusive, Instant::now() + GOING) {
            Ok(()) => {}
            Err(rustix::io::Errno::WOULDBLOCK) => {
                let mut pid = String::new();
                file.read_to_string(&mut pid).map_err(io)?;
                return Err(LockError::Held { pid: pid.trim().to_owned() });
            }
            Err(error) => return Err(io(error.into())),
        }
        file.set_len(0).and_then(|()| file.rewind()).map_err(io)?;
        writeln!(file, "{}", std::process::id()).map_err(io)?;
        Ok(ProjectLock { _file: file })
    }

    /// Waits until nobody holds the lock beside `socket`; says whether that came about in time.
    pub(crate) fn wait_until_free(socket: &Path, deadline: Instant) -> bool {
        match fs::File::open(socket.with_extension("lock")) {
            Ok(file) => flock_soon(&file, FlockOperation::NonBlockingLockShared, deadline).is_ok(),
            Err(error) => error.kind() == std::io::ErrorKind::NotFound,
        }
    }
}

/// Tries again until the deadline: `flock` itself knows none.
fn flock_soon(file: &fs::File, operation: FlockOperation, deadline: Instant) -> rustix::io::Result<()> {
    loop {
        match rustix::fs::flock(file, operation) {
            Err(rustix::io::Errno::WOULDBLOCK) if Instant::now() < deadline => {
                std::thread::sleep(Duration::from_millis(5));
            }
            result => return result,
        }
    }
}
