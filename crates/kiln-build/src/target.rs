//! Stable names for artefacts, and what is published under them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::Digest;

/// One consistent state of a project: target name to what it is.
pub type Targets = BTreeMap<String, Target>;

/// A target's kind, state and contents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// As `cube`, `scene` or `shader`: how to read the parts.
    pub kind: String,
    /// Whether it matches its sources.
    pub state: TargetState,
    /// What a reader of the parts must know: sizes, formats, scales, errors.
    pub meta: serde_json::Value,
    /// Contents in a fixed order (the levels of a cube, the text and reflection of a shader).
    pub parts: Vec<Part>,
}

/// Whether a target matches its sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TargetState {
    /// Made from the sources as they are.
    Fresh,
    /// Its sources have an error; this is the last good content.
    Stale,
}

/// One blob of a target.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// As `mip3` or `wgsl`.
    pub name: String,
    /// SHA-256 of its bytes.
    pub digest: Digest,
    /// Its length.
    pub bytes: u64,
}

impl Target {
    /// The digest of everything a reader of the target sees: kind, facts and contents, not its state.
    pub fn digest(&self) -> Digest {
        let seen = serde_json::json!([self.kind, self.meta, self.parts]);
        Digest::of(seen.to_string().as_bytes())
    }

    /// Length of all parts.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().map(|part| part.bytes).sum()
    }

    /// The same, marked as no longer matching its sources.
    #[must_use]
    pub fn into_stale(mut self) -> Target {
        self.state = TargetState::Stale;
        self
    }
}
