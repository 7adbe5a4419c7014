//! `kiln shader …`: shaders of a project, or of none.

mod check;
mod emit;
mod reflect;
mod subject;
mod variants;

use std::process::ExitCode;
use std::time::Instant;

use kiln_diagnostic::{Diagnostic, has_errors};

use crate::INPUT_IS_WRONG;
use crate::args::{ShaderCommand, SubjectArgs};

pub(crate) use subject::is_shader;

pub(crate) fn run(command: &ShaderCommand) -> anyhow::Result<ExitCode> {
    match command {
        ShaderCommand::Check(args) => check::run(args),
        ShaderCommand::Variants(args) => variants::run(args),
        ShaderCommand::Reflect(args) => reflect::run(args),
        ShaderCommand::Emit(args) => emit::run(args),
    }
}

fn exit_code(diagnostics: &[Diagnostic]) -> ExitCode {
    if has_errors(diagnostics) { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS }
}

/// A shader that was compiled in all its variants, with warnings of what is doubtful.
pub(crate) struct Linted {
    /// Its name in a project, or its first file.
    pub(crate) name: String,
    pub(crate) files: Vec<String>,
    /// Variants that compile.
    pub(crate) good: usize,
    pub(crate) variants: usize,
    pub(crate) diagnostics: Vec<Diagnostic>,
    pub(crate) ms: f64,
}

/// Compiles and lints the shaders that a command line names.
pub(crate) fn lint_all(args: &SubjectArgs) -> anyhow::Result<Vec<Linted>> {
    let (subjects, _) = subject::subjects(args)?;
    let lint = |subject: &subject::Subject| {
        let start = Instant::now();
        let variants = subject.lint()?;
        let mut diagnostics = subject.unknown_features();
        diagnostics.extend(subject::merged(&variants));
        Ok(Linted {
            name: subject.name.clone(),
            files: subject.program.roots.clone(),
            good: variants.iter().filter(|variant| variant.is_good()).count(),
            variants: variants.len(),
            diagnostics,
            ms: start.elapsed().as_secs_f64() * 1e3,
        })
    };
    subjects.iter().map(lint).collect()
}
