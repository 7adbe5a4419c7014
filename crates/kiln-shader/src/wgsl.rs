//! WGSL: link, compile, explain.

use std::collections::BTreeSet;
use std::ops::Range;

use kiln_diagnostic::{Diagnostic, has_errors};

use crate::condition::Mode;
use crate::front::Fault;
use crate::join::Linked;
use crate::library::Library;
use crate::link::{Graph, Read};
use crate::{Compiler, Outcome, Scan, explain, parameter, source_map};

/// Compiles the root module `root`; with `lints`, also warns of what is doubtful.
pub fn compile(
    compiler: &mut Compiler,
    root: &str,
    features: &BTreeSet<String>,
    lints: bool,
    read: &mut Read<'_>,
) -> Outcome {
    let mut graph = Graph::load(root, Mode::Features(features), &mut compiler.library, read);
    let mut outcome = Outcome {
        diagnostics: std::mem::take(&mut graph.diagnostics),
        dependencies: std::mem::take(&mut graph.dependencies),
        features: std::mem::take(&mut graph.features),
        ..Outcome::default()
    };
    if has_errors(&outcome.diagnostics) {
        return outcome;
    }
    let linked = Linked::join(&graph);
    match compiler.compile_linked(&linked.text, lints) {
        Ok(shader) => {
            if lints {
                outcome.diagnostics.extend(explain::warnings(&graph, &linked, shader.warnings));
            }
            outcome.source_map = source_map::place(shader.functions, &graph, &linked);
            let annotations = annotations(&graph, &mut outcome.diagnostics);
            let mut compiled = shader.compiled;
            compiled.reflection.parameters = parameter::parameters(&compiled.reflection, annotations);
            outcome.compiled = Some(compiled);
        }
        Err(fault) => {
            outcome.is_library = matches!(fault, Fault::NoEntryPoint);
            outcome.diagnostics.extend(explain::all(&graph, &linked, fault));
        }
    }
    outcome
}

/// The annotations of a module, and of those it imports, that need not be valid.
pub fn program_annotations(
    root: &str,
    features: &BTreeSet<String>,
    read: &mut Read<'_>,
) -> Vec<parameter::Annotation> {
    let graph = Graph::load(root, Mode::Features(features), &mut Library::default(), read);
    annotations(&graph, &mut Vec::new())
}

fn annotations(graph: &Graph, diagnostics: &mut Vec<Diagnostic>) -> Vec<parameter::Annotation> {
    let of_module = |module: &crate::link::Module| {
        let cuts = &module.view.cuts;
        let is_kept = |name: Range<usize>| !cuts.iter().any(|cut| cut.contains(&name.start));
        parameter::annotations(&module.path, &module.text, is_kept, diagnostics)
    };
    graph.modules.iter().flat_map(of_module).collect()
}

/// Looks at imports and conditions under any features.
pub fn scan(root: &str, read: &mut Read<'_>) -> Scan {
    let graph = Graph::load(root, Mode::Everything, &mut Library::default(), read);
    Scan { dependencies: graph.dependencies, features: graph.features }
}
