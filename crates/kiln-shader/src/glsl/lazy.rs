//! What naga evaluates too often: both operands of `&&` and `||`, though the right one may not be reached. Such a
//! right operand with effects goes into `?:`, which naga keeps lazy.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::effects;
use super::lex::{Kind, Token};
use super::source::Place;

/// An operator whose right operand is not over.
#[derive(Clone, Copy)]
struct Open {
    /// Where the left operand starts.
    left: usize,
    /// Index of the operator.
    at: usize,
    /// Whether the right operand has effects.
    has_effects: bool,
}

/// What stands between two brackets.
#[derive(Default)]
struct Frame {
    /// Index of the opening bracket.
    bracket: usize,
    /// Start of the current expression.
    start: usize,
    /// Start of the current operand of `||`.
    operand: usize,
    and: Option<Open>,
    or: Option<Open>,
    has_effects: bool,
}

impl Frame {
    fn new(bracket: usize, start: usize) -> Frame {
        Frame { bracket, start, operand: start, ..Frame::default() }
    }

    fn effect(&mut self) {
        self.has_effects = true;
        for open in self.and.iter_mut().chain(&mut self.or) {
            open.has_effects = true;
        }
    }
}

/// Text to add, and operators to replace.
#[derive(Default)]
struct Edits {
    before: BTreeMap<usize, Vec<&'static str>>,
    instead: BTreeMap<usize, &'static [&'static str]>,
}

impl Edits {
    /// The right operand of `open` ends before token `end`.
    fn close(&mut self, open: Option<Open>, end: usize, is_and: bool) {
        let Some(open) = open.filter(|open| open.has_effects) else { return };
        self.before.entry(open.left).or_default().extend(["(", "("]);
        let (between, after): (&'static [&str], &[&str]) = if is_and {
            (&[")", "?", "("], &[")", ":", "false", ")"])
        } else {
            (&[")", "?", "true", ":", "("], &[")", ")"])
        };
        self.instead.insert(open.at, between);
        self.before.entry(end).or_default().extend(after);
    }

    fn close_both(&mut self, frame: &mut Frame, end: usize) {
        self.close(frame.and.take(), end, true);
        self.close(frame.or.take(), end, false);
    }
}

/// Rewrites a body or an initial value; `functions` have effects.
pub fn lower(functions: &BTreeSet<Rc<str>>, tokens: &[Token]) -> Vec<Token> {
    let mut edits = Edits::default();
    let mut frames = vec![Frame::new(0, 0)];
    for (at, token) in tokens.iter().enumerate() {
        let Some(frame) = frames.last_mut() else { return tokens.to_vec() };
        match &*token.text {
            "(" | "[" | "{" => frames.push(Frame::new(at, at + 1)),
            ")" | "]" | "}" => {
                edits.close_both(frame, at);
                let Some(inner) = frames.pop() else { return tokens.to_vec() };
                let Some(frame) = frames.last_mut() else { return tokens.to_vec() };
                if inner.has_effects {
                    frame.effect();
                }
                let head = inner.bracket.checked_sub(1).map(|before| &*tokens[before].text);
                if token.is("}") || matches!(head, Some("if" | "while" | "for" | "switch")) {
                    (frame.start, frame.operand) = (at + 1, at + 1);
                }
            }
            "&&" => {
                edits.close(frame.and.take(), at, true);
                frame.and = Some(Open { left: frame.operand, at, has_effects: false });
            }
            "^^" => {
                edits.close(frame.and.take(), at, true);
                frame.operand = at + 1;
            }
            "||" => {
                edits.close_both(frame, at);
                frame.or = Some(Open { left: frame.start, at, has_effects: false });
                frame.operand = at + 1;
            }
            "++" | "--" => frame.effect(),
            "return" | "else" | "do" => (frame.start, frame.operand) = (at + 1, at + 1),
            text if is_assignment(text) || matches!(text, "," | ";" | "?" | ":") => {
                edits.close_both(frame, at);
                (frame.start, frame.operand) = (at + 1, at + 1);
                if is_assignment(text) {
                    frame.effect();
                }
            }
            text if effects::is_effect(text) || functions.contains(text) => frame.effect(),
            _ => {}
        }
    }
    if let Some(frame) = frames.last_mut() {
        edits.close_both(frame, tokens.len());
    }
    written(tokens, &edits)
}

/// Whether `text` assigns.
pub fn is_assignment(text: &str) -> bool {
    text == "=" || is_compound(text)
}

/// Whether `text` reads and writes its left operand.
pub fn is_compound(text: &str) -> bool {
    matches!(text, "+=" | "-=" | "*=" | "/=" | "%=" | "&=" | "|=" | "^=" | "<<=" | ">>=")
}

fn written(tokens: &[Token], edits: &Edits) -> Vec<Token> {
    let text = |text: &&'static str, place: Place| {
        let kind = if text.starts_with(|c: char| c.is_ascii_alphabetic()) { Kind::Word } else { Kind::Mark };
        Token::new(kind, *text, place)
    };
    let mut out = Vec::with_capacity(tokens.len());
    for (at, token) in tokens.iter().enumerate() {
        let before = edits.before.get(&at).into_iter().flatten();
        // Parentheses open before what is here, and close after what was.
        out.extend(before.map(|word| text(word, token.place)));
        match edits.instead.get(&at) {
            Some(texts) => out.extend(texts.iter().map(|word| text(word, token.place))),
            None => out.push(token.clone()),
        }
    }
    if let (Some(last), Some(after)) = (tokens.last(), edits.before.get(&tokens.len())) {
        out.extend(after.iter().map(|word| text(word, last.place)));
    }
    out
}
