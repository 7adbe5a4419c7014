//! Store, sources and memory of one project together.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::digest::FieldHasher;
use crate::sources::lock;
use crate::store::write_json;
use crate::{Digest, Error, ProjectState, SourceState, SourceTree, Store, Targets};

/// How many earlier results of a scan are kept, so that a reverted edit finds its old one.
const SCAN_RESULTS_KEPT: usize = 8;

/// The engine of one project.
#[derive(Debug)]
pub struct Engine {
    store: Store,
    sources: SourceTree,
    state: Mutex<ProjectState>,
    folder: PathBuf,
}

/// What a scan found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    /// Every source it looked at, in order, with the content it had (`None`: missing or unreadable).
    pub looked_at: Vec<(String, Option<Digest>)>,
    /// What it found out.
    pub found: Value,
    /// What the user should know.
    pub diagnostics: Vec<Diagnostic>,
}

/// The eyes of a running scan: notes every source that is looked at.
pub struct Tracker<'a> {
    sources: &'a SourceTree,
    looked_at: Vec<(String, Option<Digest>)>,
}

impl Tracker<'_> {
    /// The bytes at `path`, or `None` if there is no readable file; either way it becomes a dependency.
    pub fn read(&mut self, path: &str) -> Option<std::sync::Arc<[u8]>> {
        let bytes = self.sources.read(path);
        let digest = bytes.as_deref().map(Digest::of);
        if !self.looked_at.iter().any(|(known, _)| known == path) {
            self.looked_at.push((path.to_owned(), digest));
        }
        bytes
    }
}

impl Engine {
    /// Opens the project in `folder` with the store below `cache`.
    pub fn open(folder: &Path, cache: &Path) -> Result<Engine, Error> {
        let folder = folder.canonicalize().map_err(Error::io("find the folder", folder))?;
        let store = Store::open(cache)?;
        let state = ProjectState::load(&store, &folder)?;
        let sources = SourceTree::new(folder.clone(), state.stamps.clone());
        Ok(Engine { store, sources, state: Mutex::new(state), folder })
    }

    /// The artefacts.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The project's files.
    pub fn sources(&self) -> &SourceTree {
        &self.sources
    }

    /// The project's folder, canonical.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What was published last.
    pub fn last_targets(&self) -> Targets {
        lock(&self.state).targets.clone()
    }

    /// Keeps what is published now, and the engine's own memory, for the next process.
    pub fn save(&self, targets: Targets) -> Result<(), Error> {
        let mut state = lock(&self.state);
        let stamps = self.sources.stamps();
        if state.targets == targets && state.stamps == stamps && !state.dirty {
            return Ok(());
        }
        state.targets = targets;
        state.stamps = stamps;
        state.dirty = false;
        state.save(&self.store, &self.folder)
    }

    /// The key under which the action called `name` was last settled.
    pub(crate) fn last_key(&self, name: &str) -> Option<Digest> {
        lock(&self.state).actions.get(name).copied()
    }

    pub(crate) fn remember_key(&self, name: &str, key: Digest) {
        let mut state = lock(&self.state);
        if state.actions.insert(name.to_owned(), key) != Some(key) {
            state.dirty = true;
        }
    }

    /// Finds out what a source depends on: `look` reads through the tracker, and its result is reused as long as
    /// every file it looked at, the missing ones too, is as it was.
    pub fn scan(
        &self,
        kind: &str,
        recipe: u32,
        root: &str,
        look: impl FnOnce(&mut Tracker) -> (Value, Vec<Diagnostic>),
    ) -> Result<Scan, Error> {
        let mut hasher = FieldHasher::default();
        hasher.field("kind", kind.as_bytes());
        hasher.field("recipe", &recipe.to_le_bytes());
        hasher.field("root", root.as_bytes());
        let path = self.store.scan_path(&hasher.finish());
        let mut known: Vec<Scan> = self.store.read_json(&path)?.unwrap_or_default();
        if let Some(scan) = known.iter().find(|scan| self.still_holds(scan)) {
            return Ok(scan.clone());
        }
        let mut tracker = Tracker { sources: &self.sources, looked_at: Vec::new() };
        let (found, diagnostics) = look(&mut tracker);
        let scan = Scan { looked_at: tracker.looked_at, found, diagnostics };
        known.insert(0, scan.clone());
        known.truncate(SCAN_RESULTS_KEPT);
        write_json(&path, &known)?;
        Ok(scan)
    }

    fn still_holds(&self, scan: &Scan) -> bool {
        scan.looked_at.iter().all(|(path, digest)| self.sources.state(path).digest() == *digest)
    }

    /// What is at a source path, for planning.
    pub fn source(&self, path: &str) -> SourceState {
        self.sources.state(path)
    }
}
