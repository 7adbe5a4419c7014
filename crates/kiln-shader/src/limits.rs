//! Limits on what is handed to naga, checked here because naga's parser and validator recurse.

use kiln_diagnostic::Diagnostic;

use crate::token::{Kind, Token};

/// Longest module in bytes. The largest hand-written shaders known are a tenth of this.
pub const MODULE_BYTES_MAX: usize = 1 << 20;
/// Longest linked text in bytes.
pub const LINKED_BYTES_MAX: usize = 4 << 20;
/// Most modules in one link.
pub const MODULE_COUNT_MAX: usize = 256;
/// Deepest nesting of brackets; WGSL itself allows 127 for braces (section 2.4, limits).
pub const NESTING_MAX: usize = 100;
/// Most operators and brackets between an expression's root and any leaf, bounded from above by counting
/// those that are open. naga recurses over expressions, so this bounds its stack.
pub const EXPRESSION_DEPTH_MAX: usize = 500;

/// Most warnings for one shader: nobody reads more.
pub const WARNINGS_MAX: usize = 100;

/// Checks that brackets pair up and that nothing is nested deeper than the limits.
pub fn check_nesting(file: &str, text: &str, tokens: &[Token]) -> Result<(), Box<Diagnostic>> {
    let mut open: Vec<Level> = Vec::new();
    let mut level = Level { bracket: None, operators: 0, before: 0 };
    for (index, token) in tokens.iter().enumerate() {
        let Kind::Mark(mark) = token.kind else {
            // `else if` chains become nested blocks in naga.
            level.operators += usize::from(token.is_word(text, "else"));
            check_depth(file, text, token, &level)?;
            continue;
        };
        match mark {
            '(' | '[' | '{' => {
                let before = level.before + level.operators + 1;
                open.push(level);
                level = Level { bracket: Some(*token), operators: 0, before };
            }
            ')' | ']' | '}' => {
                let closed = level.bracket.filter(|opened| opened.is(opening(mark)));
                let Some(outer) = open.pop().filter(|_| closed.is_some()) else {
                    return Err(Box::new(unmatched(file, text, token, level.bracket)));
                };
                level = outer;
                // A call or an index wraps what stands before it; a block ends its statement.
                let chained = tokens.get(index + 1).is_some_and(|next| next.is_word(text, "else"));
                level.operators = if mark != '}' {
                    level.operators + 1
                } else if chained {
                    level.operators
                } else {
                    0
                };
            }
            ',' | ';' => level.operators = 0,
            _ => level.operators += 1,
        }
        if open.len() > NESTING_MAX {
            let message = format!("brackets are nested deeper than {NESTING_MAX}");
            return Err(Box::new(Diagnostic::error(message).at(file, text, token.range())));
        }
        check_depth(file, text, token, &level)?;
    }
    match level.bracket {
        Some(token) => Err(Box::new(unclosed(file, text, &token))),
        None => Ok(()),
    }
}

/// One bracket level.
struct Level {
    /// The bracket that opened it.
    bracket: Option<Token>,
    /// Operators since the last separator in it.
    operators: usize,
    /// Operators and brackets of all outer levels.
    before: usize,
}

fn check_depth(file: &str, text: &str, token: &Token, level: &Level) -> Result<(), Box<Diagnostic>> {
    let depth = level.before + level.operators;
    if depth <= EXPRESSION_DEPTH_MAX {
        return Ok(());
    }
    let message = format!("expression has more than {EXPRESSION_DEPTH_MAX} operators in one piece");
    Err(Box::new(
        Diagnostic::error(message)
            .at(file, text, token.range())
            .with_help("split it with `let`, or end an `else if` chain with `switch`"),
    ))
}

fn opening(closing: char) -> char {
    match closing {
        ')' => '(',
        ']' => '[',
        _ => '{',
    }
}

fn unmatched(file: &str, text: &str, token: &Token, opened: Option<Token>) -> Diagnostic {
    let closing = &text[token.range()];
    match opened {
        None => Diagnostic::error(format!("`{closing}` closes nothing")).at(file, text, token.range()),
        Some(opened) => {
            let bracket = &text[opened.range()];
            let span = kiln_diagnostic::Span::new(text, opened.range());
            Diagnostic::error(format!("`{closing}` does not close `{bracket}`"))
                .at(file, text, token.range())
                .with_note(format!("`{bracket}` was opened at {file}:{}:{}", span.line, span.column))
        }
    }
}

fn unclosed(file: &str, text: &str, token: &Token) -> Diagnostic {
    let bracket = &text[token.range()];
    Diagnostic::error(format!("`{bracket}` is never closed")).at(file, text, token.range())
}
