//! Where things are on this machine.

use std::path::{Path, PathBuf};

use anyhow::bail;

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

/// Worker threads: as asked, else one for each core.
pub(crate) fn jobs(asked: Option<usize>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    asked.unwrap_or_else(cores).max(1)
}

/// The socket of the project in `dir`.
#[cfg(feature = "preview")]
pub(crate) fn socket_of(dir: &Path) -> anyhow::Result<PathBuf> {
    use anyhow::Context as _;
    kiln_link::socket_path(&project_folder(dir)?).context("finding the project's socket")
}

/// What was asked for cannot be done: the request is wrong, not the tool.
#[derive(Debug)]
pub(crate) struct WrongInput(String);

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

/// Whether a window could be opened.
#[cfg(feature = "preview")]
pub(crate) fn has_display() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    cfg!(any(windows, target_os = "macos")) || set("DISPLAY") || set("WAYLAND_DISPLAY")
}
