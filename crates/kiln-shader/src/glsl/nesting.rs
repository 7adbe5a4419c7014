//! Limits on the shape of a stage: naga recurses over what is nested.

use super::Parsed;
use super::declare::Item;
use super::lex::{self, Kind, Token};
use super::lower::put;
use super::source::{Mapped, Sources};

/// Most statements inside of each other without braces, as in an `else if` chain.
const STATEMENTS_MAX: usize = 200;

/// Most structs, blocks, uniforms, inputs and outputs of a stage. Devices offer a tenth of it.
const DECLARATIONS_MAX: usize = 1024;

/// Whether the stage declares no more than any device could fill.
pub fn check_count(sources: &mut Sources<'_, '_>, stage: &Parsed) -> bool {
    let places = stage.items.iter().filter_map(|item| match item {
        Item::Struct(structure) => Some(structure.name.place),
        Item::Block(block) => Some(block.name.place),
        Item::Variable(variable) if !variable.qualifiers.is("const") => {
            variable.qualifiers.storage.as_ref().map(|storage| storage.place)
        }
        _ => None,
    });
    let Some(place) = places.into_iter().nth(DECLARATIONS_MAX) else { return true };
    let message = format!("more than {DECLARATIONS_MAX} structs, blocks, uniforms, inputs and outputs");
    let fault = sources.error(place, message);
    sources.diagnostics.push(fault);
    false
}

/// Whether brackets pair up and nothing is nested too deep for naga.
pub fn check_nesting(sources: &mut Sources<'_, '_>, tokens: &[Token]) -> bool {
    let mut text = Mapped::default();
    put(&mut text, tokens);
    let plain = crate::token::tokenize(&text.text).unwrap_or_default();
    let Err(fault) = crate::limits::check_nesting(&text.text, &plain) else {
        return check_statements(sources, tokens);
    };
    let Some(place) = text.origin(fault.range) else { return false };
    let mut diagnostic = sources.error(place, &fault.message);
    if let Some(opened) = fault.opened.and_then(|opened| text.origin(opened)) {
        diagnostic.notes.insert(0, format!("opened at {}", sources.describe(opened)));
    } else if fault.message.starts_with("expression") {
        diagnostic.help =
            Some("split it with a variable, or end an `else if` chain with `switch`".to_owned());
    }
    sources.diagnostics.push(diagnostic);
    false
}

/// Whether all tokens are GLSL's.
pub fn check_characters(sources: &mut Sources<'_, '_>, tokens: &[Token]) -> bool {
    let known = |token: &&Token| token.kind != Kind::Mark || is_mark(&token.text);
    let Some(wrong) = tokens.iter().find(|token| !known(token)) else { return true };
    let fault = sources.error(wrong.place, format!("`{}` is no character of GLSL here", wrong.text));
    sources.diagnostics.push(fault);
    false
}

fn is_mark(text: &str) -> bool {
    text.is_ascii()
        && !["##", "::", "->", "#", "@", "$", "`", "\"", "'", "\\"].contains(&text)
        && !text.bytes().any(|byte| byte.is_ascii_control())
        && lex::tokenize(0, text).is_ok()
}

/// `if (a) if (b) …` and `else if` chains need no braces.
fn check_statements(sources: &mut Sources<'_, '_>, tokens: &[Token]) -> bool {
    let (mut outer, mut count, mut parentheses) = (Vec::new(), 0_usize, 0_usize);
    for (index, token) in tokens.iter().enumerate() {
        let ends = match &*token.text {
            "(" => {
                parentheses += 1;
                false
            }
            ")" => {
                parentheses = parentheses.saturating_sub(1);
                false
            }
            "{" => {
                outer.push(std::mem::take(&mut count));
                false
            }
            "}" => {
                count = outer.pop().unwrap_or(0);
                true
            }
            ";" => parentheses == 0,
            "if" | "else" | "for" | "while" | "do" | "switch" => {
                count += 1;
                false
            }
            _ => false,
        };
        if ends && !tokens.get(index + 1).is_some_and(|next| next.is("else")) {
            count = 0;
        }
        if count > STATEMENTS_MAX {
            let message = format!("more than {STATEMENTS_MAX} statements stand inside of each other");
            let fault = sources.error(token.place, message).with_help("end an `else if` chain with `switch`");
            sources.diagnostics.push(fault);
            return false;
        }
    }
    true
}
