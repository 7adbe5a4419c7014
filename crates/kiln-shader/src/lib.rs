//! Links WGSL modules, validates them with naga, reflects their interface and explains what is wrong.
//!
//! Start at [`compile`]: a root module and a feature set in, canonical WGSL and its [`Reflection`] out.
//!
//! Sources are WGSL with a subset of WESL's imports and conditions; `docs/shader-interface.md` describes it.
//!
//! Conventions: module paths are project-relative with `/`; every diagnostic points at the file its author
//! wrote, never at linked text. Equal inputs give equal text.
//!
//! Not here: files (a caller reads them), GPU pipelines (`kiln-preview`), which feature sets exist (`kiln-project`).

use std::collections::BTreeSet;

use kiln_diagnostic::Diagnostic;

pub use emit::*;
pub use link::Read;
pub use reflect::*;

mod canonical;
mod condition;
mod describe;
mod emit;
mod explain;
mod front;
mod interface;
mod join;
mod limits;
mod link;
mod lint;
mod module;
mod reflect;
mod resolve;
mod suggest;
#[cfg(test)]
mod tests;
mod token;

/// A file that was looked at. Missing ones count too, because their appearance changes the result.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Dependency {
    /// Path relative to the project.
    pub path: String,
    /// Whether it exists.
    pub found: bool,
}

/// A valid shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    /// Canonical WGSL: comments, white space, unused functions and unused constants do not change it.
    /// Global variables, entry points, struct members and overrides have the names their author gave them,
    /// unless that is a name of WGSL's own (a variable `distance`): the reflection has it all the same, and
    /// names entry points as this text does.
    pub wgsl: String,
    /// What it offers and asks for.
    pub reflection: Reflection,
}

/// What a compile gave.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The shader, unless something is wrong with it.
    pub compiled: Option<Compiled>,
    /// What is wrong, in the order of modules.
    pub diagnostics: Vec<Diagnostic>,
    /// Every file looked at, in that order.
    pub dependencies: Vec<Dependency>,
    /// Features that conditions of the loaded modules name: feature sets that agree on these compile to
    /// the same shader.
    pub features: BTreeSet<String>,
}

/// Compiles the module `root` for a set of features. `read` gets paths relative to the project and is asked
/// at most once for each.
pub fn compile(root: &str, features: &BTreeSet<String>, read: &mut Read<'_>) -> Outcome {
    compile_module(root, features, read, false)
}

/// Does what [`compile`] does, and warns of what is valid but doubtful: arguments at the edge of a function's
/// domain, derivatives in control flow that is not uniform, and what is slow for no reason. A warning stands at
/// its author's file and line, as an error does, and is no error: there is a shader all the same.
///
/// `// kiln: allow(domain) why`, with the name of the lint that a warning ends with, on its line or the line
/// above allows it.
pub fn lint(root: &str, features: &BTreeSet<String>, read: &mut Read<'_>) -> Outcome {
    compile_module(root, features, read, true)
}

fn compile_module(root: &str, features: &BTreeSet<String>, read: &mut Read<'_>, lints: bool) -> Outcome {
    let graph = link::Graph::load(root, condition::Mode::Features(features), read);
    let (mut compiled, mut found) = (None, Vec::new());
    if !kiln_diagnostic::has_errors(&graph.diagnostics) {
        let linked = join::Linked::join(&graph);
        match front::compile_linked(&linked.text, lints) {
            Ok((shader, warnings)) => {
                compiled = Some(shader);
                if lints {
                    found = explain::warnings(&graph, &linked, warnings);
                }
            }
            Err(fault) => found.push(explain::diagnostic(&graph, &linked, fault)),
        }
    }
    let link::Graph { dependencies, features, mut diagnostics, .. } = graph;
    diagnostics.append(&mut found);
    Outcome { compiled, diagnostics, dependencies, features }
}

/// The files that `root` imports, transitively and under any features.
pub fn scan_dependencies(root: &str, read: &mut Read<'_>) -> Vec<Dependency> {
    link::Graph::load(root, condition::Mode::Everything, read).dependencies
}
