//! `kiln check`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::RunArgs;

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  kiln check look                          environments, maps, shaders and a white furnace of a project
  kiln check piazza.hdr --html report.html what is wrong with a panorama, and where
  kiln check specular.ktx2 --source piazza.hdr    a map that any tool baked, against what it was made of
  kiln check look --deny warnings --json   for CI

What is known and accepted goes into kiln.toml with its reason:
  [check]
  allow = [{ check = \"wrap-column\", target = \"env/stage\", reason = \"hidden behind the set\" }]

Exit codes: 0 nothing that counts, 1 an error (with --deny warnings a warning too) that is not allowed, 2 the tool failed.")]
pub(crate) struct HealthArgs {
    /// A project's folder, panoramas and cubes (.hdr .exr .png .jpg), baked cubes (.ktx2 .ktx .dds), shaders
    #[arg(default_value = ".", value_name = "DIR|FILE")]
    pub(crate) paths: Vec<PathBuf>,
    /// What counts besides errors
    #[arg(long, value_name = "WHAT")]
    pub(crate) deny: Option<Deny>,
    /// Write a page with pictures of what is wrong where
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
    /// The environment that baked cubes on the command line were made of [default: their level 0]
    #[arg(long, value_name = "FILE")]
    pub(crate) source: Option<PathBuf>,
    /// Do not draw white surfaces in white light with the project's shaders
    #[arg(long)]
    pub(crate) no_furnace: bool,
    /// Give up on a check after this many seconds, and say so
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub(crate) time_limit: u64,
    /// Print what is checked and by what name, and check nothing
    #[arg(long)]
    pub(crate) list: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Deny {
    /// Warnings fail as errors do
    Warnings,
}
