//! Whether Kiln said something where the validator did.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use kiln_diagnostic::{Diagnostic, Severity};
use serde_json::{Value, json};

/// An error of the validator.
#[derive(Debug)]
pub(crate) struct Fault {
    pub code: String,
    /// Empty for the whole file.
    pub pointer: String,
}

/// What became of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    Refused,
    Noted,
    /// And why.
    Allowed(&'static str),
}

/// Files below `folder` that have a report of the validator, in order.
pub(crate) fn reported_cases(folder: &Path) -> Vec<PathBuf> {
    let mut reports = Vec::new();
    super::files_below(folder, &mut reports);
    let case = |report: &PathBuf| report.to_str()?.strip_suffix(".report.json").map(PathBuf::from);
    let mut cases: Vec<PathBuf> = reports.iter().filter_map(case).collect();
    cases.sort();
    cases
}

/// The errors that the report beside `file` lists.
pub(crate) fn faults_of(file: &Path) -> Vec<Fault> {
    let report = std::fs::read(format!("{}.report.json", file.display())).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let messages = report["issues"]["messages"].as_array().unwrap().iter();
    let errors = messages.filter(|message| message["severity"] == 0);
    errors
        .map(|message| Fault {
            code: message["code"].as_str().unwrap().to_owned(),
            pointer: message["pointer"].as_str().unwrap_or_default().trim_end_matches('/').to_owned(),
        })
        .collect()
}

/// The file with a node for each mesh, if nothing shows any: faults of what is never read are never found.
pub(crate) fn staged(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut root: Value = serde_json::from_slice(bytes).ok()?;
    let count = root.get("meshes")?.as_array()?.len();
    let nodes = root.get("nodes").and_then(Value::as_array).cloned().unwrap_or_default();
    if nodes.iter().any(|node| node.get("mesh").is_some()) {
        return None;
    }
    let first = nodes.len();
    let added = (0..count).map(|mesh| json!({"mesh": mesh}));
    root["nodes"] = nodes.into_iter().chain(added).collect();
    root["scenes"] = json!([{"nodes": (first..first + count).collect::<Vec<_>>()}]);
    root["scene"] = json!(0);
    serde_json::to_vec(&root).ok()
}

/// How Kiln answered a fault; `None` if it said nothing about that place.
pub(crate) fn judge(fault: &Fault, diagnostics: &[Diagnostic]) -> Option<Outcome> {
    if diagnostics.iter().any(|it| it.is_error() && has_place(it)) {
        return Some(Outcome::Refused);
    }
    let said = |it: &&Diagnostic| it.severity != Severity::Error && is_about(&it.message, &fault.pointer);
    diagnostics.iter().find(said).map(|_| Outcome::Noted)
}

/// A JSON pointer, a byte of a container, a line, or a property of the whole file.
fn has_place(error: &Diagnostic) -> bool {
    let text = &error.message;
    text.starts_with('/')
        || text.starts_with("byte ")
        || error.span.is_some()
        || text.contains("(line ")
        || text.contains("UTF-8: byte ")
        || text.starts_with("`asset` is missing")
}

/// Whether a message begins with the pointer, the one above or any below it.
fn is_about(message: &str, pointer: &str) -> bool {
    // Faults of the container have no pointer.
    if pointer.is_empty() && message.starts_with("byte ") {
        return true;
    }
    if !message.starts_with('/') {
        return false;
    }
    let place = message.split([' ', ':']).next().unwrap_or_default();
    let within = |inner: &str, outer: &str| {
        inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let above = pointer.rsplit_once('/').map_or("", |(above, _)| above);
    // What is not drawn as a whole is not drawn wrong.
    within(place, pointer) || place == above || within(pointer, place) && message.contains("is not drawn")
}

/// What became of all faults.
#[derive(Default)]
pub(crate) struct Tally {
    refused: BTreeSet<String>,
    noted: BTreeSet<String>,
    /// Files by code and reason.
    allowed: BTreeMap<(String, &'static str), BTreeSet<String>>,
    pub silent: Vec<String>,
    fault_count: usize,
}

impl Tally {
    pub fn add(&mut self, file: &str, fault: &Fault, outcome: Option<Outcome>) {
        self.fault_count += 1;
        match outcome {
            Some(Outcome::Refused) => drop(self.refused.insert(file.to_owned())),
            Some(Outcome::Noted) => drop(self.noted.insert(file.to_owned())),
            Some(Outcome::Allowed(reason)) => {
                self.allowed.entry((fault.code.clone(), reason)).or_default().insert(file.to_owned());
            }
            None => self.silent.push(format!("{file}: {} {}", fault.code, fault.pointer)),
        }
    }

    /// Files with errors.
    pub fn cases(&self) -> usize {
        let allowed = self.allowed.values().flatten();
        let all: BTreeSet<&String> = self.refused.iter().chain(&self.noted).chain(allowed).collect();
        all.len()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let allowed: BTreeSet<&String> = self.allowed.values().flatten().collect();
        write!(
            formatter,
            "{} faults in {} files: {} refused, {} noted, {} with a fault that is allowed, {} faults silent",
            self.fault_count,
            self.cases(),
            self.refused.len(),
            self.noted.len(),
            allowed.len(),
            self.silent.len()
        )?;
        for ((code, reason), files) in &self.allowed {
            write!(formatter, "\n  {code} ({} files): {reason}", files.len())?;
        }
        Ok(())
    }
}

#[test]
fn judge_wants_a_word_about_the_very_place() {
    let fault = Fault { code: "X".into(), pointer: "/nodes/1/mesh".into() };
    let about = |text: &str| judge(&fault, &[Diagnostic::new(Severity::Warning, text)]);
    assert_eq!(about("/nodes/1: wrong"), Some(Outcome::Noted));
    assert_eq!(about("/nodes/1/mesh/x: wrong"), Some(Outcome::Noted));
    assert_eq!(about("/nodes/12: wrong"), None);
    assert_eq!(about("/nodes: wrong"), None);
    assert_eq!(about("something is wrong"), None);
    assert_eq!(judge(&fault, &[Diagnostic::new(Severity::Error, "no place")]), None);
}
