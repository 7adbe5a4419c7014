//! What is remembered of a project between runs. Losing it costs time, never correctness.

use std::collections::BTreeMap;
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
    /// Whether it differs from what is on the disk.
    #[serde(skip)]
    pub(crate) is_changed: bool,
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
        self.actions.insert(record.name.clone(), ActionMemory { key, record: record.clone(), change });
        self.is_changed = true;
    }

    /// Notes that the running build ended.
    pub(crate) fn end_build(&mut self, note: BuildNote) {
        self.builds.push(note);
        let surplus = self.builds.len().saturating_sub(BUILDS_KEPT);
        self.builds.drain(..surplus);
        self.is_changed = true;
    }
}
