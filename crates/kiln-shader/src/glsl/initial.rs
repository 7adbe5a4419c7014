//! Initial values of uniforms, which WGSL has not: they become first values of the author's parameters.

use std::ops::Range;

use super::Parsed;
use super::bindings;
use super::builtin;
use super::condition;
use super::declare::{Item, Variable};
use super::lex::{self, Kind, Token};
use super::source::Sources;
use crate::names::Group;
use crate::parameter::FirstPlace;

/// The uniforms of the stages with an initial value that is kept, component by component.
pub fn values(stages: &[Parsed]) -> Vec<(&Variable, Vec<f64>)> {
    let items = stages.iter().flat_map(|stage| &stage.items);
    let variables = items.filter_map(|item| match item {
        Item::Variable(variable) if variable.qualifiers.is("uniform") => Some(variable),
        _ => None,
    });
    variables.filter_map(|variable| Some((variable, value(variable)?))).collect()
}

/// The initial value of a uniform that is the author's own, if it is made of literals.
pub fn value(variable: &Variable) -> Option<Vec<f64>> {
    let ty = &*variable.ty.text;
    let count =
        builtin::vector_len(ty).or_else(|| matches!(ty, "float" | "int" | "uint" | "bool").then_some(1))?;
    let is_own = bindings::holder(variable) == Some(Group::Params) && variable.array.is_empty();
    let numbers = numbers(variable.initial.as_ref().filter(|_| is_own)?)?;
    let count = usize::try_from(count).ok()?;
    match numbers[..] {
        [all] => Some(vec![all; count]),
        _ => Some(numbers).filter(|numbers| numbers.len() == count),
    }
}

/// Where the literals of an initial value stand. What a macro gave stands nowhere.
pub fn place(sources: &Sources<'_, '_>, variable: &Variable) -> FirstPlace {
    let file = &sources.files[variable.name.place.file];
    let tokens = variable.initial.as_deref().unwrap_or_default();
    let mut literals: Vec<Range<usize>> = Vec::new();
    for (at, token) in tokens.iter().enumerate().filter(|(_, token)| literal(token).is_some()) {
        let stands = |token: &Token| {
            let place = token.place;
            place.file == variable.name.place.file
                && file.text.get(place.start..place.end) == Some(&token.text)
        };
        if !stands(token) {
            return FirstPlace::default();
        }
        let minus =
            at.checked_sub(1).map(|before| &tokens[before]).filter(|token| token.is("-") && stands(token));
        literals.push(minus.map_or(token.place.start, |minus| minus.place.start)..token.place.end);
    }
    FirstPlace { path: file.path.clone(), literals, ..FirstPlace::default() }
}

/// A literal, or a constructor of literals.
fn numbers(tokens: &[Token]) -> Option<Vec<f64>> {
    match tokens {
        [minus, number] if minus.is("-") => Some(vec![-literal(number)?]),
        [number] => Some(vec![literal(number)?]),
        [ty, open, .., close] if builtin::is_value_type(&ty.text) && open.is("(") && close.is(")") => {
            let parts = lex::split_commas(&tokens[2..tokens.len() - 1]);
            parts.into_iter().map(numbers).collect::<Option<Vec<_>>>().map(|parts| parts.concat())
        }
        _ => None,
    }
}

fn literal(token: &Token) -> Option<f64> {
    match (&*token.text, token.kind) {
        ("true", _) => Some(1.0),
        ("false", _) => Some(0.0),
        (text, Kind::Number) => {
            let integer = condition::integer(text).and_then(|value| i32::try_from(value).ok()).map(f64::from);
            integer
                .or_else(|| text.trim_end_matches(['f', 'F']).parse().ok())
                .filter(|value| value.is_finite())
        }
        _ => None,
    }
}
