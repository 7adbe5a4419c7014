//! Everything that is said.

use std::collections::BTreeMap;

use kiln_build::Digest;
use serde::{Deserialize, Serialize};

use crate::{Answer, DaemonStatus, Request, RevisionTable, Token};

/// Raised whenever an old peer would misunderstand a new one; both sides must have the same.
pub const PROTOCOL_VERSION: u32 = 2;

/// What a client or a daemon may be capable of.
pub mod capability {
    /// It follows revisions: the daemon tells it tables and progress. Without it a client only asks.
    pub const REVISIONS: &str = "revisions";
    /// Of a daemon: it changes the project's sources for a client that asks ([`crate::Request`]).
    pub const REQUESTS: &str = "requests";
}

/// What a client says.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientMessage {
    /// First message.
    Hello(Hello),
    /// Asks for contents.
    Fetch(Vec<Digest>),
    /// Says when a revision was seen.
    Frame(FrameReport),
    /// Says what it shows; replaces what it said before.
    Wants(Wants),
    /// Asks whether the daemon is there; the daemon answers with the same number.
    Ping(u64),
    /// The answer to a ping.
    Pong(u64),
    /// Asks for a [`DaemonStatus`].
    Status,
    /// Asks the daemon to end.
    Stop,
    /// Asks for a change of the project; answered by a [`ServerMessage::Answer`]. Only to daemons with
    /// [`capability::REQUESTS`].
    Request(Request),
}

/// What a daemon says.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerMessage {
    /// First message; the name is the project's.
    Hello(Hello),
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
    /// A content that was asked for will not come: no table told this client of it, a newer one does without it, or
    /// the daemon no longer has it and publishes anew.
    Missing(Digest),
    /// How far a build is.
    Progress(ProgressReport),
    /// Asks whether the client is there; the client answers with the same number.
    Ping(u64),
    /// The answer to a ping.
    Pong(u64),
    /// How the daemon is.
    Status(Box<DaemonStatus>),
    /// What became of a request.
    Answer(Answer),
}

/// How a talk begins.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL_VERSION`] of who says it.
    pub protocol: u32,
    /// Of a client for status lines, as `preview`; of a daemon the project's.
    pub name: String,
    /// What it can do ([`capability`]); unknown ones are passed over, so that new ones need no new version.
    #[serde(default)]
    pub capabilities: Vec<String>,
    /// Of a client that comes by TCP: what the daemon wrote for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
}

impl Hello {
    /// A greeting of this version.
    pub fn new(name: &str, capabilities: &[&str]) -> Hello {
        let capabilities = capabilities.iter().map(|&name| name.to_owned()).collect();
        Hello { protocol: PROTOCOL_VERSION, name: name.to_owned(), capabilities, token: None }
    }

    /// Whether it has a capability.
    pub fn can(&self, capability: &str) -> bool {
        self.capabilities.iter().any(|name| name == capability)
    }
}

/// What a client shows.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wants {
    /// Names of targets, or of groups of them: `scene/balls`, `env/sky`.
    pub targets: Vec<String>,
    /// Of some of these names: what is good enough to be shown. The others are wanted as they are in the end.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub qualities: BTreeMap<String, Quality>,
}

/// How good a target must be before a client wants to see it. A daemon may send it better at once, and goes on to the final one in any
/// case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Quality {
    /// The fastest that shows anything.
    Draft,
    /// Good enough to judge a picture by.
    Preview,
    /// What the project asks for.
    #[default]
    Final,
}

impl From<String> for Quality {
    /// One that this side does not know is the final one, which is never wrong.
    fn from(name: String) -> Quality {
        match name.as_str() {
            "draft" => Quality::Draft,
            "preview" => Quality::Preview,
            _ => Quality::Final,
        }
    }
}

impl From<Quality> for String {
    fn from(quality: Quality) -> String {
        match quality {
            Quality::Draft => "draft",
            Quality::Preview => "preview",
            Quality::Final => "final",
        }
        .to_owned()
    }
}

impl Wants {
    /// Whether the target is one of these, or lies in a group of them: `env/sky` has `env/sky/specular`, but not `env/skyline`.
    pub fn include(&self, target: &str) -> bool {
        self.targets.iter().any(|want| includes(want, target))
    }

    /// How good the target must be: the best of what the names that include it ask for; `None` if it is not wanted.
    pub fn quality_of(&self, target: &str) -> Option<Quality> {
        let names = self.targets.iter().filter(|want| includes(want, target));
        names.map(|name| self.qualities.get(name).copied().unwrap_or_default()).max()
    }

    /// What several clients want together: each name once, as good as the most demanding of them wants it.
    pub fn together<'a>(all: impl IntoIterator<Item = &'a Wants>) -> Wants {
        let mut best: BTreeMap<&str, Quality> = BTreeMap::new();
        for wants in all {
            for name in &wants.targets {
                let quality = wants.qualities.get(name).copied().unwrap_or_default();
                best.entry(name).and_modify(|known| *known = quality.max(*known)).or_insert(quality);
            }
        }
        let is_less = |(_, quality): &(&&str, &Quality)| **quality < Quality::Final;
        let qualities = best.iter().filter(is_less).map(|(name, quality)| ((*name).to_owned(), *quality));
        Wants {
            qualities: qualities.collect(),
            targets: best.keys().map(|name| (*name).to_owned()).collect(),
        }
    }
}

fn includes(want: &str, target: &str) -> bool {
    target.strip_prefix(want).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
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
