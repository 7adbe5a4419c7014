//! Where things are on this machine.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context as _, bail};
use kiln_build::{Engine, Progress, RunOptions, Store};

use crate::args::BuildArgs;

/// The store: `KILN_CACHE`, or `kiln` in the user's cache folder.
pub(crate) fn cache_folder() -> anyhow::Result<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if let Some(cache) = variable("KILN_CACHE") {
        return Ok(cache);
    }
    let Some(home) = variable("HOME") else {
        bail!("neither KILN_CACHE nor HOME is set: no place for the cache")
    };
    let default = if cfg!(target_os = "macos") { home.join("Library/Caches") } else { home.join(".cache") };
    Ok(variable("XDG_CACHE_HOME").filter(|path| path.is_absolute()).unwrap_or(default).join("kiln"))
}

/// This program, for starting it again. On Linux that works when the file was replaced, as by a build.
pub(crate) fn this_program() -> PathBuf {
    let own = Path::new("/proc/self/exe");
    if own.exists() { own.to_owned() } else { std::env::current_exe().unwrap_or_else(|_| "kiln".into()) }
}

/// Worker threads: as asked, else one for each core.
pub(crate) fn jobs(asked: Option<usize>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    asked.unwrap_or_else(cores).max(1)
}

/// The store of this user.
pub(crate) fn open_store() -> anyhow::Result<Store> {
    let cache = cache_folder()?;
    let store = Store::open(&cache).context("opening the cache")?;
    if store.is_read_only() {
        eprintln!(
            "warning: the cache {} cannot be written; it is read, and nothing new is kept",
            cache.display()
        );
    }
    Ok(store)
}

/// The engine of the project in `dir`.
pub(crate) fn open_engine(dir: &Path) -> anyhow::Result<Engine> {
    let folder = project_folder(dir)?;
    Engine::open(&folder, open_store()?).context("opening the project")
}

/// What the cache may hold besides what is published: `KILN_CACHE_MAX`, else 16 GiB.
pub(crate) fn cache_bytes_max() -> anyhow::Result<u64> {
    let Some(text) = std::env::var_os("KILN_CACHE_MAX").filter(|value| !value.is_empty()) else {
        return Ok(16 << 30);
    };
    let bytes = text.to_str().and_then(kiln_project::parse_bytes);
    bytes.ok_or_else(|| {
        WrongInput(format!("KILN_CACHE_MAX is {text:?}, which is no size; write it as 20GiB")).into()
    })
}

/// What actions may take together: as asked, else three quarters of what is free.
pub(crate) fn memory_bytes(asked: Option<u64>) -> u64 {
    /// Where the system does not tell.
    const USUAL: u64 = 4 << 30;
    asked.unwrap_or_else(|| free_memory_bytes().map_or(USUAL, |free| free / 4 * 3))
}

/// How to run actions, as the command line asks.
pub(crate) fn run_options<'a>(
    args: &BuildArgs,
    keep_going: bool,
    cancel: &'a AtomicBool,
    progress: &'a (dyn Fn(Progress) + Sync),
) -> RunOptions<'a> {
    RunOptions {
        jobs: jobs(args.jobs),
        memory_bytes: memory_bytes(args.memory),
        keep_going,
        cancel,
        progress,
    }
}

/// Free memory, within the limit of this process's control group.
fn free_memory_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let free = line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024;
    let limit = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let limit = limit.and_then(|limit| limit.trim().parse::<u64>().ok()).unwrap_or(u64::MAX);
    Some(free.min(limit))
}

/// The socket of the project in `dir`.
pub(crate) fn socket_of(dir: &Path) -> anyhow::Result<PathBuf> {
    kiln_link::socket_path(&project_folder(dir)?).context("finding the project's socket")
}

/// What was asked for cannot be done: the request is wrong, not the tool.
#[derive(Debug)]
pub(crate) struct WrongInput(pub(crate) String);

impl std::fmt::Display for WrongInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for WrongInput {}

/// The canonical folder of a project.
pub(crate) fn project_folder(dir: &Path) -> anyhow::Result<PathBuf> {
    let folder = dir.canonicalize().ok().filter(|folder| folder.join(kiln_project::PROJECT_FILE).is_file());
    folder.ok_or_else(|| {
        let dir = dir.display();
        let what = format!(
            "there is no kiln.toml in {dir}\n  help: `kiln init {dir}` makes a project that runs as it is"
        );
        WrongInput(what).into()
    })
}

/// Where the window of the project in the canonical `folder` remembers how it was; `None` where the user has no such place.
#[cfg(feature = "preview")]
pub(crate) fn window_state_file(folder: &Path) -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = variable("XDG_STATE_HOME").or_else(|| Some(variable("HOME")?.join(".local/state")))?;
    let name = kiln_build::Digest::of(folder.as_os_str().as_encoded_bytes()).to_string();
    Some(state.join("kiln/windows").join(format!("{}.json", &name[..16])))
}

/// Whether a window could be opened.
#[cfg(feature = "preview")]
pub(crate) fn has_display() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    cfg!(any(windows, target_os = "macos")) || set("DISPLAY") || set("WAYLAND_DISPLAY")
}
