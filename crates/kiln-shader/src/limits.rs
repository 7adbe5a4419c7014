//! Limits on what is handed to naga, checked here because naga's parser and validator recurse.

use std::ops::Range;

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

/// What breaks a limit, or a bracket without its partner.
#[derive(Debug, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong.
    pub message: String,
    /// Where in the text.
    pub range: Range<usize>,
    /// The bracket that is open there, if it is about a wrong one.
    pub opened: Option<Range<usize>>,
}

/// Checks that brackets pair up and that nothing is nested deeper than the limits.
pub fn check_nesting(text: &str, tokens: &[Token]) -> Result<(), Fault> {
    let mut open: Vec<Level> = Vec::new();
    let mut level = Level { bracket: None, operators: 0, before: 0 };
    for (index, token) in tokens.iter().enumerate() {
        let Kind::Mark(mark) = token.kind else {
            // `else if` chains become nested blocks in naga.
            level.operators += usize::from(token.is_word(text, "else"));
            check_depth(token, &level)?;
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
                    return Err(unmatched(text, token, level.bracket));
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
            return Err(Fault { message, range: token.range(), opened: None });
        }
        check_depth(token, &level)?;
    }
    match level.bracket {
        Some(token) => {
            let message = format!("`{}` is never closed", &text[token.range()]);
            Err(Fault { message, range: token.range(), opened: None })
        }
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

fn check_depth(token: &Token, level: &Level) -> Result<(), Fault> {
    if level.before + level.operators <= EXPRESSION_DEPTH_MAX {
        return Ok(());
    }
    let message = format!("expression has more than {EXPRESSION_DEPTH_MAX} operators in one piece");
    Err(Fault { message, range: token.range(), opened: None })
}

fn opening(closing: char) -> char {
    match closing {
        ')' => '(',
        ']' => '[',
        _ => '{',
    }
}

fn unmatched(text: &str, token: &Token, opened: Option<Token>) -> Fault {
    let closing = &text[token.range()];
    let message = match opened {
        None => format!("`{closing}` closes nothing"),
        Some(opened) => format!("`{closing}` does not close `{}`", &text[opened.range()]),
    };
    Fault { message, range: token.range(), opened: opened.map(|opened| opened.range()) }
}
