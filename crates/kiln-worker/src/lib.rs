//! Compiles shaders in a process of its own: no input takes the daemon down, hangs it or eats its memory.
//!
//! Start at [`compile`]. A program that calls [`use_program`] first has its tasks done by
//! persistent child processes that run [`serve`]; one that does not (a test, a tool of its own) does them itself, and so
//! trusts its input.
//!
//! Conventions: a child reads tasks from its standard input and writes replies to its standard output, each as four bytes
//! of length, little-endian, and that much JSON. A task holds the text of every file: a child opens none. The limits are
//! [`Limits::USUAL`]; a child that breaks one, or dies of its own, is reported as [`Died`] and replaced.
//!
//! Not here: compiling (`kiln-shader`), which shaders to compile (`kiln-project`).

mod frame;
mod host;
mod serve;
mod task;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::OnceLock;

use kiln_diagnostic::Diagnostic;
use kiln_shader::{Compiler, Emitted, Language, Outcome, Program};

pub use host::{Died, Limits, Workers};
pub use serve::serve;
pub use task::{Reply, Sources, Task};

/// Who does the tasks of this process: which program that is decides no result, so it is no setting of a project.
static WORKERS: OnceLock<Workers> = OnceLock::new();

/// From here on tasks are done by child processes, started as `program` with `arguments`. The first call counts.
pub fn use_program(program: PathBuf, arguments: &[&str]) {
    WORKERS.get_or_init(|| Workers::new(program, arguments, Limits::USUAL));
}

/// Starts a child before there is work for it, so that the first edit need not wait for that.
pub fn warm_up() {
    if let Some(workers) = WORKERS.get() {
        workers.warm_up();
    }
}

/// [`kiln_shader::compile`], where `sources` has the text of each file that may be asked for.
///
/// # Errors
/// The child died of it.
pub fn compile(program: &Program, features: &BTreeSet<String>, sources: Sources) -> Result<Outcome, Died> {
    compile_with(program, features, sources, false)
}

/// [`kiln_shader::lint`], likewise.
///
/// # Errors
/// The child died of it.
pub fn lint(program: &Program, features: &BTreeSet<String>, sources: Sources) -> Result<Outcome, Died> {
    compile_with(program, features, sources, true)
}

fn compile_with(
    program: &Program,
    features: &BTreeSet<String>,
    sources: Sources,
    lints: bool,
) -> Result<Outcome, Died> {
    let task = Task::Compile { program: program.clone(), features: features.clone(), sources, lints };
    match run(&task)? {
        Reply::Compiled(outcome) => Ok(outcome),
        Reply::Emitted(_) => Err(other_answer()),
    }
}

/// [`kiln_shader::emit`]; what cannot be written comes as a message.
///
/// # Errors
/// The child died of it.
pub fn emit(wgsl: String, language: Language) -> Result<Result<Vec<Emitted>, Diagnostic>, Died> {
    match run(&Task::Emit { wgsl, language })? {
        Reply::Emitted(emitted) => Ok(emitted),
        Reply::Compiled(_) => Err(other_answer()),
    }
}

fn other_answer() -> Died {
    Died::NoWorker("it answered another question".to_owned())
}

/// Does a task: in a child, if [`use_program`] was called.
fn run(task: &Task) -> Result<Reply, Died> {
    match WORKERS.get() {
        Some(workers) => workers.run(task),
        None => Ok(task.perform(&mut Compiler::default())),
    }
}
