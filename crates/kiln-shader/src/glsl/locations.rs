//! Locations of what passes between stages: by `layout(location=…)`, else by name, in order of appearance.

use std::collections::{BTreeMap, BTreeSet};

use kiln_diagnostic::Diagnostic;

use super::Parsed;
use super::builtin;
use super::condition;
use super::declare::{Item, Qualifiers, Variable};
use super::lex::Token;
use super::source::Sources;
use crate::Stage;

/// Most locations of one interface; devices offer 16 to 32.
const LOCATIONS_MAX: u32 = 64;

/// A variable of a stage's interface.
#[derive(Clone, Debug)]
pub struct Passed {
    /// By what the other stage knows it: its name, or `Block.member`.
    pub key: String,
    /// Its name in the text for naga, at the author's place.
    pub name: Token,
    /// The type's name.
    pub ty: Token,
    /// `[…]`.
    pub array: Vec<Token>,
    /// `flat`, `centroid` and their like.
    pub interpolation: Vec<Token>,
    /// Its first location.
    pub location: Option<u32>,
    /// How many it takes.
    count: u32,
}

impl Passed {
    /// Whether it takes `location`.
    pub fn covers(&self, location: u32) -> bool {
        self.location.is_some_and(|first| (first..first + self.count).contains(&location))
    }

    fn ty_text(&self) -> String {
        self.array.iter().fold(self.ty.text.to_string(), |text, token| text + &token.text)
    }
}

/// Interfaces of a stage.
#[derive(Clone, Debug, Default)]
pub struct Interface {
    /// What it reads.
    pub inputs: Vec<Passed>,
    /// What it writes.
    pub outputs: Vec<Passed>,
}

/// Gives all variables of all interfaces their locations; what does not fit is left in `sources`.
pub fn assign(sources: &mut Sources<'_, '_>, stages: &[Parsed]) -> Vec<Interface> {
    let mut found: Vec<Interface> = stages.iter().map(|stage| interface(sources, stage)).collect();
    let position = |wanted| stages.iter().position(|stage| stage.stage == wanted);
    if let (Some(vertex), Some(fragment)) = (position(Stage::Vertex), position(Stage::Fragment)) {
        let mut read = std::mem::take(&mut found[fragment].inputs);
        link(sources, &mut found[vertex].outputs, &mut read);
        found[fragment].inputs = read;
    }
    for interface in &mut found {
        for side in [&mut interface.inputs, &mut interface.outputs] {
            let faults = number(side);
            sources.diagnostics.extend(
                faults
                    .iter()
                    .map(|(at, message)| sources_error(sources, &side[*at], message))
                    .collect::<Vec<_>>(),
            );
        }
    }
    if let (Some(vertex), Some(fragment)) = (position(Stage::Vertex), position(Stage::Fragment)) {
        // The reader of a varying follows its writer.
        let written: BTreeMap<String, Option<u32>> =
            found[vertex].outputs.iter().map(|passed| (passed.key.clone(), passed.location)).collect();
        for passed in &mut found[fragment].inputs {
            passed.location = written.get(&passed.key).copied().flatten().or(passed.location);
        }
    }
    found
}

fn sources_error(sources: &Sources<'_, '_>, passed: &Passed, message: &str) -> Diagnostic {
    sources.error(passed.name.place, message)
}

/// Matches what the fragment stage reads with what the vertex stage writes.
fn link(sources: &mut Sources<'_, '_>, written: &mut [Passed], read: &mut [Passed]) {
    let mut faults = Vec::new();
    for input in read.iter_mut() {
        let by_location = |output: &Passed| input.location.is_some() && output.location == input.location;
        let by_name = |output: &Passed| output.key == input.key;
        let position = written.iter().position(by_location).or_else(|| written.iter().position(by_name));
        let Some(output) = position.map(|position| &mut written[position]) else {
            let names = written.iter().map(|output| output.key.as_str());
            let close = crate::suggest::closest(&input.key, names);
            let message = format!("the vertex stage does not write `{}`", input.key);
            let mut fault = sources.error(input.name.place, message);
            fault.help = Some(match close {
                Some(name) => format!("did you mean `{name}`?"),
                None => format!("declare `out {} {};` in the vertex stage", input.ty_text(), input.name.text),
            });
            faults.push(fault);
            continue;
        };
        if output.ty_text() != input.ty_text() {
            let (wrote, reads) = (output.ty_text(), input.ty_text());
            let message = format!("`{}` is `{reads}` here, the vertex stage writes `{wrote}`", input.key);
            let note = format!("written at {}", sources.describe(output.name.place));
            let mut fault = sources.error(input.name.place, message);
            fault.notes.insert(0, note);
            faults.push(fault);
        }
        output.location = output.location.or(input.location);
        input.key.clone_from(&output.key);
        // WGSL wants both sides to say the same; in GLSL the reader decides.
        if input.interpolation.is_empty() {
            input.interpolation.clone_from(&output.interpolation);
        } else {
            output.interpolation.clone_from(&input.interpolation);
        }
    }
    sources.diagnostics.append(&mut faults);
}

/// Numbers what has no location yet with the lowest ones that are free.
fn number(side: &mut [Passed]) -> Vec<(usize, String)> {
    let mut faults = Vec::new();
    let mut taken: BTreeSet<u32> = BTreeSet::new();
    let mut wanted: Vec<usize> = (0..side.len()).filter(|at| side[*at].location.is_some()).collect();
    wanted.extend((0..side.len()).filter(|at| side[*at].location.is_none()));
    for at in wanted {
        let passed = &mut side[at];
        let free = |start: u32| (start..start + passed.count).all(|location| !taken.contains(&location));
        let start = match passed.location {
            Some(start) => Some(start).filter(|start| free(*start) && start + passed.count <= LOCATIONS_MAX),
            None => (0..LOCATIONS_MAX).find(|start| free(*start)),
        };
        match start {
            Some(start) => {
                taken.extend(start..start + passed.count);
                passed.location = Some(start);
            }
            None => {
                let message = format!("the location of `{}` is taken, or too high", passed.name.text);
                faults.push((at, message));
            }
        }
    }
    faults
}

