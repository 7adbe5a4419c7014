//! `kiln init`: a project that runs as it is.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context as _;

use crate::args::{InitArgs, SampleArgs};
use crate::out::say;
use crate::{INPUT_IS_WRONG, report};

pub(crate) fn run(args: &InitArgs) -> anyhow::Result<ExitCode> {
    let occupied = args.dir.read_dir().is_ok_and(|mut entries| entries.next().is_some());
    if occupied || args.dir.is_file() {
        eprintln!("error: {} exists and is not empty\n  help: choose a new folder", args.dir.display());
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    let files = write_sample(&args.dir, &args.sample)?;
    for (path, bytes) in &files {
        say!("{:>10}  {path}", report::size(*bytes));
    }
    let dir = args.dir.display();
    say!(
        "\nNext:\n  kiln watch {dir}      bake, then follow every edit\n  kiln preview {dir}    look at it (in a second terminal)"
    );
    Ok(ExitCode::SUCCESS)
}

/// Writes the sample project; returns its files and their lengths.
pub(crate) fn write_sample(dir: &Path, args: &SampleArgs) -> anyhow::Result<Vec<(String, u64)>> {
    let files = kiln_sample::files(&options(args));
    let mut written = Vec::new();
    for (path, bytes) in files {
        kiln_build::write_atomically(&kiln_build::Disk, &dir.join(&path), &bytes)
            .context("writing the sample project")?;
        written.push((path, bytes.len() as u64));
    }
    Ok(written)
}

pub(crate) fn options(args: &SampleArgs) -> kiln_sample::SampleOptions {
    let sun =
        kiln_sample::sky::SunPosition { elevation_deg: args.sun_elevation, azimuth_deg: args.sun_azimuth };
    kiln_sample::SampleOptions { panorama_width: args.panorama_width as usize, sun }
}
