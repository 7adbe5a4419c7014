//! What went wrong, where, why and what to do: the one form of a message to the user.
//!
//! Start at [`Diagnostic`]: built by whoever finds a fault, carried through the action graph and over
//! the wire as data, printed by [`Diagnostic`]'s `Display` in the terminal and by the preview's panel.
//!
//! Conventions: paths are relative to the project and use `/`; lines and columns count from 1, columns
//! in characters; byte offsets count from 0. Texts start in lower case and end without a full stop.
//!
//! Not here: error types of libraries (each crate has its own), exit codes (`kiln`).

use std::fmt;

use serde::{Deserialize, Serialize};

/// How much a diagnostic matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Note,
    /// It works, but not as the author may think.
    Warning,
    /// No artefact was made.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        })
    }
}

/// The source line and columns that a diagnostic points at.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Span {
    /// Line, from 1.
    pub line: u32,
    /// First column, from 1, in characters.
    pub column: u32,
    /// Number of characters underlined, at least 1.
    pub length_chars: u32,
    /// Byte range in the file, for editors.
    pub byte_range: (u32, u32),
    /// The line itself, without its end, at most [`SOURCE_LINE_CHARS_MAX`] characters.
    pub source_line: String,
}

/// Longest source line that a [`Span`] keeps; the rest is cut, so that a minified file stays readable.
pub const SOURCE_LINE_CHARS_MAX: usize = 240;

/// One message to the user.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Diagnostic {
    /// How much it matters.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// The file it is about, relative to the project.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Where in the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub span: Option<Span>,
    /// Why, and by which way (import chains), a line each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What to do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

impl Diagnostic {
    /// A diagnostic of the given severity without a place.
    pub fn new(severity: Severity, message: impl Into<String>) -> Self {
        Diagnostic {
            severity,
            message: message.into(),
            file: None,
            span: None,
            notes: Vec::new(),
            help: None,
        }
    }

    /// An error without a place.
    pub fn error(message: impl Into<String>) -> Self {
        Self::new(Severity::Error, message)
    }

    /// A warning without a place.
    pub fn warning(message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, message)
    }

    /// A note without a place.
    pub fn note(message: impl Into<String>) -> Self {
        Self::new(Severity::Note, message)
    }

    /// Says which file it is about.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<String>) -> Self {
        self.file = Some(file.into());
        self
    }

    /// Says where in `file` it is: `bytes` is a range of `text`, the file's content.
    #[must_use]
    pub fn at(mut self, file: impl Into<String>, text: &str, bytes: std::ops::Range<usize>) -> Self {
        self.file = Some(file.into());
        self.span = Some(Span::new(text, bytes));
        self
    }

    /// Adds a line of explanation.
    #[must_use]
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// Says what to do about it.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Whether this is an error.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

impl Span {
    /// The place of the byte range `bytes` in `text`; ranges past the end or inside a character are moved
    /// to the nearest valid place, because a wrong span must not hide the message it belongs to.
    pub fn new(text: &str, bytes: std::ops::Range<usize>) -> Self {
        let start = floor_char_boundary(text, bytes.start);
        let end = floor_char_boundary(text, bytes.end).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |at| start + at);
        let line = text[..line_start].bytes().filter(|&byte| byte == b'\n').count() + 1;
        let source_line = text[line_start..line_end].trim_end_matches('\r');
        // Some editors put a mark first in a file, and none shows it.
        let column = text[line_start..start].chars().filter(|character| *character != '\u{feff}').count() + 1;
        let length = text[start..end.min(line_end)].chars().count().max(1);
        Span {
            line: saturate(line),
            column: saturate(column),
            length_chars: saturate(length),
            byte_range: (saturate(start), saturate(end)),
            source_line: source_line.chars().take(SOURCE_LINE_CHARS_MAX).collect(),
        }
    }
}

fn saturate(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

fn floor_char_boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0)
}

/// The terminal form:
///
/// ```text
/// error: no definition in scope for identifier `n_dot_vv`
///   --> shaders/pbr/pbr.wgsl:41:9
///    |
/// 41 |     let x = n_dot_vv;
///    |             ^^^^^^^^
///   note: …
///   help: …
/// ```
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.severity, self.message)?;
        match (&self.file, &self.span) {
            (Some(file), Some(span)) => {
                write!(f, "\n  --> {file}:{}:{}", span.line, span.column)?;
                write_excerpt(f, span)?;
            }
            (Some(file), None) => write!(f, "\n  --> {file}")?,
            (None, _) => {}
        }
        for note in &self.notes {
            write!(f, "\n  note: {note}")?;
        }
        if let Some(help) = &self.help {
            write!(f, "\n  help: {help}")?;
        }
        Ok(())
    }
}

fn write_excerpt(f: &mut fmt::Formatter<'_>, span: &Span) -> fmt::Result {
    let number = span.line.to_string();
    let margin = " ".repeat(number.len());
    // A tab before the caret stays a tab, so that both lines are equally wide in any terminal.
    let indent: String = span
        .source_line
        .chars()
        .take(span.column as usize - 1)
        .map(|character| if character == '\t' { '\t' } else { ' ' })
        .collect();
    let visible = span.source_line.chars().count().saturating_sub(span.column as usize - 1).max(1);
    let carets = "^".repeat((span.length_chars as usize).min(visible));
    write!(f, "\n{margin} |\n{number} | {}\n{margin} | {indent}{carets}", span.source_line)
}

/// Whether any diagnostic of the list is an error.
pub fn has_errors(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(Diagnostic::is_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_shows_file_line_source_and_caret() {
        let text = "first\n\tlet ä = wrong;\nlast";
        let at = text.find("wrong").unwrap();
        let diagnostic = Diagnostic::error("unknown name `wrong`")
            .at("shaders/a.wgsl", text, at..at + 5)
            .with_note("imported by shaders/b.wgsl")
            .with_help("declare it");
        let expected = "error: unknown name `wrong`\n  --> shaders/a.wgsl:2:10\n  |\n2 | \tlet ä = wrong;\n  | \t        ^^^^^\n  note: imported by shaders/b.wgsl\n  help: declare it";
        assert_eq!(diagnostic.to_string(), expected);
    }

    #[test]
    fn span_outside_the_text_points_at_its_end() {
        let span = Span::new("ab\ncd", 90..99);
        assert_eq!((span.line, span.column, span.length_chars), (2, 3, 1));
    }

    #[test]
    fn span_inside_a_character_moves_to_its_start() {
        let span = Span::new("ää", 1..3);
        assert_eq!((span.column, span.byte_range), (1, (0, 2)));
    }

    #[test]
    fn span_over_several_lines_underlines_the_first_only() {
        let span = Span::new("abc\ndef", 1..6);
        assert_eq!((span.line, span.length_chars), (1, 2));
    }
}
