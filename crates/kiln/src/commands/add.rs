//! `kiln add`: environments and scenes for a project.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use kiln_link::{Answer, Ask, ControlError};
use kiln_project::{Added, add_files};

use crate::args::AddArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

/// Files of several gigabytes are copied.
const ANSWER_LIMIT: Duration = Duration::from_secs(600);

pub(crate) fn run(args: &AddArgs) -> anyhow::Result<ExitCode> {
    let folder = place::project_folder(&args.dir)?;
    let absolute =
        |path: &PathBuf| std::path::absolute(path).with_context(|| format!("finding {}", path.display()));
    let paths = args.files.iter().map(absolute).collect::<anyhow::Result<Vec<PathBuf>>>()?;
    let text = |path: &PathBuf| path.to_str().map(str::to_owned);
    // A name that the wire cannot carry is still one that this program can read.
    let answer = match paths.iter().map(text).collect::<Option<Vec<String>>>() {
        Some(paths) => ask(&args.dir, Ask::AddFiles { paths }, ANSWER_LIMIT)?,
        None => None,
    };
    let answer = answer.unwrap_or_else(|| {
        let Added { targets, messages, refused } = add_files(&folder, &paths);
        Answer { message: messages.join("; "), diagnostics: refused, targets, ..Answer::default() }
    });
    Ok(say_answer(&answer))
}

/// Asks the daemon of a project; `None` if there is none: then nobody else holds the project.
pub(crate) fn ask(dir: &Path, ask: Ask, limit: Duration) -> anyhow::Result<Option<Answer>> {
    match kiln_link::ask(&place::socket_of(dir)?, ask, limit) {
        Ok(answer) => Ok(Some(answer)),
        Err(ControlError::NoDaemon) => Ok(None),
        Err(error) => Err(error).context("asking the daemon"),
    }
}

/// Prints what became of a request.
pub(crate) fn say_answer(answer: &Answer) -> ExitCode {
    answer.message.split("; ").filter(|message| !message.is_empty()).for_each(|message| say!("{message}"));
    report::print_diagnostics(&answer.diagnostics, true);
    if answer.is_done() { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) }
}
