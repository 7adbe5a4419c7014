//! Keeping the store small: what was not used for longest goes first, what is published stays.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::engine::{PUBLISHED_FILE, Published};
use crate::fs::TEMPORARY_PREFIX;
use crate::store::{BLOBS, PROJECTS, RECORDS, SCANS};
use crate::{Digest, Error, Store, document};

/// A temporary file that is older belongs to a process that was killed.
const TEMPORARY_AGE_MAX: Duration = Duration::from_secs(3600);
/// What another machine's project published is held for this long after that project was last built.
const FOREIGN_PROJECT_AGE_MAX: Duration = Duration::from_secs(30 * 24 * 3600);
/// And that of a project whose folder is not there: a drive may come back.
const ABSENT_PROJECT_AGE_MAX: Duration = Duration::from_secs(7 * 24 * 3600);
/// A store that changed is looked over when that was not done for this long …
const COLLECTION_INTERVAL: Duration = Duration::from_secs(24 * 3600);
/// … or when this process alone wrote this share of what it may keep.
const WRITTEN_SHARE: u64 = 16;
/// Files of other formats that are younger may be in use by another version of this program, whose lock is not ours.
const OTHER_FORMAT_AGE_MAX: Duration = Duration::from_secs(7 * 24 * 3600);
/// Written by every collection; its time says when that was.
const COLLECTED_FILE: &str = "collected";

/// How to collect.
#[derive(Clone, Copy, Debug)]
pub struct CollectOptions {
    /// The store may keep this much, besides what published revisions hold.
    pub bytes_max: u64,
    /// Whether to wait for builds that are running; otherwise nothing is collected while there are any.
    pub wait: bool,
    /// Only say what would go.
    pub dry_run: bool,
}

/// What a collection did, or would do.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Collected {
    /// Files that went, or would.
    pub removed_files: usize,
    /// Their length.
    pub removed_bytes: u64,
    /// What is left.
    pub kept_bytes: u64,
    /// How much of that published revisions hold.
    pub held_bytes: u64,
    /// Projects whose folder is gone, or which nobody has built for long.
    pub forgotten_projects: Vec<String>,
}

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Usage {
    /// Number of artefacts.
    pub blobs: usize,
    /// Their length.
    pub blob_bytes: u64,
    /// Number of action records.
    pub records: usize,
    /// Number of scan results.
    pub scans: usize,
    /// Length of all files of the present format.
    pub bytes: u64,
    /// Length of files that killed processes left behind.
    pub temporary_bytes: u64,
    /// Length of files of other formats.
    pub other_formats_bytes: u64,
    /// Length of what published revisions hold.
    pub held_bytes: u64,
    /// Projects with a published revision.
    pub projects: Vec<ProjectUsage>,
}

/// A project in a store.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ProjectUsage {
    /// Its folder.
    pub folder: String,
    /// The machine it was built on.
    pub host: String,
    /// Whether its published revision is held: not if its folder is gone or it was not built for long.
    pub is_held: bool,
    /// Number of targets in its published revision.
    pub targets: usize,
}

struct StoredFile {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
    kind: FileKind,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum FileKind {
    Temporary,
    OtherFormat,
    Blob,
    Record,
    Scan,
}

struct FoundProject {
    folder: PathBuf,
    usage: ProjectUsage,
    digests: Vec<Digest>,
}

impl Store {
    /// What is in the store.
    ///
    /// # Errors
    /// Its folders cannot be listed.
    pub fn usage(&self) -> Result<Usage, Error> {
        let mut usage = Usage::default();
        let projects = self.projects()?;
        let held = held_paths(&projects);
        for file in self.files()? {
            match file.kind {
                FileKind::Blob => {
                    usage.blobs += 1;
                    usage.blob_bytes += file.bytes;
                }
                FileKind::Record => usage.records += 1,
                FileKind::Scan => usage.scans += 1,
                FileKind::Temporary => usage.temporary_bytes += file.bytes,
                FileKind::OtherFormat => usage.other_formats_bytes += file.bytes,
            }
            if file.kind > FileKind::OtherFormat {
                usage.bytes += file.bytes;
            }
            if is_held(&held, &file) {
                usage.held_bytes += file.bytes;
            }
        }
        usage.projects = projects.into_iter().map(|project| project.usage).collect();
        Ok(usage)
    }

