//! `kiln stop`: ends the daemon of a project.

use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use kiln_link::ControlError;

use crate::args::StopArgs;
use crate::out::say;
use crate::place;

/// A build ends within its actions at work; what was made of it is still written.
const END_LIMIT: Duration = Duration::from_secs(60);

pub(crate) fn run(args: &StopArgs) -> anyhow::Result<ExitCode> {
    match kiln_link::stop(&place::socket_of(&args.dir)?, END_LIMIT) {
        Ok(()) => say!("ended; nothing published was lost"),
        // What was asked for is so already.
        Err(ControlError::NoDaemon) => say!("no daemon serves this project"),
        Err(error) => return Err(error).context("stopping the daemon"),
    }
    Ok(ExitCode::SUCCESS)
}
