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

/// Words after which a value may begin.
const KEYWORDS: [&str; 8] = ["return", "else", "do", "case", "if", "while", "for", "switch"];

/// Where the name begins whose member, element or call ends before `end`; or the parenthesis.
pub fn place_start(tokens: &[Token], end: usize) -> usize {
    let mut start = end;
    loop {
        let mut is_open = true;
        while let Some(before) = start.checked_sub(1).filter(|_| is_open) {
            // Nothing stands before a parenthesis but a name or the brackets of a type.
            is_open = tokens[before].is("]");
            let is_group = is_open || (tokens[before].is(")") && (start == end || !tokens[start].is("(")));
            match Some(before).filter(|_| is_group).and_then(|before| lex::opening(tokens, before)) {
                Some(open) => start = open,
                None => break,
            }
        }
        let is_name = |token: &Token| token.is_word() && !KEYWORDS.contains(&&*token.text);
        if start.checked_sub(1).is_some_and(|before| is_name(&tokens[before])) {
            start -= 1;
        }
        match start.checked_sub(1).filter(|before| tokens[*before].is(".")) {
            Some(before) => start = before,
            None => return start,
        }
    }
}

/// Index after the name or parenthesis at `at` and all members, elements and calls that follow.
pub fn place_end(tokens: &[Token], at: usize) -> usize {
    let mut end = at;
    if tokens.get(at).is_some_and(Token::is_word) {
        end += 1;
    }
    while let Some(token) = tokens.get(end) {
        match &*token.text {
            "." => end += 2,
            "[" | "(" => end = lex::closing(tokens, end).map_or(tokens.len(), |close| close + 1),
            _ => break,
        }
    }
    end.min(tokens.len())
}

/// Index after the value that begins at `at`: assignments bind looser than `?:` and tighter than commas.
pub fn value_end(tokens: &[Token], at: usize) -> usize {
    let mut choices = 0_usize;
    let mut end = at;
    while let Some(token) = tokens.get(end) {
        match &*token.text {
            "(" | "[" | "{" => end = lex::closing(tokens, end).unwrap_or(tokens.len()),
            ")" | "]" | "}" | "," | ";" => break,
            "?" => choices += 1,
            ":" if choices == 0 => break,
            ":" => choices -= 1,
            _ => {}
        }
        end += 1;
    }
    end.min(tokens.len())
}
