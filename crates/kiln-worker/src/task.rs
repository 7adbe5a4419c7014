//! What a worker is asked, and what it answers.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use kiln_diagnostic::Diagnostic;
use kiln_shader::{Compiler, Emitted, Language, Outcome, Program};
use serde::{Deserialize, Serialize};

/// A shader's files: the text of each, by its path relative to the project; those that are missing too.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sources(pub BTreeMap<String, Option<Arc<str>>>);

impl Sources {
    /// A file's text; `None` if it is missing or was not given.
    pub fn read(&self, path: &str) -> Option<Arc<str>> {
        self.0.get(path).cloned().flatten()
    }
}

/// Work for a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Task {
    /// [`kiln_shader::compile`].
    Compile {
        /// The shader.
        program: Program,
        /// Features that hold.
        features: BTreeSet<String>,
        /// All it may import.
        sources: Sources,
        /// Whether to warn of what is doubtful: [`kiln_shader::lint`].
        lints: bool,
    },
    /// [`kiln_shader::emit`].
    Emit {
        /// Canonical text.
        wgsl: String,
        /// What to write it in.
        language: Language,
    },
}

/// What came of a task, in the same order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// Of [`Task::Compile`].
    Compiled(Outcome),
    /// Of [`Task::Emit`]: the files, or why there are none.
    Emitted(Result<Vec<Emitted>, Diagnostic>),
}

impl Task {
    /// Does the work here and now.
    pub fn perform(&self, compiler: &mut Compiler) -> Reply {
        match self {
            Task::Compile { program, features, sources, lints } => {
                let compile = if *lints { Compiler::lint } else { Compiler::compile };
                Reply::Compiled(compile(compiler, program, features, &mut |path| sources.read(path)))
            }
            Task::Emit { wgsl, language } => {
                Reply::Emitted(kiln_shader::emit(wgsl, *language).map_err(|error| error.diagnostic()))
            }
        }
    }
}
