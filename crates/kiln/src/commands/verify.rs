//! `kiln verify`: the same bytes elsewhere?

use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use anyhow::Context as _;
use kiln_build::Digest;
use kiln_project::{VerifyError, verify};

use crate::args::VerifyArgs;
use crate::commands::bake::{progress_bar, show_progress};
use crate::commands::why::suggestion;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.build.dir)?;
    let _hold = engine.store().hold();
    let plan = kiln_project::plan(&engine, None).context("planning")?;
    for target in &args.targets {
        if plan.actions_of(target).is_none() {
            eprintln!("error: there is no target `{target}`{}", suggestion(target, &plan));
            return Ok(ExitCode::from(INPUT_IS_WRONG));
        }
    }
    let mut targets = args.targets.clone();
    if targets.is_empty() {
        let made = plan.targets.iter().filter(|target| !target.parts.is_empty());
        targets = made.map(|target| target.name.clone()).collect();
        if !args.all {
            // A sample by chance, the same one for the same seed.
            targets.sort_by_key(|name| Digest::of(format!("{} {name}", args.seed).as_bytes()));
            targets.truncate(args.sample.max(1));
            targets.sort();
        }
    }
    if targets.is_empty() {
        say!("this project makes nothing, so there is nothing to verify");
        return Ok(ExitCode::SUCCESS);
    }
    let bar = progress_bar();
    let progress = show_progress(&bar);
    let cancel = AtomicBool::new(false);
    let options = place::run_options(&args.build, true, &cancel, &progress);
    let verified = verify(&engine, &targets, &options);
    bar.finish_and_clear();
    let verified = match verified {
        Err(error @ (VerifyError::OutOfDate(_) | VerifyError::AtFault(_))) => {
            eprintln!("error: {error}");
            return Ok(ExitCode::from(INPUT_IS_WRONG));
        }
        verified => verified.context("verifying")?,
    };
    if args.build.json {
        say!("{:#}", serde_json::to_value(&verified)?);
    } else {
        for mismatch in &verified.mismatches {
            let short = |digest: Option<Digest>| {
                digest.map_or_else(|| "damaged or not made".to_owned(), |digest| digest.short())
            };
            say!(
                "{} of `{}` is {} in the store and {} when it is made afresh",
                mismatch.output,
                mismatch.action,
                short(mismatch.stored),
                short(mismatch.fresh)
            );
        }
        say!(
            "{} ({}): {} ran in a fresh folder; {} with {} compared, {} different",
            report::count(verified.targets.len(), "target"),
            verified.targets.join(", "),
            report::count(verified.actions, "action"),
            report::count(verified.outputs, "output"),
            report::size(verified.bytes),
            verified.mismatches.len()
        );
    }
    Ok(if verified.mismatches.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}
