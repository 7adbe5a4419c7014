//! The `kiln` command.
//!
//! Start at [`main`]: it parses the command line and hands over to one module of `commands`.
//!
//! Conventions: what a person asked for goes to standard output, progress and complaints to standard error; with
//! `--json` standard output holds JSON alone. Exit code 0: done; 1: the input is wrong; 2: the tool failed.
//!
//! Not here: any work on light, shaders or scenes.

#![expect(clippy::print_stderr, reason = "this is the program that talks to the user")]

use std::process::ExitCode;

use clap::Parser as _;

mod args;
mod ci;
mod commands;
mod log;
mod out;
mod picture;
mod place;
mod report;
mod screen;
mod sheet;

/// The input is wrong, and the diagnostics have said how.
pub(crate) const INPUT_IS_WRONG: u8 = 1;
/// The tool could not do its work.
pub(crate) const TOOL_FAILED: u8 = 2;

/// How this program is started to compile shaders for another of its kind.
const WORKER: &str = "shader-worker";

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|first| first == WORKER) {
        // Whoever started it reads how it ended.
        return if kiln_worker::serve().is_ok() { ExitCode::SUCCESS } else { ExitCode::from(TOOL_FAILED) };
    }
    kiln_worker::use_program(place::this_program(), &[WORKER]);
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(asked) => {
            // Help and version are errors to clap, but not to the user; a closed pipe is nothing to report.
            let _ = asked.print();
            return if asked.use_stderr() { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS };
        }
    };
    let result = match args.command {
        args::Command::Init(args) => commands::init::run(&args),
        args::Command::Bake(args) => commands::bake::run(&args),
        args::Command::Env(args) => commands::env::run(&args),
        args::Command::Export(args) => commands::export::run(&args),
        args::Command::Accuracy(args) => commands::accuracy::run(&args),
        args::Command::Check(args) => commands::check::run(&args),
        args::Command::Shader(command) => commands::shader::run(&command),
        args::Command::Plan(args) => commands::plan::run(&args),
        args::Command::Why(args) => commands::why::run(&args),
        args::Command::Graph(args) => commands::graph::run(&args),
        args::Command::Verify(args) => commands::verify::run(&args),
        args::Command::Gc(args) => commands::gc::run(&args),
        args::Command::Doctor(args) => commands::doctor::run(&args),
        args::Command::Add(args) => commands::add::run(&args),
        args::Command::Set(args) => commands::set::run(&args),
        args::Command::Watch(args) => commands::watch::run(&args),
        args::Command::Status(args) => commands::status::run(&args),
        args::Command::Stop(args) => commands::stop::run(&args),
        #[cfg(feature = "preview")]
        args::Command::Preview(args) => commands::preview::run(&args),
        #[cfg(feature = "preview")]
        args::Command::Render(args) => commands::render::run(&args),
        args::Command::Diff(args) => commands::diff::run(&args),
        args::Command::Demo(args) => commands::demo::run(&args),
    };
    result.unwrap_or_else(|error| {
        if error.is::<place::WrongInput>() {
            eprintln!("error: {error}");
            return ExitCode::from(INPUT_IS_WRONG);
        }
        eprintln!("kiln: {error:#}");
        if is_disk_full(&error) {
            eprintln!("  help: `kiln gc --max-size 1GiB` frees what the cache does not need; nothing published is lost");
        }
        ExitCode::from(TOOL_FAILED)
    })
}

fn is_disk_full(error: &anyhow::Error) -> bool {
    error.downcast_ref::<kiln_build::Error>().is_some_and(kiln_build::Error::is_disk_full)
}
