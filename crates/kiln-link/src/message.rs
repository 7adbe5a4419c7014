//! Everything that is said.

use kiln_build::Digest;
use serde::{Deserialize, Serialize};

use crate::RevisionTable;

/// Raised whenever an old peer would misunderstand a new one; both sides must have the same.
pub const PROTOCOL_VERSION: u32 = 1;

/// What a client says.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientMessage {
    /// First message.
    Hello {
        /// [`PROTOCOL_VERSION`] of the client.
        protocol: u32,
        /// For status lines: `preview`, `demo` …
        name: String,
    },
    /// Asks for contents.
    Fetch(Vec<Digest>),
    /// Says when a revision was seen.
    Frame(FrameReport),
}

/// What a daemon says.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerMessage {
    /// First message.
    Hello {
        /// [`PROTOCOL_VERSION`] of the daemon.
        protocol: u32,
        /// Name of the project.
        project: String,
    },
    /// A new state of the project.
    Revision(RevisionTable),
    /// A piece of a content.
    Chunk {
        /// Which content.
        digest: Digest,
        /// Where the piece begins.
        offset: u64,
        /// Length of the whole content.
        total: u64,
        /// The piece.
        bytes: Vec<u8>,
    },
    /// The daemon no longer has this content; a newer revision does without it.
    Missing(Digest),
    /// How far a build is.
    Progress(ProgressReport),
}

/// How far a build is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProgressReport {
    /// Actions settled.
    pub done: usize,
    /// Actions in all.
    pub total: usize,
    /// What runs now; empty when the build has ended.
    pub current: String,
}

/// When a client had, prepared and drew a revision; Unix time in milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// Which revision.
    pub revision: u64,
    /// The whole revision was here.
    pub received_unix_ms: f64,
    /// Pipelines and uploads were done.
    pub ready_unix_ms: f64,
    /// The GPU had finished the first frame that shows it.
    pub drawn_unix_ms: f64,
}
