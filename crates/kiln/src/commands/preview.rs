//! `kiln preview`: the window, or pictures without one.

use std::process::ExitCode;
use std::time::Duration;

use kiln_preview::{HeadlessOptions, Selection, View, WindowOptions, run_headless, run_window};

use crate::args::PreviewArgs;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    let selection = Selection { scene: args.scene.clone(), env: args.env.clone() };
    let view = View { exposure_ev: args.exposure, ..View::default() };
    let socket = place::socket_of(&args.dir)?;
    if args.headless {
        return headless(args, socket, selection, view);
    }
    if !place::has_display() {
        eprintln!(
            "error: there is no display for a window\n  help: `kiln preview {} --headless --out frames` writes pictures instead",
            args.dir.display()
        );
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    run_window(WindowOptions { socket, selection, view })?;
    Ok(ExitCode::SUCCESS)
}

fn headless(
    args: &PreviewArgs,
    socket: std::path::PathBuf,
    selection: Selection,
    view: View,
) -> anyhow::Result<ExitCode> {
    let done = run_headless(&HeadlessOptions {
        socket,
        out: args.out.clone(),
        frames: args.frames,
        size: args.size,
        selection,
        view,
        rotation_step_rad: args.turn.to_radians(),
        revision_min: args.wait_revision,
        timeout: Duration::from_secs(args.timeout_s),
    })?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&done)?);
        return Ok(ExitCode::SUCCESS);
    }
    report::print_diagnostics(&done.diagnostics, false);
    done.notes.iter().for_each(|note| println!("note: {note}"));
    println!(
        "revision {} on {}: prepared in {}",
        done.revision,
        done.adapter,
        report::duration(done.prepare_ms)
    );
    for (file, ms) in done.files.iter().zip(&done.frame_ms) {
        println!("{}  ({})", file.display(), report::duration(*ms));
    }
    Ok(ExitCode::SUCCESS)
}
