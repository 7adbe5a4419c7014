//! Parameters that a shader's author offers to whoever looks at it: annotated overrides and uniform members.
//!
//! WGSL and GLSL have no place for such facts, so they stand in a line comment behind the declaration, or on the line
//! before it:
//!
//! ```wgsl
//! override samples: u32 = 16u;   // @slider(1, 64) samples a pixel
//! struct Params {
//!     tint: vec3f,               // @color(1.0, 0.9, 0.8)
//!     wetness: f32,              // @slider(0, 1, 0.25) how wet it looks
//!     // @choice(1, flat, smooth, both)
//!     mode: u32,
//!     is_lit: u32,               // @toggle(true)
//! }
//! ```

use std::ops::Range;

use kiln_diagnostic::Diagnostic;

use crate::reflect::{BindingKind, Parameter, ParameterPlace, Reflection, Widget};
use crate::token::{self, Kind, Token};

/// An annotation and the name it stands at.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Annotation {
    pub(crate) name: String,
    pub(crate) widget: Widget,
    pub(crate) default: Vec<f64>,
    label: String,
    /// Where its first value stands.
    pub(crate) place: FirstPlace,
}

/// Where the first value of a parameter stands: bytes of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct FirstPlace {
    /// The file.
    pub(crate) path: String,
    /// The annotation's own numbers or words for it.
    pub(crate) arguments: Vec<Range<usize>>,
    /// Literals of the declaration's initial value, where that is nothing else.
    pub(crate) literals: Vec<Range<usize>>,
    /// Where an annotation without such numbers takes them: before its closing bracket.
    pub(crate) end: Option<usize>,
}

/// A vector has no more.
const COMPONENTS_MAX: usize = 4;

const KINDS: [&str; 4] = ["slider", "color", "toggle", "choice"];

/// The annotations of a file that stand at a name whose bytes `is_kept` has: conditions cut others.
pub(crate) fn annotations(
    path: &str,
    text: &str,
    is_kept: impl Fn(Range<usize>) -> bool,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Annotation> {
    let mut found = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let end = start + line.len();
        if let Some((code, comment)) = line.split_once("//")
            && let Some((kind, rest)) = keyword(comment)
        {
            let from = start + line.len() - comment.trim_start().len();
            let range = from..from + comment.trim().len();
            let is_behind = !code.trim().is_empty();
            let (begin, declared) = if is_behind { (start, code) } else { next_code(text, end) };
            match annotation(kind, rest, declared) {
                Ok((mut annotation, name)) if is_kept(begin + name.start..begin + name.end) => {
                    annotation.place.place_in(path, end - rest.len(), begin);
                    found.push(annotation);
                }
                Ok(_) => {}
                Err(fault) => diagnostics.push(warning(path, text, range, kind, fault)),
            }
        }
        start = end;
    }
    found
}

fn warning(path: &str, text: &str, range: Range<usize>, kind: &str, fault: String) -> Diagnostic {
    let help = match kind {
        "slider" => "write `@slider(least, greatest)` or `@slider(least, greatest, default)`",
        "color" => "write `@color(red, green, blue)`, linear",
        "toggle" => "write `@toggle(true)` or `@toggle(false)`",
        _ => "write `@choice(default, name of 0, name of 1, …)`",
    };
    Diagnostic::warning(fault).at(path, text, range).with_help(help)
}

/// `@slider` at the beginning of a comment: the word, and what follows it.
fn keyword(comment: &str) -> Option<(&str, &str)> {
    let text = comment.trim_start().strip_prefix('@')?;
    let end = text.find(|character: char| !character.is_ascii_alphanumeric()).unwrap_or(text.len());
    let (word, rest) = text.split_at(end);
    KINDS.contains(&word).then_some((word, rest))
}

/// The first line from byte `at` on that is not empty, and where it begins.
fn next_code(text: &str, at: usize) -> (usize, &str) {
    let rest = &text[at..];
    let begin = at + rest.len() - rest.trim_start().len();
    (begin, text[begin..].lines().next().unwrap_or_default())
}

impl FirstPlace {
    /// What was found in the rest of a comment and in a declaration, as bytes of the file that both stand in.
    fn place_in(&mut self, path: &str, rest: usize, declaration: usize) {
        self.path = path.to_owned();
        self.end = self.end.map(|end| end + rest);
        let shift = |range: &mut Range<usize>, by: usize| *range = range.start + by..range.end + by;
        self.arguments.iter_mut().for_each(|range| shift(range, rest));
        self.literals.iter_mut().for_each(|range| shift(range, declaration));
    }
}

