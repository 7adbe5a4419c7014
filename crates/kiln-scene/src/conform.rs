//! Says where a file is not as glTF 2.0 wants it although it can be drawn: wrong values, missing properties,
//! references into nowhere, misplaced extensions, in what is drawn and in what is not.
//!
//! Start at [`check`]. What cannot be drawn right is refused where it is read; here nothing is, because a fault
//! in an unused camera must not keep an artist from a picture. Each finding has its place.
//!
//! Not here: values of vertices (`shape`, `geometry` repair and note them), as only what is drawn is read.

use std::collections::BTreeSet;

use crate::accessor::Data;
use crate::json::Json;
use crate::{SceneError, limits};

mod animations;
mod meshes;
mod nodes;
mod storage;
mod table;
mod walk;

/// Names that `extensionsUsed` lists.
type Used<'a> = BTreeSet<&'a str>;

/// Findings in the order in which they came up, at most [`limits::NOTE_COUNT_MAX`].
#[derive(Debug, Default)]
pub(crate) struct Findings {
    pub list: Vec<SceneError>,
}

impl Findings {
    pub fn push(&mut self, pointer: impl Into<String>, reason: impl Into<String>) {
        self.add(SceneError::new(pointer, reason));
    }

    pub fn add(&mut self, finding: SceneError) {
        if self.list.len() < limits::NOTE_COUNT_MAX && !self.list.contains(&finding) {
            self.list.push(finding);
        }
    }
}

/// Everything that is wrong and does not keep the file from being drawn.
pub(crate) fn check(json: &Json<'_>, data: &Data<'_>) -> Vec<SceneError> {
    let mut findings = Findings::default();
    let used = json.table("extensionsUsed").iter().filter_map(Json::text).collect();
    if !walk::check(json, &used, &mut findings) {
        return findings.list;
    }
    storage::check(json, data, &used, &mut findings);
    meshes::check(json, &used, &mut findings);
    nodes::check(json, data, &mut findings);
    animations::check(json, data, &mut findings);
    findings.list
}
