//! naga's findings at the author's place, with what to do.

use kiln_diagnostic::{Diagnostic, Span};

use super::Parsed;
use super::bindings::Bindings;
use super::builtin;
use super::declare::Item;
use super::source::{Mapped, Sources};
use crate::explain::Finding;
use crate::front::Fault;
use crate::{suggest, writable};

/// A diagnostic for what naga found in the text of a stage.
pub fn of_stage(
    sources: &Sources<'_, '_>,
    stage: &Parsed,
    text: &Mapped,
    mut finding: Finding,
) -> Diagnostic {
    if let Some(message) = unfit(stage, &finding.message) {
        finding.message = message;
    }
    let mut labels = finding.labels.into_iter();
    let main = labels.next().map(|(range, _)| range);
    let Some(place) = main.and_then(|range| text.origin(range)) else {
        let mut diagnostic = Diagnostic::error(finding.message).in_file(&sources.files[stage.root].path);
        diagnostic.notes = finding.notes;
        return diagnostic;
    };
    let help = help(sources, stage, &finding.message, place.file, place.start);
    let mut diagnostic = sources.error(place, finding.message);
    diagnostic.notes.splice(0..0, finding.notes);
    diagnostic.help = help;
    diagnostic
}

/// What to say of a call of a function that exists, but not for these arguments.
fn unfit(stage: &Parsed, message: &str) -> Option<String> {
    let name = message.strip_prefix("unknown function `")?.strip_suffix('`')?;
    if name == "kiln_equal" {
        return Some("`==` does not take these types, or one is an array inside of a struct".to_owned());
    }
    if ["kiln_layer", "kiln_cube_layer"].contains(&name) {
        return Some("a lookup of an array texture does not take these coordinates".to_owned());
    }
    let name = name.strip_prefix("kiln_").unwrap_or(name);
    let is_own = |item: &Item| matches!(item, Item::Function(function) if function.name.is(name));
    let exists = builtin::FUNCTIONS.contains(&name) || stage.items.iter().any(is_own);
    exists.then(|| format!("no `{name}` takes these types"))
}

fn help(
    sources: &Sources<'_, '_>,
    stage: &Parsed,
    message: &str,
    file: usize,
    start: usize,
) -> Option<String> {
    let named = message.split('`').nth(1).unwrap_or_default();
    let words = || stage.tokens.iter().filter(|token| token.is_word()).map(|token| &*token.text);
    let close = if message.starts_with("no variable") {
        suggest::closest(named, words().chain(builtin::VARIABLES))
    } else if message.starts_with("unknown function") {
        suggest::closest(named, words().chain(builtin::FUNCTIONS))
    } else if message.starts_with("no type") {
        suggest::closest(named, words().chain(builtin::TYPES))
    } else if message.starts_with("no ") && !message.ends_with("takes these types") {
        suggest::closest(named, words())
    } else if message.starts_with("expected") && message.contains("`;`") {
        let text = &sources.files[file].text;
        let before = text[..start].trim_end();
        let line = Span::new(text, before.len()..before.len()).line;
        return Some(format!("a `;` may be missing at the end of line {line}"));
    } else if message.contains("x2` cannot stand in a struct") {
        return Some("use `vec4`, or a matrix of 3 or 4 rows".to_owned());
    } else if message.starts_with("textures of integers") {
        return Some("read them with `texelFetch`".to_owned());
    } else if message.starts_with("a lookup of an array texture") {
        return Some("their last component is the layer, as in `vec3(uv, layer)`".to_owned());
    } else if message.starts_with("`%` does not take") {
        return Some("give both sides the same type, as in `v % ivec2(n)`".to_owned());
    } else if message.ends_with(writable::ENDING) {
        return Some("compute it in a function, or from macros".to_owned());
    } else {
        None
    };
    close.map(|name| format!("did you mean `{name}`?"))
}

/// A diagnostic for what is wrong with the joined stages.
pub fn of_program(
    sources: &Sources<'_, '_>,
    bindings: &Bindings,
    joined: &str,
    root: usize,
    fault: Fault,
) -> Diagnostic {
    let Fault::Source(finding) = fault else { return of_fault(sources, root, fault) };
    let named = finding.labels.iter().find_map(|(range, _)| {
        let text = joined.get(range.clone())?;
        let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        words.filter_map(|word| bindings.places.get(word)).next()
    });
    let Some(place) = named else {
        let mut diagnostic = Diagnostic::error(finding.message).in_file(&sources.files[root].path);
        diagnostic.notes = finding.notes;
        return diagnostic;
    };
    let is_layout = finding.message.contains("align") || finding.message.contains("stride");
    let mut diagnostic = sources.error(*place, finding.message);
    let notes = finding.notes.into_iter().filter(|note| !note.starts_with("global variable"));
    diagnostic.notes.splice(0..0, notes);
    if is_layout {
        let help = "structs in uniforms start at multiples of 16 bytes: give the struct a `vec4`, or do not call its constructor";
        diagnostic.help = Some(help.to_owned());
    }
    diagnostic
}

/// A diagnostic for what has no place.
pub fn of_fault(sources: &Sources<'_, '_>, root: usize, fault: Fault) -> Diagnostic {
    let diagnostic = Diagnostic::error(fault.to_string()).in_file(&sources.files[root].path);
    match fault {
        Fault::TooDeep => {
            diagnostic.with_help("split long expressions with variables, and use `switch` for long chains")
        }
        Fault::Internal(_) => diagnostic.with_help(
            "this is a fault of the compiler, not only of the shader; undo the last edit to go on",
        ),
        _ => diagnostic,
    }
}
