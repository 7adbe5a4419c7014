//! From canonical text back to what the author wrote.

use std::collections::BTreeMap;
use std::ops::Range;

use kiln_diagnostic::Span;
use naga::{Function, Module};
use serde::{Deserialize, Serialize};

use crate::join::Linked;
use crate::link::Graph;

/// Where the functions of a canonical text stand in the author's files, and what their locals are called there.
///
/// It changes with every line that moves, and so is no part of a [`crate::Compiled`]'s text or reflection.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceMap {
    /// Functions and then entry points, in the order of the canonical text.
    pub functions: Vec<FunctionSource>,
}

/// One function's.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FunctionSource {
    /// Its name in the canonical text.
    pub name: String,
    /// Its name in the file.
    pub source_name: String,
    /// The file, relative to the project; empty where no file has it.
    pub file: String,
    /// Its line there, from 1; 0 where no file has it.
    pub line: u32,
    /// Names of arguments and variables in the canonical text, with the author's.
    pub locals: BTreeMap<String, String>,
}

/// A function, with its bytes in the linked text.
#[derive(Clone, Debug)]
pub(crate) struct LinkedFunction {
    /// What is known of it without its author's file; `source_name` is its name in the linked text.
    pub(crate) source: FunctionSource,
    range: Option<Range<usize>>,
}

/// The functions of `module`, named as in `emitted`, the canonical text read back.
pub(crate) fn functions(module: &Module, emitted: &Module) -> Vec<LinkedFunction> {
    let own = module.functions.iter().zip(emitted.functions.iter());
    let own = own.map(|((handle, function), (_, emitted))| {
        let range = module.functions.get_span(handle).to_range();
        let [name, source_name] =
            [emitted, function].map(|function| function.name.clone().unwrap_or_default());
        linked_function(name, source_name, range, function, emitted)
    });
    let entries = module.entry_points.iter().zip(&emitted.entry_points);
    let entries = entries.map(|(entry, emitted)| {
        // naga keeps no span of an entry point; its body's is next to it.
        let spans = entry.function.body.span_iter().filter_map(|(_, span)| span.to_range());
        let range = spans.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
        linked_function(emitted.name.clone(), entry.name.clone(), range, &entry.function, &emitted.function)
    });
    own.chain(entries).collect()
}

fn linked_function(
    name: String,
    source_name: String,
    range: Option<Range<usize>>,
    function: &Function,
    emitted: &Function,
) -> LinkedFunction {
    let names = |function: &Function| -> Vec<Option<String>> {
        let arguments = function.arguments.iter().map(|argument| argument.name.clone());
        arguments.chain(function.local_variables.iter().map(|(_, local)| local.name.clone())).collect()
    };
    let locals = names(emitted).into_iter().zip(names(function));
    let locals = locals.filter_map(|(emitted, author)| Some((emitted?, author?))).collect();
    LinkedFunction {
        source: FunctionSource { name, source_name, file: String::new(), line: 0, locals },
        range,
    }
}

/// Gives each function its file and line.
pub(crate) fn place(functions: Vec<LinkedFunction>, graph: &Graph, linked: &Linked) -> SourceMap {
    let placed = functions.into_iter().map(|LinkedFunction { mut source, range }| {
        if let Some((module, range)) = range.and_then(|range| linked.origin(range)) {
            let module = &graph.modules[module];
            source.line = Span::new(&module.text, range).line;
            source.file.clone_from(&module.path);
            // Linking may have given names a form of its own.
            for name in source.locals.values_mut().chain([&mut source.source_name]) {
                if let Some((range, _)) = module.renames.iter().find(|(_, new)| new == name) {
                    module.text[range.clone()].clone_into(name);
                }
            }
        }
        source
    });
    SourceMap { functions: placed.collect() }
}
