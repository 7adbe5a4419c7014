//! Where statements end.

use super::lex::{self, Token};
use super::source::Place;

/// The `,`, `;` or closing bracket after the declarator at `name`.
pub fn declarator_end(tokens: &[Token], name: usize) -> usize {
    let mut depth = 0_usize;
    for (index, token) in tokens.iter().enumerate().skip(name) {
        match &*token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" if depth == 0 => return index,
            ")" | "]" | "}" => depth -= 1,
            "," | ";" if depth == 0 => return index,
            _ => {}
        }
    }
    tokens.len()
}

/// Index after the next `;` outside of brackets.
pub fn end(tokens: &[Token], mut at: usize) -> usize {
    while at < tokens.len() {
        at = declarator_end(tokens, at);
        if tokens.get(at).is_none_or(|token| !token.is(",")) {
            return at + 1;
        }
        at += 1;
    }
    at
}

/// Index after the braces of the loop at `at`, if its body has braces.
fn body_end(tokens: &[Token], at: usize) -> Option<usize> {
    let open = if tokens[at].is("do") { at + 1 } else { lex::closing(tokens, at + 1)? + 1 };
    tokens.get(open).filter(|token| token.is("{"))?;
    Some(lex::closing(tokens, open)? + 1)
}

/// `continue` statements of the `do` loop at `at`, without those of loops in it that have braces.
pub fn continues_of_do(tokens: &[Token], at: usize) -> Vec<Place> {
    let open = tokens.get(at + 1).filter(|open| open.is("{"));
    let Some(close) = open.and_then(|_| lex::closing(tokens, at + 1)) else { return Vec::new() };
    let mut found = Vec::new();
    let mut inner = at + 2;
    while inner < close {
        let token = &tokens[inner];
        if token.is("continue") {
            found.push(token.place);
        }
        let is_loop = ["for", "while", "do"].iter().any(|word| token.is(word));
        let end = if is_loop { body_end(tokens, inner) } else { None };
        inner = end.unwrap_or(0).max(inner + 1);
    }
    found
}
