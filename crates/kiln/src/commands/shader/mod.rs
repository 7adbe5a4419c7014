//! `kiln shader …`: shaders of a project, or of none.

mod check;
mod emit;
mod reflect;
mod subject;
mod variants;

use std::process::ExitCode;

use kiln_diagnostic::{Diagnostic, has_errors};

use crate::INPUT_IS_WRONG;
use crate::args::ShaderCommand;

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
