//! Files of a GLSL program, how they were included, and places in them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Severity, Span};

use crate::link::Read;
use crate::{Dependency, limits};

/// Most diagnostics of a program; nobody reads more.
pub const DIAGNOSTICS_MAX: usize = 200;

/// Bytes of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Index of the file in [`Sources`].
    pub file: usize,
    /// First byte.
    pub start: usize,
    /// Byte after the last.
    pub end: usize,
}

impl Place {
    /// From here to the end of `last`, if that is later in the same file; else this place.
    pub fn to(self, last: Place) -> Place {
        if last.file == self.file && last.end >= self.end { Place { end: last.end, ..self } } else { self }
    }
}

/// A file as often as it was included: each time has its own chain.
#[derive(Debug)]
pub struct File {
    /// Path relative to the project.
    pub path: String,
    /// Its text.
    pub text: Arc<str>,
    /// The `#include` that led here.
    pub included_by: Option<Place>,
}

/// All files of a program. Reads each path at most once.
pub struct Sources<'a, 'r> {
    /// Files in the order of inclusion.
    pub files: Vec<File>,
    /// Files looked at, in that order.
    pub dependencies: Vec<Dependency>,
    /// What is wrong, in the order of finding.
    pub diagnostics: Vec<Diagnostic>,
    known: BTreeMap<String, Option<Arc<str>>>,
    read: &'a mut Read<'r>,
}

impl<'a, 'r> Sources<'a, 'r> {
    /// No files yet.
    pub fn new(read: &'a mut Read<'r>) -> Self {
        let (files, dependencies, diagnostics) = (Vec::new(), Vec::new(), Vec::new());
        Sources { files, dependencies, diagnostics, known: BTreeMap::new(), read }
    }

    /// The text of `path`; notes it as a dependency, found or not.
    pub fn look_up(&mut self, path: &str) -> Option<Arc<str>> {
        if let Some(known) = self.known.get(path) {
            return known.clone();
        }
        let text = (self.read)(path);
        self.dependencies.push(Dependency { path: path.to_owned(), found: text.is_some() });
        self.known.insert(path.to_owned(), text.clone());
        text
    }

    /// Adds a file; returns its index. Reports text that is too long or not text, and takes it as empty.
    pub fn add(&mut self, path: &str, text: Arc<str>, included_by: Option<Place>) -> usize {
        let fault = if text.len() > limits::MODULE_BYTES_MAX {
            Some(format!("file has {} bytes, the limit is {}", text.len(), limits::MODULE_BYTES_MAX))
        } else if text.contains(['\0', char::REPLACEMENT_CHARACTER]) {
            Some("this is not a UTF-8 text".to_owned())
        } else {
            None
        };
        let text = if fault.is_some() { Arc::from("") } else { text };
        let index = self.files.len();
        self.files.push(File { path: path.to_owned(), text, included_by });
        if let Some(message) = fault {
            let mut diagnostic = Diagnostic::error(message).in_file(path);
            diagnostic.notes = self.chain(index);
            self.diagnostics.push(diagnostic);
        }
        index
    }

    /// An error at `place`, with the chain of includes.
    pub fn error(&self, place: Place, message: impl Into<String>) -> Diagnostic {
        self.diagnostic(Severity::Error, place, message)
    }

    /// A warning at `place`, with the chain of includes.
    pub fn warning(&self, place: Place, message: impl Into<String>) -> Diagnostic {
        self.diagnostic(Severity::Warning, place, message)
    }

    fn diagnostic(&self, severity: Severity, place: Place, message: impl Into<String>) -> Diagnostic {
        let file = &self.files[place.file];
        if self.diagnostics.len() >= DIAGNOSTICS_MAX {
            // It will be dropped: finding its line would only take time.
            return Diagnostic::new(severity, message).in_file(&file.path);
        }
        let mut diagnostic =
            Diagnostic::new(severity, message).at(&file.path, &file.text, place.start..place.end);
        diagnostic.notes = self.chain(place.file);
        diagnostic
    }

    /// `included from …` from file `index` up to the root.
    fn chain(&self, index: usize) -> Vec<String> {
        let mut notes = Vec::new();
        let mut at = index;
        while let Some(place) = self.files[at].included_by {
            let file = &self.files[place.file];
            let line = Span::new(&file.text, place.start..place.end).line;
            notes.push(format!("included from {}:{line}", file.path));
            at = place.file;
        }
        notes
    }

    /// `file:line:column`
    pub fn describe(&self, place: Place) -> String {
        let file = &self.files[place.file];
        let span = Span::new(&file.text, place.start..place.end);
        format!("{}:{}:{}", file.path, span.line, span.column)
    }
}

/// Text made of pieces that each know their place.
#[derive(Debug, Default)]
pub struct Mapped {
    /// The text.
    pub text: String,
    /// First byte of each piece in the text, and what it came from.
    pieces: Vec<(usize, Place)>,
}

impl Mapped {
    /// Appends `piece`, that came from `place`.
    pub fn push(&mut self, piece: &str, place: Place) {
        self.pieces.push((self.text.len(), place));
        self.text.push_str(piece);
    }

    /// Appends all of `other`.
    pub fn append(&mut self, other: Mapped) {
        let start = self.text.len();
        self.pieces.extend(other.pieces.into_iter().map(|(at, place)| (at + start, place)));
        self.text.push_str(&other.text);
    }

    /// Where `range` of the text came from.
    pub fn origin(&self, range: Range<usize>) -> Option<Place> {
        let first = self.piece_at(range.start)?;
        let last = self.piece_at(range.end.saturating_sub(1).max(range.start))?;
        Some(first.to(last))
    }

    fn piece_at(&self, at: usize) -> Option<Place> {
        let after = self.pieces.partition_point(|(start, _)| *start <= at);
        self.pieces.get(after.checked_sub(1)?).map(|(_, place)| *place)
    }
}