    /// Removes what was not used for longest until the rest fits, and what killed processes and other formats left.
    /// Nothing that a published revision holds goes, and nothing at all while a build is running; `None` if it had to
    /// wait for one and was not to.
    ///
    /// # Errors
    /// The store cannot be read or locked. A file that cannot be removed is kept.
    pub fn collect(&self, options: &CollectOptions) -> Result<Option<Collected>, Error> {
        let lock = self.lock_file().map_err(Error::io("open the lock of", self.root()))?;
        if options.wait {
            lock.lock().map_err(Error::io("lock", self.root()))?;
        } else if lock.try_lock().is_err() {
            return Ok(None);
        }
        let mut collected = Collected::default();
        let projects = self.projects()?;
        if !options.dry_run {
            self.remove_memories_without_projects()?;
        }
        for project in projects.iter().filter(|project| !project.usage.is_held) {
            collected.forgotten_projects.push(project.usage.folder.clone());
            if !options.dry_run {
                self.remove_folder(&project.folder);
            }
        }
        let held = held_paths(&projects);
        let mut files = self.files()?;
        // Equal times, as after a copy, in a fixed order.
        files.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        let mut kept_bytes: u64 = files.iter().map(|file| file.bytes).sum();
        let counts = |file: &StoredFile| file.kind > FileKind::OtherFormat && !is_held(&held, file);
        let mut counted_bytes: u64 = files.iter().filter(|file| counts(file)).map(|file| file.bytes).sum();
        for file in &files {
            let is_useless = match file.kind {
                FileKind::OtherFormat => age(file.used).is_some_and(|age| age > OTHER_FORMAT_AGE_MAX),
                FileKind::Temporary => age(file.used).is_none_or(|age| age > TEMPORARY_AGE_MAX),
                FileKind::Blob | FileKind::Record | FileKind::Scan => {
                    counts(file) && counted_bytes > options.bytes_max
                }
            };
            if is_useless && (options.dry_run || self.file_system().remove(&file.path).is_ok()) {
                collected.removed_files += 1;
                collected.removed_bytes += file.bytes;
                kept_bytes -= file.bytes;
                counted_bytes -= if counts(file) { file.bytes } else { 0 };
            } else if is_held(&held, file) {
                collected.held_bytes += file.bytes;
            }
        }
        collected.kept_bytes = kept_bytes;
        if !options.dry_run {
            // Only for the next collection's pace.
            let mark = self.root().join(COLLECTED_FILE);
            let _ = self.file_system().touch(&mark).or_else(|_| self.file_system().write_new(&mark, b""));
        }
        Ok(Some(collected))
    }

    /// [`Store::collect`] if this process wrote something and it is time for it again, unless a build is running.
    ///
    /// # Errors
    /// The same.
    pub fn collect_if_due(&self, bytes_max: u64) -> Result<Option<Collected>, Error> {
        let is_due = self.since_collection().is_none_or(|since| since > COLLECTION_INTERVAL)
            || self.written_bytes() > bytes_max / WRITTEN_SHARE;
        if self.written_bytes() == 0 || self.is_read_only() || !is_due {
            return Ok(None);
        }
        let collected = self.collect(&CollectOptions { bytes_max, wait: false, dry_run: false })?;
        if collected.is_some() {
            self.forget_written();
        }
        Ok(collected)
    }

    /// Since when nothing was collected; `None` if never.
    pub fn since_collection(&self) -> Option<Duration> {
        let facts = self.file_system().facts(&self.root().join(COLLECTED_FILE)).ok()?;
        Some(age(facts.modified).unwrap_or(Duration::MAX))
    }

    /// Reads every file and drops what is damaged; returns how many files were read and how many dropped.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn check(&self, progress: &dyn Fn(usize, usize)) -> Result<(usize, usize), Error> {
        let files = self.files()?;
        let damaged_before = self.damaged_count();
        for (index, file) in files.iter().enumerate() {
            progress(index, files.len());
            if file.kind <= FileKind::OtherFormat {
                continue;
            }
            // It may have been collected meanwhile.
            let Ok(bytes) = self.file_system().read(&file.path) else { continue };
            let is_sound = match file.kind {
                FileKind::Blob => digest_of_name(&file.path) == Some(Digest::of(&bytes)),
                _ => document::decode::<serde::de::IgnoredAny>(&file.path, &bytes).is_some(),
            };
            if !is_sound {
                self.drop_damaged(&file.path);
            }
        }
        Ok((files.len(), self.damaged_count() - damaged_before))
    }

    fn files(&self) -> Result<Vec<StoredFile>, Error> {
        let mut files = Vec::new();
        for (folder, kind) in [(BLOBS, FileKind::Blob), (RECORDS, FileKind::Record), (SCANS, FileKind::Scan)]
        {
            self.add_files(&self.root().join(folder), kind, &mut files)?;
        }
        // Killed processes may have left something beside these, too.
        for path in
            self.list(self.root())?.into_iter().chain(self.project_files()?).filter(|path| is_temporary(path))
        {
            self.add_file(path, FileKind::Temporary, &mut files)?;
        }
        let cache = self.root().parent().unwrap_or(self.root());
        for path in self.list(cache)? {
            if path != self.root() && is_format_folder(&path) {
                self.add_files(&path, FileKind::OtherFormat, &mut files)?;
            }
        }
        Ok(files)
    }

