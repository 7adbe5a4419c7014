//! Writes a parameter's value where its shader says the first one, and leaves every other byte as it is.
//!
//! That is in the annotation (`@slider(0, 1, 0.25)`), else in the declaration's literals (`= 16u`), else the annotation gets
//! a number more. Where annotation and literals say the same they go on doing so: other tools read the literals alone.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use kiln_diagnostic::Diagnostic;

use crate::link::Read;
use crate::parameter::{Annotation, FirstPlace};
use crate::{Parameter, Program, Reflection, Widget, glsl, wgsl};

/// What to change in one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceEdit {
    /// Path relative to the project.
    pub path: String,
    /// Bytes and what takes their place, in the file's order; empty where the file says that value already.
    pub replacements: Vec<(Range<usize>, String)>,
}

impl SourceEdit {
    /// The file's text after the change.
    pub fn apply(&self, text: &str) -> String {
        let mut changed = text.to_owned();
        for (range, replacement) in self.replacements.iter().rev() {
            changed.replace_range(range.clone(), replacement);
        }
        changed
    }
}

/// What makes `value` (component by component) the first value of the parameter `name` of a program compiled for `features`.
/// `reflection` is the program's; `read` gets paths relative to the project. Numbers of type `f32` are rounded to it and written
/// as short as they can be.
///
/// # Errors
/// There is no such parameter, its type or widget does not take the value, or its first value is worked out.
pub fn write_parameter(
    program: &Program,
    features: &BTreeSet<String>,
    reflection: &Reflection,
    name: &str,
    value: &[f64],
    read: &mut Read<'_>,
) -> Result<SourceEdit, Box<Diagnostic>> {
    let unknown = || {
        let message = format!("no parameter `{name}` is declared here or in what it imports");
        Diagnostic::error(message).in_file(program.subject())
    };
    let parameter = reflection.parameters.iter().find(|known| known.name == name).ok_or_else(unknown)?;
    let shape = reflection.parameter_type(parameter).and_then(Shape::of).ok_or_else(unknown)?;
    let declared = first_value(program, features, name, read).ok_or_else(unknown)?;
    let path = declared.place.path.clone();
    let fault = |message: String| Diagnostic::error(message).in_file(&path);
    let value = shape.fit(parameter, value).map_err(fault)?;
    // What a macro gave stands in no file.
    let text = read(&path).filter(|_| !path.is_empty());
    let help = "give it a literal, or an annotation as `// @slider(0, 1, 0.5)`";
    let worked_out =
        || fault(format!("the first value of `{name}` is worked out: no number to replace")).with_help(help);
    let text = text.ok_or_else(worked_out)?;
    let replacements = replacements(&text, &declared, shape, &value).ok_or_else(worked_out)?;
    let edit = SourceEdit { path: path.clone(), replacements };
    let edited: Arc<str> = edit.apply(&text).into();
    let mut overlaid = |asked: &str| if asked == path { Some(edited.clone()) } else { read(asked) };
    let written = first_value(program, features, name, &mut overlaid);
    match written.is_some_and(|written| shape.extended(&written) == value) {
        true => Ok(edit),
        false => Err(fault(format!("`{name}` would not have this value after it was written here")).into()),
    }
}

/// The annotation that gives a parameter its first value.
fn first_value(
    program: &Program,
    features: &BTreeSet<String>,
    name: &str,
    read: &mut Read<'_>,
) -> Option<Annotation> {
    let annotations = match program.is_glsl() {
        true => glsl::program_annotations(program, features, read),
        false => wgsl::program_annotations(program.subject(), features, read),
    };
    annotations.into_iter().find(|annotation| annotation.name == name)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    F32,
    I32,
    U32,
    Bool,
}

/// A type that a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shape {
    scalar: Scalar,
    count: usize,
}

impl Shape {
    /// Of `f32`, `vec3<f32>` or `vec3f`.
    fn of(ty: &str) -> Option<Shape> {
        let (count, scalar) = match ty.strip_prefix("vec") {
            None => (1, ty),
            Some(vector) => {
                let count = vector.chars().next()?.to_digit(10)?;
                (count as usize, vector[1..].trim_matches(['<', '>']))
            }
        };
        let scalar = match scalar {
            "f32" | "f" => Scalar::F32,
            "i32" | "i" => Scalar::I32,
            "u32" | "u" => Scalar::U32,
            "bool" => Scalar::Bool,
            _ => return None,
        };
        Some(Shape { scalar, count })
    }

