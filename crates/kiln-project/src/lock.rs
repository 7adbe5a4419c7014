//! `kiln.lock`: what Kiln chose where kiln.toml asks for a time and not for an error. It is kept under version control, so
//! that another machine, and CI, bake the same bytes: no clock decides a result twice.

use std::collections::BTreeMap;

use kiln_build::{Engine, Error};
use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::Project;
use crate::env_config::{EnvConfig, format_name};

/// Name of the file, beside kiln.toml.
pub const LOCK_FILE: &str = "kiln.lock";
const LOCK_VERSION: u32 = 1;
const HEADER: &str = "# What Kiln chose where kiln.toml asks for a time. Commit it: who bakes with it bakes the same bytes.\n\n";

/// The file as data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lock {
    version: u32,
    /// By name of the environment.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub env: BTreeMap<String, LockedEnv>,
}

/// What was chosen for an environment, and what for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LockedEnv {
    /// Digests of its source files.
    pub source: Vec<String>,
    /// What was asked for, in milliseconds.
    pub time_ms: f64,
    /// The error that maps are baked with.
    pub error: f64,
    /// Edge of the chains' first level.
    pub size: usize,
    /// Texel format.
    pub format: String,
    /// How maps are made.
    pub method: String,
    /// Highest degree of the harmonics.
    pub band_limit: usize,
    /// Texels that are convolved directly.
    pub bright_texels: usize,
}

impl Default for Lock {
    fn default() -> Self {
        Lock { version: LOCK_VERSION, env: BTreeMap::new() }
    }
}

impl Lock {
    /// The project's lock; empty if there is none. Complaints about one that cannot be read go to `diagnostics`.
    pub fn read(engine: &Engine, diagnostics: &mut Vec<Diagnostic>) -> Lock {
        let Some(bytes) = engine.sources().read(LOCK_FILE) else { return Lock::default() };
        let text = String::from_utf8_lossy(&bytes);
        let unreadable = |reason: String| {
            Diagnostic::error(format!("kiln.lock cannot be read: {reason}"))
                .in_file(LOCK_FILE)
                .with_help("take it from version control, or delete it: `kiln bake` chooses anew")
        };
        match toml::from_str::<Lock>(&text) {
            Ok(lock) if lock.version == LOCK_VERSION => lock,
            Ok(lock) => {
                diagnostics.push(unreadable(format!("it has version {}", lock.version)));
                Lock::default()
            }
            Err(error) => {
                diagnostics.push(unreadable(error.message().replace('\n', "; ")));
                Lock::default()
            }
        }
    }

    /// The file's text.
    pub fn to_text(&self) -> String {
        // A table of plain values.
        HEADER.to_owned() + &toml::to_string(self).unwrap_or_default()
    }

    /// Writes it beside kiln.toml.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, engine: &Engine) -> Result<(), Error> {
        let path = engine.folder().join(LOCK_FILE);
        kiln_build::write_atomically(&kiln_build::Disk, &path, self.to_text().as_bytes())
    }
}

/// Digests of an environment's files.
pub(crate) fn digests(engine: &Engine, env: &EnvConfig) -> Vec<String> {
    let digest = |path: &String| engine.source(path).digest().map_or_else(String::new, |it| it.to_string());
    env.sources.iter().map(digest).collect()
}

/// Gives environments that ask for a time what the lock says; the names of those of which it says nothing that still holds.
pub(crate) fn apply(
    engine: &Engine,
    project: &mut Project,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<String> {
    if project.envs.values().all(|env| env.time_ms.is_none()) {
        return Vec::new();
    }
    let lock = Lock::read(engine, diagnostics);
    let mut open = Vec::new();
    for (name, env) in &mut project.envs {
        let Some(time_ms) = env.time_ms else { continue };
        let known = lock.env.get(name).filter(|locked| {
            let size_fits = env.is_size_open || locked.size == env.size;
            locked.time_ms == time_ms && size_fits && locked.format == format_name(env.format)
        });
        match known.filter(|locked| locked.source == digests(engine, env)) {
            Some(locked) if locked.size.is_power_of_two() && locked.error > 0.0 => {
                (env.error, env.size) = (locked.error, locked.size);
            }
            _ => open.push(name.clone()),
        }
    }
    open
}
