//! Conditions `@if(…)`, `@elif(…)`, `@else` before declarations, members, parameters and statements.
//!
//! They are decided on tokens, before naga sees the text. The syntax is that of WESL's conditional
//! translation (wesl-lang/wesl-spec, ConditionalTranslation.md), without conditions on expressions.

use std::collections::BTreeSet;
use std::ops::Range;

use kiln_diagnostic::Diagnostic;

use crate::token::{Kind, Token};

/// Which branches are kept.
#[derive(Clone, Copy, Debug)]
pub enum Mode<'a> {
    /// Those that hold for this feature set.
    Features(&'a BTreeSet<String>),
    /// All of them: for finding every file that could matter.
    Everything,
}

/// What conditions cut from a module.
#[derive(Debug, Default)]
pub struct Decided {
    /// Byte ranges to leave out, sorted by start; they may nest.
    pub cuts: Vec<Range<usize>>,
    /// Tokens that stay.
    pub kept: Vec<Token>,
    /// Features that any condition names.
    pub features: BTreeSet<String>,
}

/// Decides all conditions of a module whose brackets pair up. Faults inside branches that are cut are
/// reported too, so that a module is right for all feature sets or for none.
pub fn decide(
    file: &str,
    text: &str,
    tokens: &[Token],
    mode: Mode<'_>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Decided {
    let mut scan = Scan { file, text, tokens, mode, out: Decided::default(), chains: Vec::new() };
    let mut scopes = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        match scan.directive_at(at) {
            Some(word) => match scan.conditional(at, word, scopes.last().copied()) {
                Ok(next) => at = next,
                Err(diagnostic) => {
                    diagnostics.push(*diagnostic);
                    at += 2;
                }
            },
            None => {
                track_scope(text, tokens, at, &mut scopes);
                at += 1;
            }
        }
    }
    let mut out = scan.out;
    out.cuts.sort_by_key(|cut| (cut.start, std::cmp::Reverse(cut.end)));
    out.kept = without(tokens, &out.cuts);
    out
}

/// What stands between a pair of brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scope {
    /// Statements.
    Block,
    /// Members of a struct or parameters of a function, separated by commas.
    List,
    /// Anything else; no condition may stand here.
    Other,
}

/// An `@if` chain whose last element has ended: `@else` may follow there.
struct Chain {
    /// Index of the token after the element.
    next: usize,
    /// Whether a branch was taken.
    taken: bool,
}

struct Scan<'a> {
    file: &'a str,
    text: &'a str,
    tokens: &'a [Token],
    mode: Mode<'a>,
    out: Decided,
    chains: Vec<Chain>,
}

type Fault = Box<Diagnostic>;

