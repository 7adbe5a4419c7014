//! The GLSL front end: what people write, of versions 100 to 460 and their embedded profiles, becomes the
//! same [`Outcome`] as WGSL.
//!
//! Start at [`compile`]. The steps: [`preprocess`] each stage, parse its declarations ([`declare`]), give
//! everything its [`bindings`] and [`locations`] over all stages, write each stage as the GLSL that naga reads
//! ([`lower`], [`rewrite`]), translate it ([`stage_module`]), [`join`] the stages.
//!
//! Conventions: each token knows its [`source::Place`], through includes and macros, and takes it along; so
//! does all text that Kiln writes on its behalf. Depth is WGSL's, 0 (near) … 1 (far): shaders get Kiln's
//! matrices, so nothing is rewritten.
//!
//! Not here: geometry and tessellation, which WGSL has not.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;
use std::rc::Rc;

use kiln_diagnostic::Diagnostic;

use crate::link::Read;
use crate::lint::{Allowances, Warning};
use crate::{Compiled, Outcome, Program, Scan, SourceMap, Stage, front, limits, parameter};
use declare::Item;
use lex::Token;
use source::Sources;

pub use stage::is_glsl;

mod bindings;
mod builtin;
mod check;
mod condition;
mod declare;
mod effects;
mod explain;
mod extension;
mod include;
mod index;
mod initial;
mod inout;
mod join;
mod layout;
mod lazy;
mod lex;
mod locations;
mod lower;
mod macros;
mod nesting;
mod order;
mod padding;
mod preprocess;
mod rewrite;
mod scene;
mod source;
mod source_map;
mod stage;
mod stage_module;
mod statement;
mod stride;
mod switch;
mod texture;
mod texture_array;
mod typed;
mod types;

/// A stage after preprocessing.
#[derive(Debug)]
struct Parsed {
    stage: Stage,
    /// Index of its file.
    root: usize,
    tokens: Vec<Token>,
    items: Vec<Item>,
    counts: BTreeMap<Rc<str>, usize>,
    /// How many textures each array of them has; the items hold its elements.
    texture_arrays: BTreeMap<Rc<str>, usize>,
}

impl Parsed {
    fn new(stage: Stage, root: usize, tokens: Vec<Token>) -> Parsed {
        let mut counts = BTreeMap::new();
        for token in tokens.iter().filter(|token| token.is_word()) {
            *counts.entry(Rc::clone(&token.text)).or_insert(0) += 1;
        }
        let items = declare::parse(&tokens);
        Parsed { stage, root, tokens, items, counts, texture_arrays: BTreeMap::new() }
    }

    /// How often a word stands in the stage.
    fn count(&self, word: &str) -> usize {
        self.counts.get(word).copied().unwrap_or(0)
    }
}

/// Compiles a program of one to three stages, each of its roots another one. The feature `sheen` is the macro
/// `FEATURE_SHEEN` with value 1. With `lints`, also warns of what is doubtful.
pub fn compile(program: &Program, features: &BTreeSet<String>, lints: bool, read: &mut Read<'_>) -> Outcome {
    let mut sources = Sources::new(read);
    let mut named = BTreeSet::new();
    let stages = load(&mut sources, program, features, &mut named);
    let mut translated = if has_errors(&sources) { None } else { translate(&mut sources, &stages, lints) };
    if let Some((compiled, _)) = &mut translated {
        let annotations = annotations(&mut sources, &stages);
        compiled.reflection.parameters = parameter::parameters(&compiled.reflection, annotations);
    }
    let Sources { dependencies, diagnostics: found, .. } = sources;
    // What several stages include is wrong once.
    let mut diagnostics: Vec<Diagnostic> = Vec::new();
    for diagnostic in found.into_iter().take(source::DIAGNOSTICS_MAX) {
        if !diagnostics.contains(&diagnostic) {
            diagnostics.push(diagnostic);
        }
    }
    let (compiled, source_map) = translated.unzip();
    let source_map = source_map.unwrap_or_default();
    Outcome { compiled, source_map, diagnostics, dependencies, features: named, is_library: false }
}

/// The annotations of a program that need not be valid.
pub fn program_annotations(
    program: &Program,
    features: &BTreeSet<String>,
    read: &mut Read<'_>,
) -> Vec<parameter::Annotation> {
    let mut sources = Sources::new(read);
    let stages = load(&mut sources, program, features, &mut BTreeSet::new());
    annotations(&mut sources, &stages)
}

