//! `kiln gc`: a smaller cache.

use std::process::ExitCode;

use anyhow::Context as _;
use kiln_build::CollectOptions;

use crate::args::GcArgs;
use crate::out::say;
use crate::{place, report};

pub(crate) fn run(args: &GcArgs) -> anyhow::Result<ExitCode> {
    let store = place::open_store()?;
    let bytes_max = match args.max_size {
        Some(bytes) => bytes,
        None => place::cache_bytes_max()?,
    };
    let now = CollectOptions { bytes_max, wait: false, dry_run: args.dry_run };
    let collected = match store.collect(&now).context("collecting")? {
        Some(collected) => collected,
        None => {
            eprintln!("waiting for a build to end …");
            store.collect(&CollectOptions { wait: true, ..now }).context("collecting")?.unwrap_or_default()
        }
    };
    if args.json {
        say!("{:#}", serde_json::to_value(&collected)?);
        return Ok(ExitCode::SUCCESS);
    }
    for project in &collected.forgotten_projects {
        say!("forgot {project}: its folder is gone, or nobody has built it for a month");
    }
    let would = if args.dry_run { "would be " } else { "" };
    say!(
        "{} with {} {would}removed; {} left, {} of it published",
        report::count(collected.removed_files, "file"),
        report::size(collected.removed_bytes),
        report::size(collected.kept_bytes),
        report::size(collected.held_bytes)
    );
    Ok(ExitCode::SUCCESS)
}
