//! From canonical text back to the files of a program: through the joined stages and the GLSL that naga read.

use std::collections::BTreeMap;
use std::ops::Range;

use kiln_diagnostic::Span;
use naga::{Function, Module};

use super::declare::Item;
use super::lower::Lowered;
use super::source::{Place, Sources};
use super::{Parsed, stage};
use crate::source_map::{LinkedFunction, SourceMap};
use crate::token::{self, Kind};

/// A function of a stage, before the stages are joined.
#[derive(Debug)]
pub struct StageFunction {
    /// Its name in the stage's WGSL.
    name: String,
    /// Its name in the GLSL that naga read.
    source_name: String,
    /// Its bytes there.
    range: Option<Range<usize>>,
    locals: Vec<Option<String>>,
}

/// Where each function of the joined text comes from: its stage, and its name in the stage's WGSL.
pub type Origins = BTreeMap<String, (usize, String)>;

/// Names of a function's arguments and variables.
fn locals(function: &Function) -> Vec<Option<String>> {
    let arguments = function.arguments.iter().map(|argument| argument.name.clone());
    arguments.chain(function.local_variables.iter().map(|(_, local)| local.name.clone())).collect()
}

/// The functions and then entry points of `module`, which is written as `wgsl` in this order.
pub fn functions(module: &Module, wgsl: &str) -> Vec<StageFunction> {
    let tokens = token::tokenize(wgsl).unwrap_or_default();
    let pairs = tokens.windows(2).filter(|pair| pair[0].is_word(wgsl, "fn") && pair[1].kind == Kind::Word);
    let names = pairs.map(|pair| wgsl[pair[1].range()].to_owned());
    let own = module.functions.iter().map(|(handle, function)| {
        (function.name.clone().unwrap_or_default(), module.functions.get_span(handle).to_range(), function)
    });
    // What naga writes as the entry point calls `main`.
    let entries = module.entry_points.iter().map(|entry| (entry.name.clone(), None, &entry.function));
    let functions = own.chain(entries).zip(names);
    let made = |((source_name, range, function), name): ((String, _, &Function), String)| StageFunction {
        name,
        source_name,
        range,
        locals: locals(function),
    };
    functions.map(made).collect()
}

/// Gives arguments and variables of the joined stages their authors' names, which canonical text does not keep.
pub fn name_locals(module: &mut Module, origins: &Origins, made: &[Vec<StageFunction>]) {
    let name = |function: &mut Function, name: &str| {
        let Some(known) = stage_function(name, origins, made) else { return };
        let arguments = function.arguments.iter_mut().map(|argument| &mut argument.name);
        let locals = function.local_variables.iter_mut().map(|(_, local)| &mut local.name);
        for (name, known) in arguments.chain(locals).zip(&known.locals) {
            name.clone_from(known);
        }
    };
    for (_, function) in module.functions.iter_mut() {
        let own = function.name.clone().unwrap_or_default();
        name(function, &own);
    }
    module.entry_points.iter_mut().for_each(|entry| name(&mut entry.function, &entry.name));
}

fn stage_function<'a>(
    name: &str,
    origins: &Origins,
    made: &'a [Vec<StageFunction>],
) -> Option<&'a StageFunction> {
    let (stage, name) = origins.get(name)?;
    made.get(*stage)?.iter().find(|function| function.name == *name)
}

/// Gives the functions of the canonical text their files, lines and names there.
pub fn place(
    sources: &Sources<'_, '_>,
    stages: &[Parsed],
    texts: &[Lowered],
    (origins, made): (&Origins, &[Vec<StageFunction>]),
    functions: Vec<LinkedFunction>,
) -> SourceMap {
    let placed = functions.into_iter().map(|LinkedFunction { mut source, .. }| {
        let (Some(known), Some((index, _))) =
            (stage_function(&source.source_name, origins, made), origins.get(&source.source_name))
        else {
            return source;
        };
        let (stage, text) = (&stages[*index], &texts[*index].text);
        let place = match &*known.source_name {
            name if is_main(name, stage) => {
                "main".clone_into(&mut source.source_name);
                main_place(stage)
            }
            name => {
                name.clone_into(&mut source.source_name);
                // What Kiln adds stands in no file.
                let range =
                    known.range.clone().filter(|_| !name.starts_with("kiln_") || stage.count(name) > 0);
                range.and_then(|range| text.origin(range))
            }
        };
        if let Some(place) = place {
            let file = &sources.files[place.file];
            source.file.clone_from(&file.path);
            source.line = Span::new(&file.text, place.start..place.end).line;
        }
        source
    });
    SourceMap { functions: placed.collect() }
}

/// Whether a function is the author's `main`, or one of those around it, and not another of that name.
fn is_main(name: &str, stage: &Parsed) -> bool {
    let word = name.strip_suffix("_main").or(name.strip_suffix("_body"));
    let is_around = word.is_some_and(|word| ["vertex", "fragment", "compute"].contains(&word));
    (is_around || name == stage::entry_point(stage.stage)) && stage.count(name) == 0
}

fn main_place(stage: &Parsed) -> Option<Place> {
    stage.items.iter().find_map(|item| match item {
        Item::Function(function) if function.name.is("main") && function.body.is_some() => {
            Some(function.name.place)
        }
        _ => None,
    })
}
