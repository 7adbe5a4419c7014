//! What is remembered of a project between runs. Losing it costs time, never correctness.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::sources::Stamp;
use crate::{Digest, Error, Store, Targets, store};

/// Memory of one project (one folder).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ProjectState {
    /// Source path to the stamp under which it was last hashed.
    pub(crate) stamps: BTreeMap<String, Stamp>,
    /// Action name to the key with which it last succeeded or failed: the "before" of explanations.
    pub actions: BTreeMap<String, Digest>,
    /// What was published last: the last good content of every target.
    pub targets: Targets,
    /// Whether `actions` changed since it was saved.
    #[serde(skip)]
    pub(crate) dirty: bool,
}

impl ProjectState {
    /// Reads the memory of the project that lives in `folder` (a canonical path).
    pub fn load(store: &Store, folder: &std::path::Path) -> Result<ProjectState, Error> {
        Ok(store.read_json(&store.project_path(&Self::key(folder)))?.unwrap_or_default())
    }

    /// Writes it back.
    pub fn save(&self, store: &Store, folder: &std::path::Path) -> Result<(), Error> {
        store::write_json(&store.project_path(&Self::key(folder)), self)
    }

    fn key(folder: &std::path::Path) -> Digest {
        Digest::of(folder.as_os_str().as_encoded_bytes())
    }
}
