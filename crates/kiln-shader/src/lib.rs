//! Links WGSL modules, validates them with naga, reflects their interface and explains what is wrong.
//!
//! Start at [`compile`]: a [`Program`] and a feature set in, canonical WGSL and its [`Reflection`] out. Who compiles many
//! keeps a [`Compiler`].
//!
//! Sources are WGSL with a subset of WESL's imports and conditions; `docs/shader-interface.md` describes it.
//!
//! Conventions: module paths are project-relative with `/`; every diagnostic points at the file its author
//! wrote, never at linked text. Equal inputs give equal text.
//!
//! Not here: files (a caller reads them), GPU pipelines (`kiln-preview`), which feature sets exist (`kiln-project`).

use std::collections::BTreeSet;

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

pub use compiler::Compiler;
pub use emit::*;
pub use link::Read;
pub use reflect::*;
pub use source_map::{FunctionSource, SourceMap};
pub use write_back::{SourceEdit, write_parameter};

mod canonical;
mod compiler;
mod condition;
mod describe;
mod emit;
mod explain;
mod front;
mod glsl;
mod interface;
mod join;
mod lenient;
mod library;
mod limits;
mod link;
mod lint;
mod module;
mod names;
mod parameter;
mod reflect;
mod resolve;
mod scope;
mod source_map;
mod suggest;
#[cfg(test)]
mod tests;
mod token;
mod wgsl;
mod writable;
mod write_back;

/// A file that was looked at. Missing ones count too, because their appearance changes the result.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Dependency {
    /// Path relative to the project.
    pub path: String,
    /// Whether it exists.
    pub found: bool,
}

/// A valid shader.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The shader, unless something is wrong with it.
    pub compiled: Option<Compiled>,
    /// Where its functions come from.
    pub source_map: SourceMap,
    /// Whether all that is wrong is that nothing can be drawn or dispatched with it: a module for others to import.
    #[serde(default)]
    pub is_library: bool,
    /// What is wrong, the first of each module, in the order in which modules were found.
    pub diagnostics: Vec<Diagnostic>,
    /// Every file looked at, in that order.
    pub dependencies: Vec<Dependency>,
    /// Features that conditions of the loaded modules name: feature sets that agree on these compile to
    /// the same shader.
    pub features: BTreeSet<String>,
}

/// A shader as its author names it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Program {
    /// Root files, relative to the project: one WGSL module, or a GLSL file for each stage.
    pub roots: Vec<String>,
    /// For GLSL: `#define`s before the first line, as (name, replacement).
    #[serde(default)]
    pub defines: Vec<(String, String)>,
    /// For GLSL: folders in which `#include` looks too, relative to the project.
    #[serde(default)]
    pub include_dirs: Vec<String>,
    /// For GLSL: files whose text goes before each root's, relative to the project.
    #[serde(default)]
    pub prelude: Vec<String>,
}

impl Program {
    /// A program of one root file.
    pub fn of(root: &str) -> Program {
        Program { roots: vec![root.to_owned()], ..Program::default() }
    }

    /// Whether it is GLSL, by its files' names; else it is WGSL.
    pub fn is_glsl(&self) -> bool {
        self.roots.iter().any(|root| glsl::is_glsl(root))
    }

    /// The file that stands for the program in messages: its first.
    pub fn subject(&self) -> &str {
        self.roots.first().map_or("", String::as_str)
    }
}

/// Compiles a program for a set of features: in WGSL they are what `@if` asks for, in GLSL the feature `sheen` is the macro
/// `FEATURE_SHEEN`. `read` gets paths relative to the project and is asked at most once for each.
pub fn compile(program: &Program, features: &BTreeSet<String>, read: &mut Read<'_>) -> Outcome {
    Compiler::default().compile(program, features, read)
}

/// Does what [`compile`] does, and warns of what is valid but doubtful: arguments at the edge of a function's
/// domain, derivatives in control flow that is not uniform, and what is slow for no reason. A warning stands at
/// its author's file and line, as an error does, and is no error: there is a shader all the same.
///
/// `// kiln: allow(domain) why`, with the name of the lint that a warning ends with, on its line or the line
/// above allows it.
pub fn lint(program: &Program, features: &BTreeSet<String>, read: &mut Read<'_>) -> Outcome {
    Compiler::default().lint(program, features, read)
}

/// What a shader may need, under any features.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scan {
    /// Files it imports, directly or not.
    pub dependencies: Vec<Dependency>,
    /// Features that its conditions name: no other makes a difference.
    pub features: BTreeSet<String>,
}

/// Looks at a shader's imports and conditions, without compiling it.
pub fn scan(program: &Program, read: &mut Read<'_>) -> Scan {
    match program.is_glsl() {
        true => glsl::scan(program, read),
        false => wgsl::scan(program.subject(), read),
    }
}
