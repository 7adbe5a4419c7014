//! `switch` without falling through, which WGSL has not: a case gets a copy of those that it falls into.

use super::lex::{self, Kind, Token};
use super::source::Sources;

/// Most tokens that the copies of one function may have.
const COPIED_TOKENS_MAX: usize = 1 << 12;

/// Rewrites all `switch` statements of a body whose brackets pair up, the inner ones first.
pub fn without_fall_through(sources: &mut Sources<'_, '_>, body: &[Token]) -> Vec<Token> {
    let mut tokens = body.to_vec();
    let mut copied = 0;
    for at in (0..tokens.len()).rev() {
        if !tokens[at].is("switch") {
            continue;
        }
        let Some(open) = lex::closing(&tokens, at + 1).map(|close| close + 1) else { continue };
        let Some(close) =
            tokens.get(open).filter(|open| open.is("{")).and_then(|_| lex::closing(&tokens, open))
        else {
            continue;
        };
        let inner = cases(&tokens[open + 1..close]);
        let written = written(&inner);
        copied += written.len().saturating_sub(close - open - 1);
        if copied > COPIED_TOKENS_MAX {
            let fault = sources.error(tokens[at].place, "too many cases fall through");
            sources
                .diagnostics
                .push(fault.with_help("end cases with `break`, and call a function for what they share"));
            return body.to_vec();
        }
        tokens.splice(open + 1..close, written);
    }
    tokens
}

/// Labels with the statements after them.
struct Case {
    labels: Vec<Token>,
    body: Vec<Token>,
}

/// Splits what stands between the braces.
fn cases(tokens: &[Token]) -> Vec<Case> {
    let mut found: Vec<Case> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let token = &tokens[at];
        if token.is("case") || token.is("default") {
            let end = (at..tokens.len()).find(|end| tokens[*end].is(":")).unwrap_or(tokens.len() - 1);
            if found.last().is_none_or(|case| !case.body.is_empty()) {
                found.push(Case { labels: Vec::new(), body: Vec::new() });
            }
            if let Some(case) = found.last_mut() {
                case.labels.extend_from_slice(&tokens[at..=end]);
            }
            at = end + 1;
            continue;
        }
        let end = if token.is("{") { lex::closing(tokens, at).unwrap_or(at) } else { at };
        if let Some(case) = found.last_mut() {
            case.body.extend_from_slice(&tokens[at..=end]);
        }
        at = end + 1;
    }
    found
}

fn written(cases: &[Case]) -> Vec<Token> {
    let mut out = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        out.extend_from_slice(&case.labels);
        let last = cases[index..].iter().position(|case| ends(&case.body));
        let fallen = &cases[index..last.map_or(cases.len(), |last| index + last + 1)];
        for case in fallen {
            out.extend_from_slice(&case.body);
            if out.len() > 2 * COPIED_TOKENS_MAX {
                return out;
            }
        }
        let place = case.labels.last().map(|label| label.place);
        if let Some(place) = place.filter(|_| last.is_none() && fallen.len() > 1) {
            out.extend(
                [(Kind::Word, "break"), (Kind::Mark, ";")].map(|(kind, text)| Token::new(kind, text, place)),
            );
        }
    }
    out
}

/// Whether the last statement leaves the `switch`.
fn ends(body: &[Token]) -> bool {
    let Some((last, rest)) = body.split_last() else { return false };
    if last.is("}") {
        // Only a block of its own: that of an `if` may not run, and a loop's `break` ends the loop.
        let Some(open) = lex::opening(body, body.len() - 1) else { return false };
        let before = open.checked_sub(1).map(|before| &body[before]);
        let is_bare = before.is_none_or(|before| [";", "{", "}"].iter().any(|mark| before.is(mark)));
        return is_bare && ends(&body[open + 1..body.len() - 1]);
    }
    // The word before the `;`, or at the start of the last statement, as in `return a + b;`.
    let start = rest.iter().rposition(|token| [";", "{", "}"].iter().any(|mark| token.is(mark)));
    let first = rest.get(start.map_or(0, |start| start + 1));
    let leaves = ["break", "continue", "return", "discard"];
    last.is(";") && first.is_some_and(|first| leaves.iter().any(|word| first.is(word)))
}
