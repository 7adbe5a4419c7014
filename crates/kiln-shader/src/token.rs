//! Tokens of a WGSL module: just enough grammar to find imports, conditions, declarations and brackets.

use std::ops::Range;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An identifier or keyword.
    Word,
    /// A numeric literal.
    Number,
    /// One character of punctuation, or a character WGSL does not know.
    Mark(char),
}

/// A token and its byte range in the module's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// First byte.
    pub start: usize,
    /// Byte after the last.
    pub end: usize,
}

impl Token {
    /// Byte range.
    pub fn range(&self) -> Range<usize> {
        self.start..self.end
    }

    /// Whether it is the punctuation character `mark`.
    pub fn is(&self, mark: char) -> bool {
        self.kind == Kind::Mark(mark)
    }

    /// Whether it is the word `word` of `text`.
    pub fn is_word(&self, text: &str, word: &str) -> bool {
        self.kind == Kind::Word && &text[self.range()] == word
    }
}

/// What some editors put first in a file; WGSL does not know it.
pub const BYTE_ORDER_MARK: char = '\u{feff}';

/// A block comment without its end: where it starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenComment(pub usize);

/// Splits `text` into tokens; comments and white space are dropped. Time and memory are linear in its length.
pub fn tokenize(text: &str) -> Result<Vec<Token>, OpenComment> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        if rest.starts_with("//") {
            at += rest.find(is_line_break).unwrap_or(rest.len());
        } else if rest.starts_with("/*") {
            at += block_comment_len(rest).ok_or(OpenComment(at))?;
        } else if first.is_whitespace() || matches!(first, '\u{200e}' | '\u{200f}' | BYTE_ORDER_MARK) {
            at += first.len_utf8();
        } else {
            let (kind, len) = token_at(rest, first);
            tokens.push(Token { kind, start: at, end: at + len });
            at += len;
        }
    }
    Ok(tokens)
}

/// Line breaks of the WGSL specification (section 3.2, blankspace and line breaks).
fn is_line_break(character: char) -> bool {
    matches!(character, '\n'..='\r' | '\u{85}' | '\u{2028}' | '\u{2029}')
}

/// Length of the block comment that `text` starts with; WGSL's block comments nest.
fn block_comment_len(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut depth, mut at) = (0_usize, 0);
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

fn token_at(rest: &str, first: char) -> (Kind, usize) {
    let second_is_digit = rest.as_bytes().get(1).is_some_and(u8::is_ascii_digit);
    if first.is_alphabetic() || first == '_' {
        let len = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        (Kind::Word, len)
    } else if first.is_ascii_digit() || (first == '.' && second_is_digit) {
        (Kind::Number, number_len(rest))
    } else {
        (Kind::Mark(first), first.len_utf8())
    }
}

/// Length of a numeric literal; a sign belongs to it only right after an exponent letter.
fn number_len(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let is_hex = rest.starts_with("0x") || rest.starts_with("0X");
    let mut at = 1;
    while at < bytes.len() {
        let exponent = match bytes[at - 1] {
            b'e' | b'E' => !is_hex,
            b'p' | b'P' => is_hex,
            _ => false,
        };
        let sign = matches!(bytes[at], b'+' | b'-');
        if !(bytes[at].is_ascii_alphanumeric() || bytes[at] == b'.' || (sign && exponent)) {
            break;
        }
        at += 1;
    }
    at
}