/// Each file's, though it may be included more than once, and the initial values of uniforms.
fn annotations(sources: &mut Sources<'_, '_>, stages: &[Parsed]) -> Vec<parameter::Annotation> {
    let tokens = stages.iter().flat_map(|stage| &stage.tokens);
    let kept: BTreeSet<(&str, usize)> =
        tokens.map(|token| (&*sources.files[token.place.file].path, token.place.start)).collect();
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for file in &sources.files {
        if seen.insert(&file.path) {
            found.extend({
                let is_kept = |name: Range<usize>| kept.contains(&(&*file.path, name.start));
                parameter::annotations(&file.path, &file.text, is_kept, &mut sources.diagnostics)
            });
        }
    }
    for (variable, value) in initial::values(stages) {
        let (is_flag, place) = (variable.ty.is("bool"), initial::place(sources, variable));
        parameter::give_first(&mut found, &variable.name.text, is_flag, value, place);
    }
    found
}

/// The files that a program includes, transitively and under any condition, and the features its conditions name.
pub fn scan(program: &Program, read: &mut Read<'_>) -> Scan {
    let mut sources = Sources::new(read);
    let mut features = BTreeSet::new();
    let mut queue: VecDeque<String> = program.prelude.iter().chain(&program.roots).cloned().collect();
    let mut seen = BTreeSet::new();
    while let Some(path) = queue.pop_front() {
        if !seen.insert(path.clone()) {
            continue;
        }
        let Some(text) = sources.look_up(&path) else { continue };
        features.extend(preprocess::named_features(0, &text));
        for (name, quotes) in preprocess::included_names(0, &text) {
            let candidates = include::candidates(&path, &name, quotes, &program.include_dirs);
            let found = candidates.into_iter().find(|candidate| sources.look_up(candidate).is_some());
            queue.extend(found);
        }
    }
    Scan { dependencies: sources.dependencies, features }
}

fn has_errors(sources: &Sources<'_, '_>) -> bool {
    kiln_diagnostic::has_errors(&sources.diagnostics)
}

/// Reads, preprocesses and parses the stages.
fn load(
    sources: &mut Sources<'_, '_>,
    program: &Program,
    features: &BTreeSet<String>,
    named: &mut BTreeSet<String>,
) -> Vec<Parsed> {
    let mut stages: Vec<Parsed> = Vec::new();
    for path in &program.roots {
        let Some(text) = sources.look_up(path) else {
            let message = format!("shader `{path}` does not exist");
            sources.diagnostics.push(Diagnostic::error(message).in_file(path));
            continue;
        };
        let root = sources.add(path, text, None);
        let preprocessed = preprocess::preprocess(sources, root, program, features);
        named.extend(preprocessed.features);
        let Some(stage) = stage_of(sources, path, preprocessed.stage.as_ref()) else { continue };
        if let Some(other) = stages.iter().find(|other| other.stage == stage) {
            let message = format!("`{}` is of the same stage", sources.files[other.root].path);
            sources.diagnostics.push(Diagnostic::error(message).in_file(path));
            continue;
        }
        let tokens = preprocessed.tokens;
        if nesting::check_characters(sources, &tokens) && nesting::check_nesting(sources, &tokens) {
            let mut parsed = Parsed::new(stage, root, tokens);
            texture_array::expand(sources, &mut parsed);
            if nesting::check_count(sources, &parsed) {
                stages.push(parsed);
            }
        }
    }
    if program.roots.is_empty() {
        sources.diagnostics.push(Diagnostic::error("a program has at least one stage"));
    }
    stages.sort_by_key(|stage| stage::entry_order(stage.stage));
    stages
}

/// The stage that a pragma names, else the one that the file's name says.
fn stage_of(sources: &mut Sources<'_, '_>, path: &str, pragma: Option<&Token>) -> Option<Stage> {
    let named = pragma.map_or_else(|| stage::of_path(path), |word| stage::named(&word.text));
    let diagnostic = match (named, pragma) {
        (stage::Named::Stage(stage), _) => return Some(stage),
        (stage::Named::Refused(name), _) => {
            Diagnostic::error(format!("stage `{name}` is not supported: WGSL has vertex, fragment and compute"))
                .in_file(path)
                .with_help("build the geometry before, or in a compute stage")
        }
        (stage::Named::Unknown, Some(word)) => {
            sources.error(word.place, format!("there is no stage `{}`", word.text))
                .with_help("write `vertex`, `fragment` or `compute`")
        }
        (stage::Named::Unknown, None) => {
            Diagnostic::error("the name of this file does not say its stage").in_file(path).with_help(
                "call it `.vert`, `.frag` or `.comp`, also before `.glsl`, or write `#pragma shader_stage(fragment)`",
            )
        }
    };
    sources.diagnostics.push(diagnostic);
    None
}

