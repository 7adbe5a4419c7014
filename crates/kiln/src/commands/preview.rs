//! `kiln preview`: the window, or pictures without one.

use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use kiln_gpu::Gpu;
use kiln_link::{Client, ClientEvent, FrameReport};
use kiln_preview::HeadlessViewer;
use kiln_preview::{
    HeadlessOptions, RefusedParameter, Selection, View, WindowOptions, run_headless, run_window,
};

use crate::args::PreviewArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

/// Width and height of the window when it opens.
const WINDOW_POINTS: [f32; 2] = [1280.0, 760.0];

/// Folder for pictures, where none is given.
const PICTURES: &str = "frames";

pub(crate) fn run(args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    let selection = Selection { scene: args.scene.clone(), env: args.env.clone(), ..Selection::default() };
    let view = View { exposure_ev: args.exposure, ..View::default() };
    let socket = place::socket_of(&args.dir)?;
    if args.follow {
        return follow(args, socket, selection, view);
    }
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
    let folder = place::project_folder(&args.dir)?;
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let state = if args.fresh { None } else { place::window_state_file(&folder) };
    run_window(WindowOptions {
        socket,
        title: format!("{name} — Kiln"),
        size: WINDOW_POINTS,
        selection,
        view,
        pictures: args.out.clone().unwrap_or_else(|| folder.join(PICTURES)),
        state,
        lose_device_after_frames: args.lose_device_after_frames,
    })?;
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
        out: args.out.clone().unwrap_or_else(|| PICTURES.into()),
        frames: args.frames,
        size: args.size,
        selection,
        view,
        parameters: args.param.clone(),
        rotation_step_rad: args.turn.to_radians(),
        revision_min: args.wait_revision,
        timeout: Duration::from_secs(args.timeout_s),
    });
    let done = done.map_err(|error| match error.downcast::<RefusedParameter>() {
        Ok(refused) => place::WrongInput(refused.to_string()).into(),
        Err(other) => other,
    })?;
    if args.json {
        say!("{}", serde_json::to_string_pretty(&done)?);
        return Ok(ExitCode::SUCCESS);
    }
    report::print_diagnostics(&done.diagnostics, false);
    done.notes.iter().for_each(|note| say!("note: {note}"));
    say!("revision {} on {}: prepared in {}", done.revision, done.adapter, report::duration(done.prepare_ms));
    for (file, ms) in done.files.iter().zip(&done.frame_ms) {
        say!("{}  ({})", file.display(), report::duration(*ms));
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a picture of every revision until the process is ended.
fn follow(
    args: &PreviewArgs,
    socket: std::path::PathBuf,
    selection: Selection,
    view: View,
) -> anyhow::Result<ExitCode> {
    let out = args.out.clone().unwrap_or_else(|| PICTURES.into());
    std::fs::create_dir_all(&out).with_context(|| format!("making the folder {}", out.display()))?;
    let mut viewer = HeadlessViewer::new(Gpu::headless()?, args.size);
    viewer.view = view;
    viewer.select(selection);
    let client = Client::connect(socket, "preview, following");
    while let Ok(event) = client.events().recv() {
        match event {
            ClientEvent::Connected { project } => say!("connected to {project}"),
            ClientEvent::Disconnected { reason } => say!("waiting: {reason}"),
            ClientEvent::Progress { .. } | ClientEvent::Answer(_) => {}
            ClientEvent::Revision(revision) => {
                let received_unix_ms = unix_ms();
                let applied = viewer.apply(&revision);
                let ready_unix_ms = unix_ms();
                viewer.draw()?;
                let (revision, drawn_unix_ms) = (applied.revision, unix_ms());
                client.report_frame(FrameReport { revision, received_unix_ms, ready_unix_ms, drawn_unix_ms });
                report::print_diagnostics(&applied.diagnostics, false);
                let path = out.join(format!("revision_{revision:04}.png"));
                viewer.render()?.save(&path).with_context(|| format!("writing {}", path.display()))?;
                say!("{}", path.display());
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}
