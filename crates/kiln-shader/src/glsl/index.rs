//! `a[i++] += b`, `a[f()]++`, `++a[i--].x`: naga evaluates the indices once to read the element and once more to
//! write it. Those of a place with such an index are computed before, left to right, each into a variable of its
//! own: `(k = int(i++), a[k] += b)`.

use std::collections::BTreeSet;
use std::ops::Range;
use std::rc::Rc;

use super::effects;
use super::lazy;
use super::lex::{self, Kind, Token};
use super::source::{Place, Sources};
use super::statement;

/// Most indices of a function that get a variable.
const INDICES_MAX: usize = 256;

/// Rewrites a body whose brackets pair up; `functions` have effects.
pub fn lower(sources: &mut Sources<'_, '_>, functions: &BTreeSet<Rc<str>>, body: &[Token]) -> Vec<Token> {
    let mut tokens = body.to_vec();
    let mut count = 0;
    let mut at = tokens.len();
    while let Some(operator) = at.checked_sub(1) {
        at = operator;
        let Some(update) = Update::of(functions, &tokens, operator) else { continue };
        let written = update.written(&tokens, &mut count);
        if count > INDICES_MAX {
            let message = "too many indices with effects in one function";
            let fault = sources
                .error(tokens[operator].place, message)
                .with_help("compute them in statements of their own");
            sources.diagnostics.push(fault);
            return body.to_vec();
        }
        // Indices may hold more of the kind: they are looked at next.
        at = update.all.start + written.len();
        tokens.splice(update.all, written);
    }
    if let Some(place) = tokens.first().map(|open| open.place).filter(|_| count > 0) {
        let declared = (0..count)
            .flat_map(|number| [word("int", place), word(&variable(number), place), mark(";", place)]);
        tokens.splice(1..1, declared.collect::<Vec<Token>>());
    }
    tokens
}

/// Reports what [`lower`] would rewrite: an initial value has no room for variables.
pub fn check(sources: &mut Sources<'_, '_>, functions: &BTreeSet<Rc<str>>, value: &[Token]) {
    for at in 0..value.len() {
        if Update::of(functions, value, at).is_some() {
            let message = "this reads and writes an element whose index has an effect, in an initial value";
            let fault = sources.error(value[at].place, message).with_help("do it in a function");
            sources.diagnostics.push(fault);
        }
    }
}

fn variable(number: usize) -> String {
    format!("kiln_index_{number}")
}

fn word(text: &str, place: Place) -> Token {
    Token::new(Kind::Word, text, place)
}

fn mark(text: &str, place: Place) -> Token {
    Token::new(Kind::Mark, text, place)
}

/// An expression that reads and writes an element, one index of which has an effect.
struct Update {
    /// The expression.
    all: Range<usize>,
    /// The brackets of its indices.
    indices: Vec<(usize, usize)>,
}

impl Update {
    /// The one whose operator stands at `at`.
    fn of(functions: &BTreeSet<Rc<str>>, tokens: &[Token], at: usize) -> Option<Update> {
        let text = &*tokens[at].text;
        let is_step = text == "++" || text == "--";
        if !(is_step || lazy::is_compound(text)) {
            return None;
        }
        let is_prefix = is_step && tokens.get(at + 1).is_some_and(Token::is_word);
        let (place, all) = if is_prefix {
            let end = statement::place_end(tokens, at + 1);
            (at + 1..end, at..end)
        } else {
            let start = statement::place_start(tokens, at);
            let end = if is_step { at + 1 } else { statement::value_end(tokens, at + 1) };
            (start..at, start..end)
        };
        let mut indices = Vec::new();
        let mut inner = place.start;
        while inner < place.end {
            if let Some(close) =
                Some(inner).filter(|_| tokens[inner].is("[")).and_then(|_| lex::closing(tokens, inner))
            {
                indices.push((inner, close));
                inner = close;
            }
            inner += 1;
        }
        let has_effect = |token: &Token| {
            let text = &*token.text;
            let is_step = text == "++" || text == "--";
            is_step || lazy::is_assignment(text) || effects::is_effect(text) || functions.contains(text)
        };
        let found = indices.iter().any(|(open, close)| tokens[*open..*close].iter().any(has_effect));
        found.then_some(Update { all, indices })
    }

    fn written(&self, tokens: &[Token], count: &mut usize) -> Vec<Token> {
        let place = tokens[self.all.start].place;
        let mut out = vec![mark("(", place)];
        let mut element = Vec::new();
        let mut at = self.all.start;
        for (open, close) in &self.indices {
            let name = word(&variable(*count), tokens[*open].place);
            *count += 1;
            out.extend([name.clone(), mark("=", place), word("int", place), mark("(", place)]);
            out.extend_from_slice(&tokens[open + 1..*close]);
            out.extend([mark(")", place), mark(",", place)]);
            element.extend_from_slice(&tokens[at..=*open]);
            element.push(name);
            at = *close;
        }
        out.extend(element);
        out.extend_from_slice(&tokens[at..self.all.end]);
        out.push(mark(")", place));
        out
    }
}
