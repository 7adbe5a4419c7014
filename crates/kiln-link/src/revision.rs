//! The published state of a project, as both sides of the wire see it.

use std::collections::HashMap;
use std::sync::Arc;

use kiln_build::{Digest, Part, Target, Targets};
use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

/// One consistent set of targets, without their contents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RevisionTable {
    /// Counts up from 1 while a daemon lives.
    pub number: u64,
    /// Target name to what it is.
    pub targets: Targets,
    /// What is wrong with the project now.
    pub diagnostics: Vec<Diagnostic>,
    /// What was done to make this revision from the one before.
    pub work: Work,
    /// Targets whose new content is still being made or measured, while what clients want is here already: those that were published
    /// before are as they were or as they will be but for what is measured, new ones are missing. The next revision follows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub building: Vec<String>,
}

/// What a build did, for people and for the preview's timeline.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Project-relative files whose change began it; empty for the first build.
    pub changed_files: Vec<String>,
    /// Actions that ran, in the order they ended.
    pub ran: Vec<ActionTime>,
    /// Number of actions whose result was reused.
    pub reused: usize,
    /// From noticing the change to having the plan, milliseconds.
    pub plan_ms: f64,
    /// From the plan to the last action's end, milliseconds.
    pub run_ms: f64,
    /// Unix time at which the first change of the batch was noticed, in milliseconds; 0 for the first build.
    pub noticed_unix_ms: f64,
    /// Unix time at which the revision was published, in milliseconds.
    pub published_unix_ms: f64,
}

/// One action and its cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionTime {
    /// As `prefilter env/sky/specular mip 3`.
    pub name: String,
    /// Wall-clock milliseconds.
    pub wall_ms: f64,
    /// Why it ran.
    pub reason: String,
}

/// A revision with every content it names.
#[derive(Clone, Debug)]
pub struct Revision {
    /// The targets.
    pub table: RevisionTable,
    blobs: HashMap<Digest, Arc<[u8]>>,
}

impl Revision {
    /// Joins a table with its contents; `Err` names the first digest that is missing.
    pub fn new(table: RevisionTable, blobs: HashMap<Digest, Arc<[u8]>>) -> Result<Self, Digest> {
        let mut parts = table.targets.values().flat_map(|target| &target.parts);
        match parts.find(|part| !blobs.contains_key(&part.digest)) {
            Some(part) => Err(part.digest),
            None => Ok(Revision { table, blobs }),
        }
    }

    /// The bytes of a part.
    pub fn bytes(&self, part: &Part) -> &Arc<[u8]> {
        &self.blobs[&part.digest]
    }

    /// The bytes of the named part of a target, if both exist.
    pub fn part(&self, target: &str, part: &str) -> Option<&Arc<[u8]>> {
        let parts = &self.table.targets.get(target)?.parts;
        parts.iter().find(|candidate| candidate.name == part).map(|part| self.bytes(part))
    }

    /// Targets whose name begins with `prefix`, in name order.
    pub fn targets_under<'a>(&'a self, prefix: &'a str) -> impl Iterator<Item = (&'a str, &'a Target)> {
        let all = self.table.targets.iter();
        all.filter(move |(name, _)| name.starts_with(prefix)).map(|(name, target)| (name.as_str(), target))
    }
}