impl<'a> Scan<'a> {
    fn word(&self, at: usize) -> Option<&'a str> {
        let token = self.tokens.get(at).filter(|token| token.kind == Kind::Word)?;
        Some(&self.text[token.range()])
    }

    fn is(&self, at: usize, mark: char) -> bool {
        self.tokens.get(at).is_some_and(|token| token.is(mark))
    }

    /// The condition's keyword if one starts at token `at`.
    fn directive_at(&self, at: usize) -> Option<&'a str> {
        if !self.is(at, '@') {
            return None;
        }
        self.word(at + 1).filter(|word| matches!(*word, "if" | "elif" | "else"))
    }

    fn fault(&self, at: usize, message: impl Into<String>) -> Fault {
        let end = self.text.len();
        let range = self.tokens.get(at).map_or(end..end, Token::range);
        Box::new(Diagnostic::error(message).at(self.file, self.text, range))
    }

    /// Decides the condition at token `at`; returns the token to go on with, the element's first.
    fn conditional(&mut self, at: usize, word: &str, scope: Option<Scope>) -> Result<usize, Fault> {
        let position = self.chains.iter().position(|chain| chain.next == at);
        let taken_before = position.map(|index| self.chains.swap_remove(index).taken);
        // The scan goes forward, so nothing can follow chains that ended earlier.
        self.chains.retain(|chain| chain.next > at);
        if word != "if" && taken_before.is_none() {
            return Err(self.misplaced_else(at, word));
        }
        let (holds, element) =
            if word == "else" { (true, at + 2) } else { self.parenthesized(at + 2, at + 1)? };
        if self.directive_at(element).is_some() {
            let fault = self.fault(element + 1, "a second condition on the same element");
            return Err(Box::new(fault.with_help("join them with `&&`")));
        }
        let end = self.element_end(at, element, scope)?;
        let taken_before = word != "if" && taken_before.unwrap_or(false);
        let keep = matches!(self.mode, Mode::Everything) || (holds && !taken_before);
        let last = if keep { element } else { end };
        self.out.cuts.push(self.tokens[at].start..self.tokens[last - 1].end);
        if word != "else" {
            self.chains.push(Chain { next: end, taken: taken_before || holds });
        }
        Ok(element)
    }

    fn misplaced_else(&self, at: usize, word: &str) -> Fault {
        let fault = self.fault(at + 1, format!("`@{word}` without an `@if` before it"));
        Box::new(fault.with_help("it must follow directly after the element that has the `@if`"))
    }

    /// Evaluates `( condition )`; returns its value and the token after it.
    fn parenthesized(&mut self, at: usize, keyword: usize) -> Result<(bool, usize), Fault> {
        if !self.is(at, '(') {
            let fault = self.fault(keyword, "this condition has no parentheses");
            return Err(Box::new(fault.with_help("write `@if(feature)`")));
        }
        let (value, next) = self.any_of(at + 1)?;
        if !self.is(next, ')') {
            let fault = self.fault(next, "expected `&&`, `||` or `)` in a condition");
            return Err(Box::new(
                fault.with_help("conditions are made of feature names, `!`, `&&`, `||` and parentheses"),
            ));
        }
        Ok((value, next + 1))
    }

    fn any_of(&mut self, at: usize) -> Result<(bool, usize), Fault> {
        let (mut value, mut at) = self.all_of(at)?;
        while self.is(at, '|') && self.is(at + 1, '|') {
            let (right, next) = self.all_of(at + 2)?;
            (value, at) = (value | right, next);
        }
        Ok((value, at))
    }

    fn all_of(&mut self, at: usize) -> Result<(bool, usize), Fault> {
        let (mut value, mut at) = self.term(at)?;
        while self.is(at, '&') && self.is(at + 1, '&') {
            let (right, next) = self.term(at + 2)?;
            (value, at) = (value & right, next);
        }
        Ok((value, at))
    }

    /// Recursion is bounded by the nesting limit, checked before.
    fn term(&mut self, mut at: usize) -> Result<(bool, usize), Fault> {
        let mut negated = false;
        while self.is(at, '!') {
            (negated, at) = (!negated, at + 1);
        }
        let (value, next) = if self.is(at, '(') {
            self.parenthesized(at, at)?
        } else {
            let name = self.word(at).ok_or_else(|| self.fault(at, "expected a feature name"))?;
            (self.feature(name), at + 1)
        };
        Ok((value != negated, next))
    }

    fn feature(&mut self, name: &str) -> bool {
        match (name, self.mode) {
            ("true", _) => true,
            ("false", _) => false,
            (name, mode) => {
                self.out.features.insert(name.to_owned());
                match mode {
                    Mode::Features(features) => features.contains(name),
                    Mode::Everything => true,
                }
            }
        }
    }

    /// Index of the token after the element that starts at `element`.
    fn element_end(&self, at: usize, element: usize, scope: Option<Scope>) -> Result<usize, Fault> {
        let end = match scope {
            None | Some(Scope::Block) => self.statement_end(element),
            Some(Scope::List) => self.list_item_end(element),
            Some(Scope::Other) => {
                let fault = self.fault(at + 1, "a condition cannot stand here");
                return Err(Box::new(fault.with_help(
                    "conditions stand before declarations, struct members, parameters and statements",
                )));
            }
        };
        end.filter(|end| *end > element)
            .ok_or_else(|| self.fault(at + 1, "nothing follows this condition that it could apply to"))
    }

    /// Statements and declarations end with `;` or with a `}` that no `else` follows.
    fn statement_end(&self, element: usize) -> Option<usize> {
        let is_import = self.word(element) == Some("import");
        let mut depth = 0_usize;
        for (index, token) in self.tokens.iter().enumerate().skip(element) {
            match token.kind {
                Kind::Mark('(' | '[' | '{') => depth += 1,
                Kind::Mark(mark @ (')' | ']' | '}')) => {
                    depth = depth.checked_sub(1)?;
                    let block_ends = mark == '}' && depth == 0 && !is_import;
                    if block_ends && self.word(index + 1) != Some("else") {
                        return Some(index + 1);
                    }
                }
                Kind::Mark(';') if depth == 0 => return Some(index + 1),
                _ => {}
            }
        }
        None
    }

    /// Members and parameters end after their `,` or before the list's closing bracket.
    fn list_item_end(&self, element: usize) -> Option<usize> {
        let (mut depth, mut angles) = (0_usize, 0_usize);
        for (index, token) in self.tokens.iter().enumerate().skip(element) {
            match token.kind {
                Kind::Mark('(' | '[' | '{') => depth += 1,
                Kind::Mark(')' | ']' | '}') if depth == 0 => return Some(index),
                Kind::Mark(')' | ']' | '}') => depth -= 1,
                Kind::Mark('<') if depth == 0 => angles += 1,
                Kind::Mark('>') if depth == 0 => angles = angles.saturating_sub(1),
                Kind::Mark(',') if depth == 0 && angles == 0 => return Some(index + 1),
                _ => {}
            }
        }
        None
    }
}

fn track_scope(text: &str, tokens: &[Token], at: usize, scopes: &mut Vec<Scope>) {
    let two_before = at.checked_sub(2).map(|index| tokens[index]);
    let follows = |word: &str| two_before.is_some_and(|token| token.is_word(text, word));
    match tokens[at].kind {
        Kind::Mark('{') => scopes.push(if follows("struct") { Scope::List } else { Scope::Block }),
        Kind::Mark('(') => scopes.push(if follows("fn") { Scope::List } else { Scope::Other }),
        Kind::Mark('[') => scopes.push(Scope::Other),
        Kind::Mark(')' | ']' | '}') => {
            scopes.pop();
        }
        _ => {}
    }
}

/// The tokens outside of all `cuts`, which are sorted by start.
fn without(tokens: &[Token], cuts: &[Range<usize>]) -> Vec<Token> {
    let mut cuts = cuts.iter().peekable();
    let mut cut_end = 0;
    let mut kept = Vec::with_capacity(tokens.len());
    for token in tokens {
        while let Some(cut) = cuts.next_if(|cut| cut.start <= token.start) {
            cut_end = cut_end.max(cut.end);
        }
        if token.start >= cut_end {
            kept.push(*token);
        }
    }
    kept
}
