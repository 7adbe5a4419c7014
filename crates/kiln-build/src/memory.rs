//! What is remembered of a project between runs. Losing it costs time, never correctness.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::sources::Stamp;
use crate::{ActionRecord, Digest, Reason, Scan};

/// Older builds are forgotten.
const BUILDS_KEPT: usize = 100;

/// Memory of one project (one folder).
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Memory {
    /// The last builds that changed something, the newest last.
    pub(crate) builds: Vec<BuildNote>,
    /// By name: how each action was last settled.
    pub(crate) actions: BTreeMap<String, ActionMemory>,
    /// By kind, recipe and root: what each scan found last.
    pub(crate) scans: BTreeMap<String, ScanMemory>,
    /// Source path to the stamp under which it was last hashed.
    pub(crate) source_stamps: BTreeMap<String, Stamp>,
    /// The same for the files that were written for engines.
    pub(crate) output_stamps: BTreeMap<String, Stamp>,
    /// By target: which files were made of which content.
    pub(crate) files: BTreeMap<String, FilesOfTarget>,
    /// Whether it differs from what is on the disk.
    #[serde(skip)]
    pub(crate) is_changed: bool,
    /// Number of the last build when this was read.
    #[serde(skip)]
    pub(crate) read_build: u64,
    /// Actions that this process has settled otherwise.
    #[serde(skip)]
    pub(crate) own: BTreeSet<String>,
}

/// Files that were made of a target's content, so that they need not be made again to be compared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FilesOfTarget {
    /// Digest of the target.
    pub target: Digest,
    /// Version of the code that made them.
    pub maker: u32,
    /// Path, digest and length of each.
    pub files: Vec<(String, Digest, u64)>,
}

/// A build that changed something.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BuildNote {
    /// Counts from 1 in each project folder.
    pub number: u64,
    /// When it ended, in seconds since 1970.
    pub unix_s: u64,
    /// How many actions ran.
    pub ran: usize,
    /// How many results were in the store.
    pub reused: usize,
    /// How many actions made nothing, because their input is at fault.
    pub failed: usize,
}

/// How an action was last settled, and what changed then.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ActionMemory {
    pub(crate) key: Digest,
    pub(crate) record: Arc<ActionRecord>,
    pub(crate) change: ChangeNote,
    /// Whether all it made was seen in the store since the last plan of everything.
    #[serde(skip)]
    pub(crate) is_present: bool,
}

/// Why an action's result is another one than before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChangeNote {
    /// The build in which that was found.
    pub build: u64,
    /// The build that had made the result before; `None` for the first one.
    pub since: Option<u64>,
    /// What differs.
    pub reason: Reason,
    /// Whether the action ran; otherwise its result was in the store.
    pub ran: bool,
}

#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct ScanMemory {
    pub(crate) scan: Arc<Scan>,
    /// Whether the present plan asked for it.
    #[serde(skip)]
    pub(crate) is_asked: bool,
}

impl Memory {
    /// The number of the build that is running, or would be the next.
    pub(crate) fn next_build(&self) -> u64 {
        self.builds.last().map_or(1, |build| build.number + 1)
    }

    /// Notes how an action was settled in the running build.
    pub(crate) fn settle(&mut self, record: &Arc<ActionRecord>, ran: bool) {
        let before = self.actions.get(&record.name);
        if before.is_some_and(|before| Arc::ptr_eq(&before.record, record)) {
            return;
        }
        let (key, build) = (record.key(), self.next_build());
        if !ran && before.is_some_and(|before| before.key == key) {
            return;
        }
        let reason = Reason::between(before.map(|before| &*before.record), record);
        let since = before.map(|before| before.change.build);
        let change = ChangeNote { build, since, reason, ran };
        self.actions.insert(
            record.name.clone(),
            ActionMemory { key, record: record.clone(), change, is_present: ran },
        );
        self.own.insert(record.name.clone());
        self.is_changed = true;
    }

    /// Notes that the running build ended.
    pub(crate) fn end_build(&mut self, note: BuildNote) {
        self.builds.push(note);
        let surplus = self.builds.len().saturating_sub(BUILDS_KEPT);
        self.builds.drain(..surplus);
        self.is_changed = true;
    }

    /// Takes over what other processes have written since this was read: their builds come before this process's own, whose
    /// numbers move up, and where this process has settled nothing theirs holds.
    pub(crate) fn merge(&mut self, theirs: Memory) {
        let their_last = theirs.builds.last().map_or(0, |build| build.number);
        if their_last == self.read_build {
            return;
        }
        let shift = their_last.saturating_sub(self.read_build);
        let read_build = self.read_build;
        let renumber = |number: u64| if number > read_build { number + shift } else { number };
        let own_builds: Vec<BuildNote> =
            self.builds.drain(..).filter(|build| build.number > read_build).collect();
        self.builds = theirs.builds;
        self.builds.extend(
            own_builds.into_iter().map(|build| BuildNote { number: renumber(build.number), ..build }),
        );
        for (name, mut memory) in theirs.actions {
            if let Some(own) = self.actions.get(&name).filter(|_| self.own.contains(&name)) {
                memory = own.clone();
                memory.change.build = renumber(memory.change.build);
                memory.change.since = memory.change.since.map(renumber);
            }
            self.actions.insert(name, memory);
        }
        self.read_build = their_last;
    }
}