/// Everything after preprocessing.
fn translate(sources: &mut Sources<'_, '_>, stages: &[Parsed], lints: bool) -> Option<(Compiled, SourceMap)> {
    check_main(sources, stages);
    bindings::check_equal(sources, stages);
    let interfaces = locations::assign(sources, stages);
    let bound = bindings::assign(sources, stages);
    let holders = lower::holder_names(stages);
    let texts: Vec<lower::Lowered> = stages
        .iter()
        .zip(&interfaces)
        .map(|(stage, interface)| lower::lower(sources, stage, interface, &bound, &holders))
        .collect();
    if has_errors(sources) {
        return None;
    }
    let names: BTreeMap<(u32, u32), String> = bound.of.iter().map(|(name, at)| (*at, name.clone())).collect();
    let (mut written, mut functions) = (Vec::new(), Vec::new());
    let mut diagnostics = Vec::new();
    let files = sources.files.iter().map(|file| (file.path.as_str(), &*file.text));
    let allowances = if lints { Allowances::read(files, &mut diagnostics) } else { Allowances::default() };
    sources.diagnostics.append(&mut diagnostics);
    for (stage, lowered) in stages.iter().zip(&texts) {
        let text = &lowered.text;
        let found: Vec<Diagnostic> = match stage_module::translate(lowered, stage.stage, &names, lints) {
            Ok(Ok(translated)) => {
                written.push((translated.wgsl, stage::ending(stage.stage)));
                functions.push(translated.functions);
                let warn = |Warning { rule, finding, help }| {
                    allowances.warn(explain::of_stage(sources, stage, text, finding), rule, &help)
                };
                translated.warnings.into_iter().take(limits::WARNINGS_MAX).filter_map(warn).collect()
            }
            Ok(Err(findings)) => {
                findings.into_iter().map(|finding| explain::of_stage(sources, stage, text, finding)).collect()
            }
            Err(fault) => vec![explain::of_fault(sources, stage.root, fault)],
        };
        sources.diagnostics.extend(found);
    }
    if has_errors(sources) {
        return None;
    }
    let merged = holders.values().map(String::as_str).collect();
    let (joined, origins) = join(sources, stages, &written, &merged)?;
    let name_locals = |module: &mut naga::Module| source_map::name_locals(module, &origins, &functions);
    match front::compile_joined(&joined, name_locals) {
        Ok((mut compiled, canonical)) => {
            restore_names(&mut compiled, stages, &interfaces);
            let map = source_map::place(sources, stages, &texts, (&origins, &functions), canonical);
            Some((compiled, map))
        }
        Err(fault) => {
            let root = stages.first()?.root;
            let diagnostic = explain::of_program(sources, &bound, &joined, root, fault);
            sources.diagnostics.push(diagnostic);
            None
        }
    }
}

/// Joins the stages; what keeps them apart is left in `sources`.
fn join(
    sources: &mut Sources<'_, '_>,
    stages: &[Parsed],
    written: &[(String, &str)],
    holders: &BTreeSet<&str>,
) -> Option<(String, source_map::Origins)> {
    match join::join(written, holders) {
        Ok(joined) => Some(joined),
        Err(join::Clash(name)) => {
            let message = format!("`{name}` differs between the stages");
            let places = bindings::places_of(stages, &name);
            let diagnostic = match &places[..] {
                [first, .., last] => {
                    let mut diagnostic = sources.error(*last, message);
                    let note = format!("the other is declared at {}", sources.describe(*first));
                    diagnostic.notes.insert(0, note);
                    diagnostic
                }
                _ => Diagnostic::error(message).in_file(&sources.files[stages.first()?.root].path),
            };
            let help = "declare it alike in all stages, best in one included file";
            sources.diagnostics.push(diagnostic.with_help(help));
            None
        }
    }
}

/// Puts the author's names into the reflection: the text has others where they are reserved words of WGSL,
/// and for inputs that end in a digit.
fn restore_names(compiled: &mut Compiled, stages: &[Parsed], interfaces: &[locations::Interface]) {
    let restore = |name: &mut String| {
        let own = name.strip_suffix('_').filter(|own| naga::keywords::wgsl::RESERVED.contains(own));
        let own = own.filter(|own| stages.iter().any(|stage| stage.count(own) > 0)).map(str::to_owned);
        if let Some(own) = own {
            *name = own;
        }
    };
    for binding in &mut compiled.reflection.bindings {
        restore(&mut binding.name);
        if let crate::BindingKind::Uniform { members, .. } = &mut binding.kind {
            members.iter_mut().for_each(|member| restore(&mut member.name));
        }
    }
    for (entry, interface) in compiled.reflection.entry_points.iter_mut().zip(interfaces) {
        for input in &mut entry.inputs {
            if let Some(passed) = interface.inputs.iter().find(|passed| passed.covers(input.location)) {
                input.name = passed.name.text.to_string();
            }
        }
    }
}

fn check_main(sources: &mut Sources<'_, '_>, stages: &[Parsed]) {
    for stage in stages {
        let is_main = |item: &Item| matches!(item, Item::Function(function) if function.name.is("main") && function.body.is_some());
        if !stage.items.iter().any(is_main) {
            let diagnostic = Diagnostic::error("this stage has no function `main`");
            let diagnostic =
                diagnostic.in_file(&sources.files[stage.root].path).with_help("write `void main() { … }`");
            sources.diagnostics.push(diagnostic);
        }
    }
}