fn interface(sources: &mut Sources<'_, '_>, stage: &Parsed) -> Interface {
    let mut found = Interface::default();
    for item in &stage.items {
        match item {
            Item::Variable(variable) => {
                let Some(is_input) = direction(&variable.qualifiers, stage.stage) else { continue };
                if variable.name.text.starts_with("gl_") {
                    continue;
                }
                let key = variable.name.text.to_string();
                let passed = passed(
                    sources,
                    variable,
                    key,
                    variable.name.clone(),
                    variable.qualifiers.integer("location"),
                );
                push(&mut found, stage, is_input, passed, &variable.name.text);
            }
            Item::Block(block) if !block.name.is("gl_PerVertex") => {
                let Some(is_input) = direction(&block.qualifiers, stage.stage) else { continue };
                if let Some(bracket) = block.array.first() {
                    let fault = sources.error(bracket.place, "arrays of varying blocks are not supported");
                    sources.diagnostics.push(fault.with_help("declare one block for each"));
                    continue;
                }
                let mut location = block.qualifiers.integer("location");
                for member in &block.members {
                    let key = format!("{}.{}", block.name.text, member.name.text);
                    let mut name = member.name.clone();
                    if block.instance.is_some() {
                        name.text = member_name(&block.name, &member.name).into();
                    }
                    let mut passed = passed(sources, member, key, name, location);
                    if passed.interpolation.is_empty() {
                        passed.interpolation.clone_from(&block.qualifiers.interpolation);
                    }
                    location = location.map(|location| location.saturating_add(passed.count));
                    push(&mut found, stage, is_input, passed, &member.name.text);
                }
            }
            _ => {}
        }
    }
    fragment_colours(stage, &mut found);
    found
}

/// The name of a block's member as a variable of its own.
pub fn member_name(block: &Token, member: &Token) -> String {
    format!("{}_{}", block.text, member.text)
}

/// What nobody reads need not be written: an input that is only declared is dropped.
fn push(found: &mut Interface, stage: &Parsed, is_input: bool, passed: Passed, name: &str) {
    let is_used = stage.count(name) > 1;
    if !is_input {
        found.outputs.push(passed);
    } else if is_used || stage.stage == Stage::Vertex {
        found.inputs.push(passed);
    }
}

fn passed(
    sources: &mut Sources<'_, '_>,
    variable: &Variable,
    key: String,
    name: Token,
    location: Option<u32>,
) -> Passed {
    if !builtin::is_value_type(&variable.ty.text) {
        let message =
            format!("`{}` has type `{}`, which cannot pass between stages", name.text, variable.ty.text);
        let fault = sources
            .error(variable.ty.place, message)
            .with_help("declare each member as a variable of its own");
        sources.diagnostics.push(fault);
    }
    let len = match &variable.array[..] {
        [] => Some(1),
        [_, len, _] => condition::integer(&len.text).and_then(|len| u32::try_from(len).ok()),
        _ => None,
    };
    let len = len.filter(|len| (1..=LOCATIONS_MAX).contains(len)).unwrap_or_else(|| {
        let message = format!("the length of `{}` must be one integer literal", name.text);
        let fault = sources.error(variable.name.place, message);
        sources.diagnostics.push(fault);
        1
    });
    let count = len * builtin::columns(&variable.ty.text).unwrap_or(1);
    let (ty, array) = (variable.ty.clone(), variable.array.clone());
    let interpolation = variable.qualifiers.interpolation.clone();
    Passed { key, name, ty, array, interpolation, location, count }
}

/// Whether a global passes into the stage or out of it; none if it is no interface variable.
pub fn direction(qualifiers: &Qualifiers, stage: Stage) -> Option<bool> {
    match &*qualifiers.storage.as_ref()?.text {
        "in" | "attribute" => Some(true),
        "out" => Some(false),
        "varying" => Some(stage == Stage::Fragment),
        _ => None,
    }
}

/// `gl_FragColor` and `gl_FragData` are declared by their use.
fn fragment_colours(stage: &Parsed, found: &mut Interface) {
    if stage.stage != Stage::Fragment {
        return;
    }
    for name in ["gl_FragColor", "gl_FragData"] {
        let Some(first) = stage.tokens.iter().find(|token| token.is(name)) else { continue };
        let word = |text: &str| Token::new(super::lex::Kind::Word, text, first.place);
        let uses = stage.tokens.windows(3).filter(|uses| uses[0].is(name) && uses[1].is("["));
        let highest = uses.filter_map(|uses| condition::integer(&uses[2].text)).max();
        let len = highest.and_then(|highest| u32::try_from(highest + 1).ok()).unwrap_or(1).clamp(1, 8);
        let array = if name == "gl_FragData" {
            vec![word("["), Token::new(super::lex::Kind::Number, len.to_string(), first.place), word("]")]
        } else {
            Vec::new()
        };
        let count = if array.is_empty() { 1 } else { len };
        let (key, interpolation) = (name.to_owned(), Vec::new());
        let passed =
            Passed { key, name: word(name), ty: word("vec4"), array, interpolation, location: None, count };
        found.outputs.push(passed);
    }
}
