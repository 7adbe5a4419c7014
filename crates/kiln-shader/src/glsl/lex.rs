//! Tokens of GLSL, before and after preprocessing.

use std::rc::Rc;

use super::source::Place;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An identifier or keyword.
    Word,
    /// A numeric literal.
    Number,
    /// Punctuation, or a character GLSL does not know.
    Mark,
}

/// A token that knows the place the author is to look at.
#[derive(Clone, Debug)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// Its text.
    pub text: Rc<str>,
    /// Where it stands; for what a macro gave, where the macro was used.
    pub place: Place,
    /// Whether it is the first of its line.
    pub starts_line: bool,
    /// Whether white space or a comment stands before it.
    pub spaced: bool,
    /// Macros that may not expand in it any more, because it came from them.
    pub hidden: Option<Rc<Hidden>>,
}

/// A list of macro names.
#[derive(Debug)]
pub struct Hidden {
    /// The name.
    pub name: Rc<str>,
    /// More of them.
    pub rest: Option<Rc<Hidden>>,
    /// How many there are.
    pub count: usize,
}

impl Token {
    /// A token that Kiln writes, on behalf of `place`.
    pub fn new(kind: Kind, text: impl Into<Rc<str>>, place: Place) -> Token {
        Token { kind, text: text.into(), place, starts_line: false, spaced: true, hidden: None }
    }

    /// Whether it has exactly this text.
    pub fn is(&self, text: &str) -> bool {
        &*self.text == text
    }

    /// Whether it is an identifier or keyword.
    pub fn is_word(&self) -> bool {
        self.kind == Kind::Word
    }
}

/// A block comment without its end: its first byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenComment(pub usize);

/// Punctuation of more than one character, longest first.
const MARKS: [&str; 24] = [
    "<<=", ">>=", "##", "++", "--", "<=", ">=", "==", "!=", "&&", "||", "^^", "<<", ">>", "+=", "-=", "*=",
    "/=", "%=", "&=", "|=", "^=", "::", "->",
];

/// Splits the text of file `file`; comments, white space and line continuations are dropped. Time and
/// memory are linear in its length.
pub fn tokenize(file: usize, text: &str) -> Result<Vec<Token>, OpenComment> {
    let mut tokens = Vec::new();
    let (mut at, mut starts_line, mut spaced) = (0, true, true);
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        if let Some(len) = continuation_len(rest) {
            (at, spaced) = (at + len, true);
        } else if rest.starts_with("//") {
            (at, spaced) = (at + line_comment_len(rest), true);
        } else if let Some(comment) = rest.strip_prefix("/*") {
            let end = comment.find("*/").ok_or(OpenComment(at))?;
            (at, spaced) = (at + end + 4, true);
        } else if first.is_whitespace() || first == '\u{feff}' {
            starts_line |= first == '\n' || first == '\r';
            (at, spaced) = (at + first.len_utf8(), true);
        } else {
            let (kind, len) = token_at(rest, first);
            let place = Place { file, start: at, end: at + len };
            let text = Rc::from(&rest[..len]);
            tokens.push(Token { kind, text, place, starts_line, spaced, hidden: None });
            (at, starts_line, spaced) = (at + len, false, false);
        }
    }
    Ok(tokens)
}

/// Length of a backslash and the line break after it.
fn continuation_len(rest: &str) -> Option<usize> {
    ["\\\r\n", "\\\n"].iter().find(|mark| rest.starts_with(**mark)).map(|mark| mark.len())
}

/// A line comment goes on after a backslash at the end of its line.
fn line_comment_len(rest: &str) -> usize {
    let mut at = 2;
    while let Some(found) = rest[at..].find(['\n', '\\']) {
        at += found;
        match continuation_len(&rest[at..]) {
            Some(len) => at += len,
            None if rest[at..].starts_with('\n') => return at,
            None => at += 1,
        }
    }
    rest.len()
}

fn token_at(rest: &str, first: char) -> (Kind, usize) {
    let second_is_digit = rest.as_bytes().get(1).is_some_and(u8::is_ascii_digit);
    if first.is_ascii_alphabetic() || first == '_' {
        let len = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
        (Kind::Word, len)
    } else if first.is_ascii_digit() || (first == '.' && second_is_digit) {
        (Kind::Number, number_len(rest))
    } else {
        let mark = MARKS.iter().find(|mark| rest.starts_with(**mark));
        (Kind::Mark, mark.map_or(first.len_utf8(), |mark| mark.len()))
    }
}

/// Length of a numeric literal; a sign belongs to it only right after the exponent letter of a decimal.
fn number_len(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let is_hex = rest.starts_with("0x") || rest.starts_with("0X");
    let mut at = 1;
    while at < bytes.len() {
        let after_exponent = matches!(bytes[at - 1], b'e' | b'E') && !is_hex;
        let sign = matches!(bytes[at], b'+' | b'-') && after_exponent;
        if !(bytes[at].is_ascii_alphanumeric() || bytes[at] == b'.' || sign) {
            break;
        }
        at += 1;
    }
    at
}

/// Index of the bracket that closes the one at `open`, if there is one and brackets pair up.
pub fn closing(tokens: &[Token], open: usize) -> Option<usize> {
    tokens.get(open).filter(|token| ["(", "[", "{"].iter().any(|mark| token.is(mark)))?;
    let mut depth = 0_usize;
    for (index, token) in tokens.iter().enumerate().skip(open) {
        match &*token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth = depth.checked_sub(1)?,
            _ => {}
        }
        if depth == 0 {
            return Some(index);
        }
    }
    None
}

/// Index of the bracket that the one at `close` closes, if brackets pair up.
pub fn opening(tokens: &[Token], close: usize) -> Option<usize> {
    let mut depth = 0_usize;
    for (index, token) in tokens.iter().enumerate().take(close + 1).rev() {
        match &*token.text {
            ")" | "]" | "}" => depth += 1,
            "(" | "[" | "{" => depth = depth.checked_sub(1)?,
            _ => {}
        }
        if depth == 0 {
            return Some(index);
        }
    }
    None
}

/// Splits at the commas outside of all brackets; nothing gives nothing.
pub fn split_commas(tokens: &[Token]) -> Vec<&[Token]> {
    let mut parts = Vec::new();
    let (mut depth, mut start) = (0_usize, 0);
    for (index, token) in tokens.iter().enumerate() {
        match &*token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth = depth.saturating_sub(1),
            "," if depth == 0 => {
                parts.push(&tokens[start..index]);
                start = index + 1;
            }
            _ => {}
        }
    }
    if start < tokens.len() || !parts.is_empty() {
        parts.push(&tokens[start..]);
    }
    parts
}
