//! Store, sources and memory of one project together.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::digest::FieldHasher;
use crate::memory::{Memory, ScanMemory};
use crate::sources::lock;
use crate::{
    ActionRecord, BuildNote, ChangeNote, Digest, Error, FilesOfTarget, Graph, SourceState, SourceTree, Store,
    Target, Targets,
};

/// How many results of a scan are kept for one content of its root: its other files may have been edited and put back.
const SCAN_RESULTS_KEPT: usize = 8;
const MEMORY_FILE: &str = "memory.json";
pub(crate) const PUBLISHED_FILE: &str = "published.json";
const MEMORY_LOCK_FILE: &str = "memory.lock";

/// The engine of one project.
#[derive(Debug)]
pub struct Engine {
    store: Store,
    sources: SourceTree,
    outputs: SourceTree,
    memory: Mutex<Memory>,
    /// Read when it is needed first.
    published: Mutex<Option<Arc<Targets>>>,
    folder: PathBuf,
    /// Names the project in the store.
    project: Digest,
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

/// What a project published last, and whose it is.
#[derive(Serialize, Deserialize)]
pub(crate) struct Published<'a> {
    pub(crate) host: String,
    /// Its folder, exactly: the bytes of the path, as few of them are no UTF-8.
    #[serde(with = "exact_path")]
    pub(crate) folder: PathBuf,
    pub(crate) targets: Cow<'a, Targets>,
}

/// The eyes of a running scan: notes every source that is looked at.
pub struct Tracker<'a> {
    sources: &'a SourceTree,
    looked_at: Vec<(String, Option<Digest>)>,
}

impl Tracker<'_> {
    /// The bytes at `path`, or `None` if there is no readable file; either way it becomes a dependency.
    pub fn read(&mut self, path: &str) -> Option<Arc<[u8]>> {
        let bytes = self.sources.read(path);
        let digest = bytes.as_deref().map(Digest::of);
        if !self.looked_at.iter().any(|(known, _)| known == path) {
            self.looked_at.push((path.to_owned(), digest));
        }
        bytes
    }
}

impl Engine {
    /// Opens the project in `folder` with a store.
    ///
    /// # Errors
    /// The folder cannot be found.
    pub fn open(folder: &Path, store: Store) -> Result<Engine, Error> {
        let folder = folder.canonicalize().map_err(Error::io("find the folder", folder))?;
        let project = Digest::of(folder.as_os_str().as_encoded_bytes());
        let mut memory: Memory = store.project_document(&project, MEMORY_FILE).unwrap_or_default();
        memory.read_build = memory.next_build() - 1;
        let sources = SourceTree::new(folder.clone(), memory.source_stamps.clone());
        let outputs = SourceTree::new(folder.clone(), memory.output_stamps.clone());
        let memory = Mutex::new(memory);
        Ok(Engine { store, sources, outputs, memory, published: Mutex::default(), folder, project })
    }

    /// The artefacts.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The project's files.
    pub fn sources(&self) -> &SourceTree {
        &self.sources
    }

    /// The files that builds wrote into the project's folder.
    pub fn outputs(&self) -> &SourceTree {
        &self.outputs
    }

    /// The project's folder, canonical.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What is at a source path, for planning.
    pub fn source(&self, path: &str) -> SourceState {
        self.sources.state(path)
    }

    /// What was published last: the last good content of every target. Some of it may be lost.
    pub fn published(&self) -> Arc<Targets> {
        let mut published = lock(&self.published);
        if let Some(targets) = &*published {
            return targets.clone();
        }
        let found: Option<Published> = self.store.project_document(&self.project, PUBLISHED_FILE);
        published.insert(Arc::new(found.map(|found| found.targets.into_owned()).unwrap_or_default())).clone()
    }

    /// A target of what was published last, if all its contents are there.
    pub fn last_good(&self, target: &str) -> Option<Target> {
        let published = self.published();
        let target = published.get(target)?;
        target.parts.iter().all(|part| self.store.contains(&part.digest, part.bytes)).then(|| target.clone())
    }

    /// Makes `targets` what is published. From here on no crash and no collection takes their contents.
    ///
    /// # Errors
    /// It cannot be written; then what was published before still is.
    pub fn publish(&self, targets: &Arc<Targets>) -> Result<(), Error> {
        let published = Published {
            host: crate::collect::host(),
            folder: self.folder.clone(),
            targets: Cow::Borrowed(&**targets),
        };
        self.store.put_project_document(&self.project, PUBLISHED_FILE, &published)?;
        *lock(&self.published) = Some(targets.clone());
        Ok(())
    }