    /// The value as its type holds it.
    fn fit(self, parameter: &Parameter, value: &[f64]) -> Result<Vec<f64>, String> {
        let name = &parameter.name;
        let count = if parameter.widget == Widget::Color { 3 } else { self.count };
        if value.len() != count {
            let plural = if count == 1 { "" } else { "s" };
            return Err(format!("`{name}` takes {count} number{plural}; {} are given", value.len()));
        }
        let rounded = value.iter().map(|&number| self.rounded(number).filter(|_| takes(parameter, number)));
        let misfit = || value.iter().find(|&&it| self.rounded(it).is_none() || !takes(parameter, it));
        rounded.collect::<Option<Vec<f64>>>().ok_or_else(|| {
            let wrong = misfit().copied().unwrap_or(f64::NAN);
            format!("`{name}` cannot be {wrong}: it is {}", self.expected(parameter))
        })
    }

    /// The nearest number that the type holds; `None` if there is none.
    fn rounded(self, value: f64) -> Option<f64> {
        let is_whole =
            |least: f64, greatest: f64| value.fract() == 0.0 && (least..=greatest).contains(&value);
        let fits = match self.scalar {
            Scalar::F32 => return Some(f64::from(value as f32)).filter(|rounded| rounded.is_finite()),
            Scalar::I32 => is_whole(f64::from(i32::MIN), f64::from(i32::MAX)),
            Scalar::U32 => is_whole(0.0, f64::from(u32::MAX)),
            Scalar::Bool => is_whole(0.0, 1.0),
        };
        // Not -0.
        fits.then_some(value + 0.0)
    }

    /// What it may be, for a message.
    fn expected(self, parameter: &Parameter) -> String {
        let scalar = match self.scalar {
            Scalar::F32 => "an f32",
            Scalar::I32 => "an i32",
            Scalar::U32 => "a u32",
            Scalar::Bool => "true or false",
        };
        match &parameter.widget {
            Widget::Slider { least, greatest } => format!("{scalar} from {least} to {greatest}"),
            Widget::Toggle => "true (1) or false (0)".to_owned(),
            Widget::Choice { names } => format!("the number of one of {}", names.join(", ")),
            Widget::Number | Widget::Color => scalar.to_owned(),
        }
    }

    /// The first value that an annotation gives: one number stands for all further components too.
    fn extended(self, annotation: &Annotation) -> Vec<f64> {
        let default = &annotation.default;
        let count = if annotation.widget == Widget::Color { 3 } else { self.count };
        let last = default.last().copied().unwrap_or(f64::NAN);
        let numbers = (0..count).map(|index| default.get(index).copied().unwrap_or(last));
        numbers.map(|number| self.rounded(number).unwrap_or(f64::NAN)).collect()
    }
}

/// Whether the widget takes a component.
fn takes(parameter: &Parameter, number: f64) -> bool {
    match &parameter.widget {
        Widget::Slider { least, greatest } => (least..=greatest).contains(&&number),
        Widget::Toggle => [0.0, 1.0].contains(&number),
        Widget::Choice { names } => number.fract() == 0.0 && (0.0..names.len() as f64).contains(&number),
        Widget::Number | Widget::Color => true,
    }
}

/// `None` where no number can be written.
fn replacements(
    text: &str,
    annotation: &Annotation,
    shape: Shape,
    value: &[f64],
) -> Option<Vec<(Range<usize>, String)>> {
    let FirstPlace { arguments, literals, end, .. } = &annotation.place;
    let is_argument = !arguments.is_empty();
    let places = if is_argument { arguments } else { literals };
    let is_one = value.iter().all(|number| *number == value[0]);
    let short = if is_one { &value[..1] } else { value };
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        let spelled = |number: &f64| Spelling { old: "", shape, is_code: false, annotation }.of(*number);
        let numbers: Vec<String> = short.iter().map(spelled).collect();
        return end.map(|end| vec![(end..end, format!(", {}", numbers.join(", ")))]);
    };
    let old = |place: &Range<usize>| text.get(place.clone());
    let spelling = |old, number| Spelling { old, shape, is_code: !is_argument, annotation }.of(number);
    let numbers = if places.len() == value.len() { value } else { short };
    if places.len() != numbers.len() {
        // Another number of numbers: the list is written anew.
        let style = old(first)?;
        let numbers: Vec<String> = numbers.iter().map(|number| spelling(style, *number)).collect();
        return Some(vec![(first.start..last.end, numbers.join(", "))]);
    }
    let mut replaced = Vec::new();
    for (index, (place, number)) in places.iter().zip(numbers).enumerate() {
        let before = annotation.default.get(index).and_then(|before| shape.rounded(*before));
        if before != Some(*number) {
            replaced.push((place.clone(), spelling(old(place)?, *number)));
        }
    }
    if is_argument && says_the_same(text, annotation, shape) {
        let numbers = if literals.len() == value.len() { value } else { short };
        let changed = literals.iter().zip(numbers).zip(&annotation.default);
        let changed = changed.filter(|((_, number), before)| shape.rounded(**before) != Some(**number));
        for ((place, number), _) in changed.filter(|_| literals.len() == numbers.len()) {
            let spelling = Spelling { old: old(place)?, shape, is_code: true, annotation };
            replaced.push((place.clone(), spelling.of(*number)));
        }
        replaced.sort_by_key(|(place, _)| place.start);
    }
    Some(replaced)
}