/// Bytes of what stands between commas, without space around it.
fn arguments(inside: &str, start: usize) -> Vec<Range<usize>> {
    let mut at = start;
    let mut places = Vec::new();
    for part in inside.split(',') {
        let from = at + part.len() - part.trim_start().len();
        places.push(from..from + part.trim().len());
        at += part.len() + 1;
    }
    places
}

/// What the annotation says of `code`, and where in it the name stands. Its places are bytes of `rest` and of `code`.
fn annotation(kind: &str, rest: &str, code: &str) -> Result<(Annotation, Range<usize>), String> {
    let values = rest.strip_prefix('(').ok_or("this annotation has no values in brackets")?;
    let (inside, label) = values.split_once(')').ok_or("this annotation is never closed")?;
    let mut places = arguments(inside, 1);
    let arguments: Vec<&str> = places.iter().map(|place| &rest[place.clone()]).collect();
    let Declared { name: range, literals, value } = declaration(code)?;
    let name = code[range.clone()].to_owned();
    let label = label.trim().to_owned();
    let number = |text: &str| -> Result<f64, String> {
        let number: Option<f64> = text.parse().ok();
        number.filter(|number| number.is_finite()).ok_or_else(|| format!("`{text}` is no number"))
    };
    let numbers = || arguments.iter().map(|argument| number(argument)).collect::<Result<Vec<f64>, String>>();
    let (widget, default) = match kind {
        "slider" => match numbers()?[..] {
            [least, greatest, ref default @ ..] if least < greatest && default.len() <= COMPONENTS_MAX => {
                if default.iter().any(|default| !(least..=greatest).contains(default)) {
                    return Err("the default lies outside the slider".to_owned());
                }
                (Widget::Slider { least, greatest }, default.to_vec())
            }
            _ => return Err("a slider has a least and a greatest value".to_owned()),
        },
        "color" => match numbers()? {
            rgb if rgb.len() == 3 => (Widget::Color, rgb),
            _ => return Err("a color has three components".to_owned()),
        },
        "toggle" => match arguments[..] {
            ["true"] => (Widget::Toggle, vec![1.0]),
            ["false"] => (Widget::Toggle, vec![0.0]),
            _ => return Err("a toggle is true or false".to_owned()),
        },
        _ => {
            let names: Vec<String> = arguments[1..].iter().map(|&name| name.to_owned()).collect();
            let default = number(arguments[0])?;
            if default.fract() != 0.0 || !(0.0..names.len() as f64).contains(&default) {
                return Err("the default of a choice is the number of one of its names".to_owned());
            }
            (Widget::Choice { names }, vec![default])
        }
    };
    let first = if matches!(widget, Widget::Slider { .. }) { 2 } else { 0 };
    let count = if matches!(widget, Widget::Choice { .. }) { 1 } else { default.len() };
    let arguments: Vec<Range<usize>> = places.drain(first..first + count).collect();
    let place = FirstPlace { arguments, literals, end: Some(1 + inside.len()), ..FirstPlace::default() };
    let default = if default.is_empty() { value.into_iter().collect() } else { default };
    Ok((Annotation { name, widget, default, label, place }, range))
}

/// What a line declares, in bytes of it.
struct Declared {
    name: Range<usize>,
    /// See [`FirstPlace::literals`].
    literals: Vec<Range<usize>>,
    /// The number behind `=`.
    value: Option<f64>,
}