    /// Keeps the engine's own memory for the next process, together with what others have noted meanwhile.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn save_memory(&self) -> Result<(), Error> {
        let mut memory = lock(&self.memory);
        let (sources, outputs) = (self.sources.stamps(), self.outputs.stamps());
        if !memory.is_changed && memory.source_stamps == sources && memory.output_stamps == outputs {
            return Ok(());
        }
        let _lock = self.store.lock_project(&self.project, MEMORY_LOCK_FILE);
        if let Some(theirs) = self.store.project_document(&self.project, MEMORY_FILE) {
            memory.merge(theirs);
        }
        memory.scans.retain(|_, scan| scan.is_asked);
        (memory.source_stamps, memory.output_stamps) = (sources, outputs);
        self.store.put_project_document(&self.project, MEMORY_FILE, &*memory)?;
        memory.is_changed = false;
        memory.read_build = memory.next_build() - 1;
        memory.own.clear();
        Ok(())
    }

    /// Which files were made of a target, if that was noted for this content and this maker.
    pub fn files_of(&self, name: &str, target: Digest, maker: u32) -> Option<FilesOfTarget> {
        let memory = lock(&self.memory);
        memory.files.get(name).filter(|known| known.target == target && known.maker == maker).cloned()
    }

    /// Notes which files were made of a target.
    pub fn note_files(&self, name: &str, files: FilesOfTarget) {
        let mut memory = lock(&self.memory);
        if memory.files.get(name) != Some(&files) {
            memory.files.insert(name.to_owned(), files);
            memory.is_changed = true;
        }
    }

    /// Begins a plan. `changed` names the sources that may be different since the last plan; `None` stands for all.
    pub fn begin_plan(&self, changed: Option<&[String]>) {
        let mut memory = lock(&self.memory);
        match changed {
            Some(paths) => self.sources.forget(paths),
            None => {
                self.sources.refresh();
                memory.actions.values_mut().for_each(|action| action.is_present = false);
            }
        }
        memory.scans.values_mut().for_each(|scan| scan.is_asked = false);
    }

    /// The builds that changed something, the newest last.
    pub fn builds(&self) -> Vec<BuildNote> {
        lock(&self.memory).builds.clone()
    }

    /// How the action of this name was last settled, and what was different then.
    pub fn history(&self, action: &str) -> Option<(Arc<ActionRecord>, ChangeNote)> {
        let memory = lock(&self.memory);
        let action = memory.actions.get(action)?;
        Some((action.record.clone(), action.change.clone()))
    }

    pub(crate) fn memory(&self) -> std::sync::MutexGuard<'_, Memory> {
        lock(&self.memory)
    }

    /// Forgets actions that are in no graph any more.
    pub(crate) fn forget_others(&self, graph: &Graph) {
        let mut memory = lock(&self.memory);
        if memory.actions.len() > graph.len() {
            let names: HashSet<&str> = graph.iter().map(|(_, action)| action.name.as_str()).collect();
            memory.actions.retain(|name, _| names.contains(name.as_str()));
            memory.is_changed = true;
        }
    }

    /// Finds out what a source depends on: `look` reads through the tracker, and its result is reused as long as
    /// every file it looked at, the missing ones too, is as it was.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn scan(
        &self,
        kind: &str,
        recipe: u32,
        root: &str,
        look: impl FnOnce(&mut Tracker) -> (Value, Vec<Diagnostic>),
    ) -> Result<Arc<Scan>, Error> {
        let name = format!("{kind} {recipe} {root}");
        let remembered = lock(&self.memory).scans.get(&name).map(|memory| memory.scan.clone());
        if let Some(scan) = remembered
            && self.still_holds(&scan)
        {
            if let Some(memory) = lock(&self.memory).scans.get_mut(&name) {
                memory.is_asked = true;
            }
            return Ok(scan);
        }
        let scan = Arc::new(self.shared_scan(kind, recipe, root, look)?);
        let mut memory = lock(&self.memory);
        memory.scans.insert(name, ScanMemory { scan: scan.clone(), is_asked: true });
        memory.is_changed = true;
        Ok(scan)
    }

    /// A scan that some project made of the same files, or a new one.
    fn shared_scan(
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
        let content = self.source(root).digest().map(|digest| digest.to_string());
        hasher.field("content", content.unwrap_or_default().as_bytes());
        let key = hasher.finish();
        let mut known: Vec<Scan> = self.store.scans(&key);
        if let Some(scan) = known.iter().find(|scan| self.still_holds(scan)) {
            return Ok(scan.clone());
        }
        let mut tracker = Tracker { sources: &self.sources, looked_at: Vec::new() };
        let (found, diagnostics) = look(&mut tracker);
        let scan = Scan { looked_at: tracker.looked_at, found, diagnostics };
        known.insert(0, scan.clone());
        known.truncate(SCAN_RESULTS_KEPT);
        self.store.put_scans(&key, &known)?;
        Ok(scan)
    }

    fn still_holds(&self, scan: &Scan) -> bool {
        scan.looked_at.iter().all(|(path, digest)| self.sources.is(path, *digest))
    }
}

/// A path as a text, in which whatever is no UTF-8 is escaped as `%XX`, and `%` itself.
mod exact_path {
    use std::path::{Path, PathBuf};

    use serde::{Deserialize as _, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
        let mut text = String::new();
        for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
            text += &chunk.valid().replace('%', "%25");
            chunk.invalid().iter().for_each(|byte| text += &format!("%{byte:02X}"));
        }
        serializer.serialize_str(&text)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
        let text = String::deserialize(deserializer)?;
        let mut bytes = Vec::new();
        let mut rest = text.as_bytes();
        while let [first, tail @ ..] = rest {
            let escaped = (*first == b'%').then(|| tail.split_at_checked(2)).flatten();
            let byte = escaped
                .and_then(|(digits, _)| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
            bytes.push(byte.unwrap_or(*first));
            rest = if byte.is_some() { &tail[2..] } else { tail };
        }
        Ok(path_of(bytes))
    }

    #[cfg(unix)]
    fn path_of(bytes: Vec<u8>) -> PathBuf {
        use std::os::unix::ffi::OsStringExt as _;
        std::ffi::OsString::from_vec(bytes).into()
    }

    #[cfg(not(unix))]
    fn path_of(bytes: Vec<u8>) -> PathBuf {
        String::from_utf8_lossy(&bytes).into_owned().into()
    }
}
