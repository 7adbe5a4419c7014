//! `kiln preview`: the window, or pictures without one.

use std::process::ExitCode;
use std::sync::mpsc::channel;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use kiln_gpu::Gpu;
use kiln_link::{Client, ClientEvent, Endpoint, FrameReport, Token};
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
    let daemon = endpoint_of(args)?;
    if args.follow {
        return follow(args, daemon, selection, view);
    }
    if args.headless {
        return headless(args, daemon, selection, view);
    }
    if !place::has_display() {
        eprintln!(
            "error: there is no display for a window\n  help: `kiln preview {} --headless --out frames` writes pictures instead",
            args.dir.display()
        );
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    // A daemon that is reached by its address may watch a folder that is not here.
    let folder = args.connect.is_none().then(|| place::project_folder(&args.dir)).transpose()?;
    let name = match (&folder, args.connect) {
        (_, Some(address)) => address.to_string(),
        (Some(folder), None) => folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        (None, None) => String::new(),
    };
    let state = folder.as_deref().filter(|_| !args.fresh).and_then(place::window_state_file);
    run_window(WindowOptions {
        daemon,
        title: format!("{name} — Kiln"),
        size: WINDOW_POINTS,
        selection,
        view,
        pictures: args.out.clone().unwrap_or_else(|| folder.unwrap_or_default().join(PICTURES)),
        state,
        lose_device_after_frames: args.lose_device_after_frames,
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Where the daemon is: at the address that is given, else at the project's socket.
fn endpoint_of(args: &PreviewArgs) -> anyhow::Result<Endpoint> {
    let (Some(address), Some(file)) = (args.connect, &args.token_file) else {
        return Ok(place::socket_of(&args.dir)?.into());
    };
    let wrong = |error| place::WrongInput(format!("the token in {}: {error}", file.display()));
    Ok(Endpoint::Tcp { address, token: Token::read(file).map_err(wrong)? })
}

fn headless(
    args: &PreviewArgs,
    daemon: Endpoint,
    selection: Selection,
    view: View,
) -> anyhow::Result<ExitCode> {
    let done = run_headless(&HeadlessOptions {
        daemon,
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
    daemon: Endpoint,
    selection: Selection,
    view: View,
) -> anyhow::Result<ExitCode> {
    let out = args.out.clone().unwrap_or_else(|| PICTURES.into());
    std::fs::create_dir_all(&out).with_context(|| format!("making the folder {}", out.display()))?;
    let mut viewer = HeadlessViewer::new(Gpu::headless()?, args.size);
    viewer.view = view;
    let wants = selection.targets(&viewer.view);
    viewer.select(selection);
    // What comes while a picture is written has come then, and not when it is looked at.
    let (sender, heard) = channel();
    let tell = move |event| sender.send((unix_ms(), event)).is_ok();
    let client = Client::connect_and_tell(daemon, "preview, following", tell);
    client.want(wants);
    while let Ok((received_unix_ms, event)) = heard.recv() {
        match event {
            ClientEvent::Connected { project } => say!("connected to {project}"),
            ClientEvent::Disconnected { reason } => say!("waiting: {reason}"),
            ClientEvent::Progress { .. } | ClientEvent::Answer(_) => {}
            ClientEvent::Revision(revision) => {
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
