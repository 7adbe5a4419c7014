//! The one error of this crate and its way into a [`Diagnostic`].

use std::ops::Range;

use kiln_diagnostic::{Diagnostic, Severity};

use crate::locate::locate;

/// Why a file is not a scene: what is wrong, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{reason}", if pointer.is_empty() { String::new() } else { format!("{pointer}: ") })]
pub struct SceneError {
    /// JSON pointer of the culprit, empty for the whole file.
    pub pointer: String,
    /// What is wrong, with limit and actual value.
    pub reason: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Bytes of the JSON text, where the pointer alone does not say it.
    pub json_bytes: Option<Range<usize>>,
}

impl SceneError {
    pub(crate) fn new(pointer: impl Into<String>, reason: impl Into<String>) -> Self {
        SceneError { pointer: pointer.into(), reason: reason.into(), help: None, json_bytes: None }
    }

    pub(crate) fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// `text` is the JSON when it is the file itself, so that an editor can jump there; the chunk inside a
    /// GLB has no lines worth showing.
    pub(crate) fn into_diagnostic(self, severity: Severity, file: &str, text: Option<&str>) -> Diagnostic {
        let diagnostic = Diagnostic::new(severity, self.to_string());
        let range = |text: &str| self.json_bytes.clone().or_else(|| locate(text, non_empty(&self.pointer)?));
        let diagnostic = match text.and_then(|text| Some((text, range(text)?))) {
            Some((text, range)) => diagnostic.at(file, text, range),
            None => diagnostic.in_file(file),
        };
        match self.help {
            Some(help) => diagnostic.with_help(help),
            None => diagnostic,
        }
    }
}

fn non_empty(pointer: &str) -> Option<&str> {
    (!pointer.is_empty()).then_some(pointer)
}
