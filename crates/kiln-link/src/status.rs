//! How a daemon is: what `kiln status` prints.

use std::collections::BTreeMap;

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::{ProgressReport, Quality};

/// A daemon at one moment. Times are Unix time in milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DaemonStatus {
    /// Name of the project.
    pub project: String,
    /// The daemon's process.
    pub pid: u32,
    /// When it began to listen.
    pub since_unix_ms: f64,
    /// Number of the newest revision; 0 before the first.
    pub revision: u64,
    /// When it was published; 0 before the first.
    pub published_unix_ms: f64,
    /// Number of targets in it.
    pub targets: usize,
    /// The build in flight.
    pub building: Option<BuildStatus>,
    /// Targets whose sources have an error, and which still have their last good content.
    pub stale: Vec<String>,
    /// The errors of the newest revision.
    pub errors: Vec<Diagnostic>,
    /// Who follows the revisions.
    pub clients: Vec<ClientStatus>,
}

/// A build in flight.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BuildStatus {
    /// Files whose change began it; empty for the first build.
    pub files: Vec<String>,
    /// How far it is.
    pub progress: ProgressReport,
    /// Targets that it still makes, while what clients want is published; empty before that.
    #[serde(default)]
    pub targets: Vec<String>,
}

/// A client as the daemon knows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClientStatus {
    /// Counts up while a daemon lives.
    pub client: u64,
    /// Its own name.
    pub name: String,
    /// When it greeted.
    pub since_unix_ms: f64,
    /// What it shows, as far as it said.
    pub wants: Vec<String>,
    /// How good those must be that need not be final.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub qualities: BTreeMap<String, Quality>,
    /// The newest revision whose table was written to it; 0 before the first.
    pub told_revision: u64,
    /// The newest revision that it drew; 0 if it reported none.
    pub shown_revision: u64,
    /// How long after its publication that was drawn, milliseconds.
    pub shown_after_ms: Option<f64>,
    /// Contents that it asked for and has not got whole.
    pub waiting_contents: usize,
    /// From a ping to its answer, milliseconds; none before the first answer.
    pub round_trip_ms: Option<f64>,
}