/// Whether the declaration's literals are the annotation's first value.
fn says_the_same(text: &str, annotation: &Annotation, shape: Shape) -> bool {
    let FirstPlace { arguments, literals, .. } = &annotation.place;
    let number = |place: &Range<usize>| match text.get(place.clone())? {
        "true" => Some(1.0),
        "false" => Some(0.0),
        digits => digits.trim_end_matches(['f', 'F', 'u', 'U', 'i']).parse().ok(),
    };
    let is_same = |(place, first): (&Range<usize>, &f64)| {
        number(place).and_then(|number| shape.rounded(number)) == shape.rounded(*first)
    };
    !literals.is_empty()
        && literals.len() == arguments.len()
        && literals.len() == annotation.default.len()
        && literals.iter().zip(&annotation.default).all(is_same)
}

/// How a number is written in place of another.
struct Spelling<'a> {
    /// What stands there.
    old: &'a str,
    shape: Shape,
    /// Whether it stands in a declaration, else in an annotation.
    is_code: bool,
    annotation: &'a Annotation,
}

impl Spelling<'_> {
    /// Whole `f32`s up to here are written without a point where the author does: all front ends take them as integers.
    const WHOLE_MAX: f64 = 1e6;

    fn of(&self, number: f64) -> String {
        let is_word = ["true", "false"].contains(&self.old);
        if is_word || self.shape.scalar == Scalar::Bool && self.is_code {
            return if number == 0.0 { "false" } else { "true" }.to_owned();
        }
        match self.shape.scalar {
            Scalar::F32 => self.float(number),
            Scalar::I32 | Scalar::U32 | Scalar::Bool => {
                let suffix = self.suffix(&['u', 'U', 'i']);
                // The literal 2147483648i is none.
                let suffix = if number == f64::from(i32::MIN) { "" } else { suffix };
                format!("{number:.0}{suffix}")
            }
        }
    }

    fn float(&self, number: f64) -> String {
        let mut text = format!("{:?}", number as f32);
        if let Widget::Slider { least, greatest } = self.annotation.widget
            && !text.parse().is_ok_and(|written: f64| (least..=greatest).contains(&written))
        {
            // A bound with more digits than an `f32` has.
            text = format!("{:?}", number.clamp(least, greatest));
        }
        let suffix = if self.is_code { self.suffix(&['f', 'F']) } else { "" };
        let is_hex = self.old.to_ascii_lowercase().contains("0x");
        let has_point = is_hex || self.old.contains(['.', 'e', 'E']) || !suffix.is_empty();
        let may_be_whole = !self.is_code || !self.old.is_empty() && number.abs() <= Self::WHOLE_MAX;
        if !has_point
            && may_be_whole
            && let Some(whole) = text.strip_suffix(".0")
        {
            return whole.to_owned();
        }
        text + suffix
    }

    /// The author's suffix, if it is one of these; in a hexadecimal number `f` is a digit, unless it has an exponent.
    fn suffix(&self, suffixes: &[char]) -> &str {
        let old = self.old.to_ascii_lowercase();
        let is_digit = |suffix: char| "fF".contains(suffix) && old.contains("0x") && !old.contains('p');
        match self.old.chars().last() {
            Some(last) if self.is_code && suffixes.contains(&last) && !is_digit(last) => {
                &self.old[self.old.len() - last.len_utf8()..]
            }
            _ => "",
        }
    }
}