/// What a line declares: the word before its `:` in WGSL, before its `;`, `=` or `[` in GLSL; and what is behind its `=`.
fn declaration(code: &str) -> Result<Declared, String> {
    let nowhere = || "this annotation stands at no declaration".to_owned();
    let all = token::tokenize(code).map_err(|_| nowhere())?;
    // What stands in brackets, as in `layout(location = 0)`, declares nothing.
    let mut depth = 0_usize;
    let mut tokens: Vec<Token> = Vec::new();
    for token in &all {
        match token.kind {
            Kind::Mark(')') => depth = depth.saturating_sub(1),
            Kind::Mark('(') => depth += 1,
            _ if depth == 0 => tokens.push(*token),
            _ => {}
        }
    }
    let is = |token: &Token, marks: &[char]| marks.iter().any(|mark| token.is(*mark));
    let mut places = tokens.iter().enumerate().filter(|(_, token)| token.is(':')).map(|(at, _)| at);
    let (first, second) = (places.next(), places.next());
    let commas = tokens.iter().take_while(|token| !is(token, &[';', '='])).filter(|token| token.is(','));
    if second.is_some() || (first.is_none() && commas.count() > 0) {
        return Err("this annotation stands at two declarations: give each its line".to_owned());
    }
    let end = first.or_else(|| tokens.iter().position(|token| is(token, &[';', '=', '['])));
    let name = end.and_then(|at| tokens.get(at.checked_sub(1)?)).filter(|token| token.kind == Kind::Word);
    let name = name.ok_or_else(nowhere)?.range();
    let equals = tokens.iter().find(|token| token.is('='));
    let initial = equals.and_then(|equals| all.iter().position(|token| token.start > equals.start));
    let literals = initial.map_or(Vec::new(), |at| initial_literals(code, &all[at..]));
    let value = match &literals[..] {
        [one] => code[one.clone()].trim_end_matches(['f', 'u', 'i']).parse().ok(),
        _ => None,
    };
    Ok(Declared { name, literals, value })
}

/// The literals of an initial value that ends at a `;`: one, or those of a constructor as `vec2(1.0, 0.5)`. None where it is
/// worked out.
fn initial_literals(code: &str, tokens: &[Token]) -> Vec<Range<usize>> {
    let end = tokens.iter().position(|token| token.is(';')).unwrap_or(tokens.len());
    let (tokens, mut found) = (&tokens[..end], Vec::new());
    let parts = match tokens {
        [ty, open, inside @ .., close] if ty.kind == Kind::Word && open.is('(') && close.is(')') => inside,
        _ => tokens,
    };
    for part in parts.split(|token| token.is(',')) {
        let is_word = |token: &Token| ["true", "false"].iter().any(|word| token.is_word(code, word));
        match part {
            [one] if one.kind == Kind::Number || is_word(one) => found.push(one.range()),
            [minus, one] if minus.is('-') && one.kind == Kind::Number => found.push(minus.start..one.end),
            _ => return Vec::new(),
        }
    }
    found
}

/// Gives the parameter `name` its first value, unless its annotation says one; without an annotation it becomes one. `place` is
/// where that value stands.
pub(crate) fn give_first(
    annotations: &mut Vec<Annotation>,
    name: &str,
    is_flag: bool,
    value: Vec<f64>,
    place: FirstPlace,
) {
    match annotations.iter_mut().find(|annotation| annotation.name == name) {
        Some(annotation) if annotation.default.is_empty() => annotation.default = value,
        Some(_) => {}
        None => {
            let widget = if is_flag { Widget::Toggle } else { Widget::Number };
            let label = String::new();
            annotations.push(Annotation { name: name.to_owned(), widget, default: value, label, place });
        }
    }
}

/// The parameters that a shader has: annotations whose name is an override or a member of a uniform. A color may have a
/// fourth component, which is 1.
pub(crate) fn parameters(reflection: &Reflection, annotations: Vec<Annotation>) -> Vec<Parameter> {
    let mut parameters: Vec<Parameter> = Vec::new();
    for annotation in annotations {
        let overridden = reflection.overrides.iter().find(|constant| constant.name == annotation.name);
        let place = overridden.map(|_| ParameterPlace::Override).or_else(|| {
            let has_member = |kind: &BindingKind| match kind {
                BindingKind::Uniform { members, .. } => {
                    members.iter().any(|member| member.name == annotation.name)
                }
                _ => false,
            };
            let binding = reflection.bindings.iter().find(|binding| has_member(&binding.kind))?;
            Some(ParameterPlace::Member { uniform: binding.name.clone() })
        });
        let Annotation { name, widget, mut default, label, .. } = annotation;
        if default.is_empty() {
            // A slider without a default starts where the override does, else at its least.
            let least = if let Widget::Slider { least, .. } = widget { least } else { 0.0 };
            default.push(overridden.and_then(|constant| constant.default).unwrap_or(least));
        }
        let is_known = parameters.iter().any(|known| known.name == name);
        if let Some(place) = place.filter(|_| !is_known) {
            parameters.push(Parameter { name, place, widget, default, label });
        }
    }
    parameters
}