    fn add_files(&self, folder: &Path, kind: FileKind, files: &mut Vec<StoredFile>) -> Result<(), Error> {
        self.list(folder)?.into_iter().try_for_each(|path| self.add_file(path, kind, files))
    }

    fn add_file(&self, path: PathBuf, kind: FileKind, files: &mut Vec<StoredFile>) -> Result<(), Error> {
        match self.file_system().facts(&path) {
            Ok(facts) => {
                let kind = if is_temporary(&path) { FileKind::Temporary } else { kind };
                files.push(StoredFile { path, bytes: facts.bytes, used: facts.modified, kind });
                Ok(())
            }
            Err(_) if path.is_dir() => self.add_files(&path, kind, files),
            // It went while the folder was being listed.
            Err(_) => Ok(()),
        }
    }

    fn project_files(&self) -> Result<Vec<PathBuf>, Error> {
        let folders = self.list(&self.root().join(PROJECTS))?;
        let files: Vec<Vec<PathBuf>> =
            folders.iter().map(|folder| self.list(folder)).collect::<Result<_, _>>()?;
        Ok(files.into_iter().flatten().collect())
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        match self.file_system().list(folder) {
            Ok(mut paths) => {
                paths.sort();
                Ok(paths)
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(Error::io("list", folder)(error)),
        }
    }

    fn projects(&self) -> Result<Vec<FoundProject>, Error> {
        let mut projects = Vec::new();
        for folder in self.list(&self.root().join(PROJECTS))? {
            let path = folder.join(PUBLISHED_FILE);
            let Ok(bytes) = self.file_system().read(&path) else { continue };
            let Some(published) = document::decode::<Published>(&path, &bytes) else { continue };
            let used = self.file_system().facts(&path).ok().and_then(|facts| age(facts.modified));
            let age_max =
                if published.host == host() { ABSENT_PROJECT_AGE_MAX } else { FOREIGN_PROJECT_AGE_MAX };
            let is_here = published.host == host() && published.folder.is_dir();
            let is_held = is_here || used.is_none_or(|age| age <= age_max);
            let parts = published.targets.values().flat_map(|target| &target.parts);
            let digests = parts.map(|part| part.digest).collect();
            let usage = ProjectUsage {
                folder: published.folder.to_string_lossy().into_owned(),
                host: published.host,
                is_held,
                targets: published.targets.len(),
            };
            projects.push(FoundProject { folder, usage, digests });
        }
        Ok(projects)
    }

    /// Projects that were planned and never baked leave a memory alone.
    fn remove_memories_without_projects(&self) -> Result<(), Error> {
        for folder in self.list(&self.root().join(PROJECTS))? {
            let files = self.list(&folder)?;
            let last_use =
                files.iter().filter_map(|path| age(self.file_system().facts(path).ok()?.modified)).min();
            let is_published = files.iter().any(|path| path.ends_with(PUBLISHED_FILE));
            if !is_published && last_use.is_none_or(|age| age > FOREIGN_PROJECT_AGE_MAX) {
                self.remove_folder(&folder);
            }
        }
        Ok(())
    }

    fn remove_folder(&self, folder: &Path) {
        for path in self.list(folder).unwrap_or_default() {
            // What cannot be removed is tried again by the next collection.
            let _ = self.file_system().remove(&path);
        }
        let _ = std::fs::remove_dir(folder);
    }
}

/// The name of this machine; empty if it has none.
pub(crate) fn host() -> String {
    #[cfg(unix)]
    return rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

fn held_paths(projects: &[FoundProject]) -> HashSet<Digest> {
    projects
        .iter()
        .filter(|project| project.usage.is_held)
        .flat_map(|project| project.digests.clone())
        .collect()
}

fn is_held(held: &HashSet<Digest>, file: &StoredFile) -> bool {
    file.kind == FileKind::Blob && digest_of_name(&file.path).is_some_and(|digest| held.contains(&digest))
}

fn digest_of_name(path: &Path) -> Option<Digest> {
    path.file_name()?.to_str()?.parse().ok()
}

fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(TEMPORARY_PREFIX))
}

/// `v1`, `v2` …
fn is_format_folder(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_prefix('v'));
    name.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()))
}

/// `None` for a time in the future: a clock was wrong then, or is now.
fn age(time: SystemTime) -> Option<Duration> {
    SystemTime::now().duration_since(time).ok()
}
