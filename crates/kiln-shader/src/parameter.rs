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
use serde::{Deserialize, Serialize};

use crate::reflect::{BindingKind, Parameter, ParameterPlace, Reflection, Widget};
use crate::token::{self, Kind, Token};

/// An annotation and the name it stands at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Annotation {
    name: String,
    widget: Widget,
    default: Vec<f64>,
    label: String,
}

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
                Ok((annotation, name)) if is_kept(begin + name.start..begin + name.end) => {
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

/// What the annotation says of `code`, and where in it the name stands.
fn annotation(kind: &str, rest: &str, code: &str) -> Result<(Annotation, Range<usize>), String> {
    let values = rest.strip_prefix('(').ok_or("this annotation has no values in brackets")?;
    let (inside, label) = values.split_once(')').ok_or("this annotation is never closed")?;
    let arguments: Vec<&str> = inside.split(',').map(str::trim).collect();
    let (range, value) = declaration(code)?;
    let name = code[range.clone()].to_owned();
    let label = label.trim().to_owned();
    let number = |text: &str| -> Result<f64, String> {
        let number: Option<f64> = text.parse().ok();
        number.filter(|number| number.is_finite()).ok_or_else(|| format!("`{text}` is no number"))
    };
    let numbers = || arguments.iter().map(|argument| number(argument)).collect::<Result<Vec<f64>, String>>();
    let (widget, default) = match kind {
        "slider" => match numbers()?[..] {
            [least, greatest, ref default @ ..] if least < greatest && default.len() <= 1 => {
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
    let default = if default.is_empty() { value.into_iter().collect() } else { default };
    Ok((Annotation { name, widget, default, label }, range))
}

/// What a line declares: the word before its `:` in WGSL, before its `;`, `=` or `[` in GLSL; and the number behind its `=`.
fn declaration(code: &str) -> Result<(Range<usize>, Option<f64>), String> {
    let nowhere = || "this annotation stands at no declaration".to_owned();
    let all = token::tokenize(code).map_err(|_| nowhere())?;
    // What stands in brackets, as in `layout(location = 0)`, declares nothing.
    let mut depth = 0_usize;
    let mut tokens: Vec<Token> = Vec::new();
    for token in all {
        match token.kind {
            Kind::Mark(')') => depth = depth.saturating_sub(1),
            Kind::Mark('(') => depth += 1,
            _ if depth == 0 => tokens.push(token),
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
    let value = tokens.iter().position(|token| token.is('=')).and_then(|at| tokens.get(at + 1));
    let value = value.and_then(|token| code[token.range()].trim_end_matches(['f', 'u', 'i']).parse().ok());
    Ok((name.ok_or_else(nowhere)?.range(), value))
}

/// Gives the parameter `name` its first value, unless its annotation says one; without an annotation it becomes one.
pub(crate) fn give_first(annotations: &mut Vec<Annotation>, name: &str, is_flag: bool, value: Vec<f64>) {
    match annotations.iter_mut().find(|annotation| annotation.name == name) {
        Some(annotation) if annotation.default.is_empty() => annotation.default = value,
        Some(_) => {}
        None => {
            let widget = if is_flag { Widget::Toggle } else { Widget::Number };
            annotations.push(Annotation {
                name: name.to_owned(),
                widget,
                default: value,
                label: String::new(),
            });
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
        let Annotation { name, widget, mut default, label } = annotation;
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
