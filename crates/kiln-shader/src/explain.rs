//! Turns naga's errors into diagnostics at their author's file and line.

use std::collections::BTreeMap;
use std::ops::Range;

use kiln_diagnostic::{Diagnostic, Span};

use crate::front::{self, Fault};
use crate::join::Linked;
use crate::lenient::Lenient;
use crate::link::Graph;
use crate::lint::{Allowances, Warning};
use crate::token::{self, Kind};
use crate::{limits, suggest, writable};

/// Bytes that the search for further faults has naga read, about: half a second of work.
const SEARCH_BYTES_MAX: usize = 8 << 20;
/// Most readings of one text.
const SEARCH_ROUNDS_MAX: usize = 64;

/// Explains `fault` of the linked text, and what else is wrong: the first fault of every module, since naga stops at its
/// first.
pub fn all(graph: &Graph, linked: &Linked, fault: Fault) -> Vec<Diagnostic> {
    let Fault::Source(mut finding) = fault else { return vec![diagnostic(graph, linked, fault)] };
    let mut faults = BTreeMap::new();
    let mut rest = Lenient::new(linked);
    let rounds = (SEARCH_BYTES_MAX / linked.text.len().max(1)).clamp(1, SEARCH_ROUNDS_MAX);
    for _ in 0..rounds {
        let place = finding.labels.first().map(|(range, _)| range.clone());
        let module = place.clone().and_then(|range| linked.origin(range)).map(|(module, _)| module);
        // What was written for the search is nobody's fault. The first one was found before.
        let is_own = place.as_ref().is_none_or(|range| range.start < linked.text.len());
        let is_fault = faults.is_empty() || (is_own && !rest.is_consequence(&finding));
        if is_fault {
            let explained = || diagnostic(graph, linked, Fault::Source(finding));
            faults.entry(module.unwrap_or_default()).or_insert_with(explained);
        }
        if !place.is_some_and(|range| rest.take_out(range.start, is_fault)) {
            break;
        }
        match front::check_linked(&rest.text) {
            Err(Fault::Source(next)) => finding = next,
            _ => break,
        }
    }
    faults.into_values().collect()
}

/// Explains `fault` of the linked text.
fn diagnostic(graph: &Graph, linked: &Linked, fault: Fault) -> Diagnostic {
    let root = graph.modules.first().map_or("", |module| module.path.as_str());
    match fault {
        Fault::Source(finding) => Finder { graph, linked, root }.diagnostic(finding),
        Fault::NoEntryPoint => Diagnostic::error(fault.to_string())
            .in_file(root)
            .with_help("mark a function with `@vertex`, `@fragment` or `@compute`"),
        Fault::TooDeep => Diagnostic::error(fault.to_string())
            .in_file(root)
            .with_help("split long expressions with `let`, and use `switch` for long chains"),
        Fault::TooLong { .. } => Diagnostic::error(fault.to_string()).in_file(root),
        Fault::Internal(_) => Diagnostic::error(fault.to_string()).in_file(root).with_help(
            "this is a fault of the compiler, not only of the shader; undo the last edit to go on",
        ),
    }
}

/// The lint's warnings of the linked text, without what its author allows.
pub fn warnings(graph: &Graph, linked: &Linked, warnings: Vec<Warning>) -> Vec<Diagnostic> {
    let root = graph.modules.first().map_or("", |module| module.path.as_str());
    let finder = Finder { graph, linked, root };
    let mut diagnostics = Vec::new();
    let files = graph.modules.iter().map(|module| (module.path.as_str(), &*module.text));
    let allowances = Allowances::read(files, &mut diagnostics);
    for Warning { rule, finding, help } in warnings {
        if diagnostics.len() >= limits::WARNINGS_MAX {
            let message = format!("only the first {} warnings are shown", limits::WARNINGS_MAX);
            diagnostics.push(Diagnostic::warning(message).in_file(root));
            break;
        }
        diagnostics.extend(allowances.warn(finder.diagnostic(finding), rule, &help));
    }
    diagnostics
}

/// What naga or the lint found in the linked text.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What is wrong.
    pub message: String,
    /// Why.
    pub notes: Vec<String>,
    /// Bytes of the linked text that it is about, the main ones first, with what each is.
    pub labels: Vec<(Range<usize>, String)>,
}

struct Finder<'a> {
    graph: &'a Graph,
    linked: &'a Linked,
    root: &'a str,
}

impl Finder<'_> {
    fn diagnostic(&self, finding: Finding) -> Diagnostic {
        let mut labels = finding.labels.into_iter();
        let main = labels.next().map(|(range, _)| range);
        let origin = main.clone().and_then(|range| self.linked.origin(range));
        let (Some(main), Some((module, range))) = (main, origin) else {
            let mut diagnostic = Diagnostic::error(finding.message).in_file(self.root);
            diagnostic.notes = finding.notes;
            return diagnostic;
        };
        let help = self.help(module, &finding.message, main, range.clone());
        let mut diagnostic = self.graph.error_at(module, range, finding.message);
        let labels = labels.filter_map(|(range, label)| self.place(range, &label));
        let notes: Vec<String> = finding.notes.into_iter().chain(labels).collect();
        diagnostic.notes.splice(0..0, notes);
        diagnostic.help = help;
        diagnostic
    }

    /// `what: file:line:column`
    fn place(&self, range: Range<usize>, label: &str) -> Option<String> {
        let (module, range) = self.linked.origin(range)?;
        let module = &self.graph.modules[module];
        let span = Span::new(&module.text, range);
        // naga names labels of validation errors by its own types.
        let label = if label.is_empty() || label.starts_with("naga::") { "see" } else { label };
        Some(format!("{label}: {}:{}:{}", module.path, span.line, span.column))
    }

    /// `linked` and `range` are the same bytes, of the linked text and of the module.
    fn help(
        &self,
        module: usize,
        message: &str,
        linked: Range<usize>,
        range: Range<usize>,
    ) -> Option<String> {
        let text = &self.graph.modules[module].text;
        if message.starts_with("no definition in scope") {
            let globals = self.graph.modules.iter().flat_map(|module| &module.view.outline.declarations);
            let globals = globals.map(|declaration| declaration.name.name.as_str());
            let builtins = naga::keywords::wgsl::BUILTIN_IDENTIFIERS.iter().copied();
            let names = words(text).into_iter().chain(globals).chain(builtins);
            did_you_mean(self.linked.text.get(linked)?, names)
        } else if message.starts_with("invalid field accessor") {
            let texts = self.graph.modules.iter().flat_map(|module| words(&module.text));
            did_you_mean(self.linked.text.get(linked)?, texts)
        } else if message.starts_with("expected `;`") {
            let before = text[..range.start].trim_end();
            let line = Span::new(text, before.len()..before.len()).line;
            Some(format!("a `;` may be missing at the end of line {line}"))
        } else if message.contains("`f16`") || text.get(range).is_some_and(|text| text.contains("f16")) {
            Some("Kiln compiles for devices without optional features: use `f32`".to_owned())
        } else if message.ends_with(writable::ENDING) {
            Some("compute it in a function, or from a `const` and features".to_owned())
        } else {
            None
        }
    }
}

fn words(text: &str) -> Vec<&str> {
    // Text that does not tokenise never reaches naga.
    let tokens = token::tokenize(text).unwrap_or_default();
    let words = tokens.iter().filter(|token| token.kind == Kind::Word);
    words.map(|token| &text[token.range()]).collect()
}

fn did_you_mean<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<String> {
    suggest::closest(wrong, names).map(|name| format!("did you mean `{name}`?"))
}
