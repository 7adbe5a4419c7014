//! `kiln preview` without a window: connects, waits for a revision, writes pictures.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::{Client, ClientEvent, Endpoint, FrameReport, Revision};
use serde::Serialize;

use crate::assignment::Assignment;
use crate::headless::HeadlessViewer;
use crate::report::ApplyReport;
use crate::view::{Selection, View};
use crate::worker::unix_ms;

/// What to render without a window.
#[derive(Clone, Debug)]
pub struct HeadlessOptions {
    /// Where the project's daemon is.
    pub daemon: Endpoint,
    /// Folder for `frame_0001.png` …, made if it is not there.
    pub out: PathBuf,
    /// How many frames.
    pub frames: usize,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What to show.
    pub selection: Selection,
    /// How to show it.
    pub view: View,
    /// Parameters of shaders to set, in this order.
    pub parameters: Vec<Assignment>,
    /// Turns the environment by this much from frame to frame.
    pub rotation_step_rad: f32,
    /// The first revision number that counts; older ones are passed over.
    pub revision_min: u64,
    /// How long to wait for it.
    pub timeout: Duration,
}

/// What [`run_headless`] did; also written as `report.json` beside the pictures.
#[derive(Clone, Debug, Serialize)]
pub struct HeadlessReport {
    /// The adapter it drew on.
    pub adapter: String,
    /// Revision shown.
    pub revision: u64,
    /// Scene shown.
    pub scene: Option<String>,
    /// Environment shown.
    pub env: Option<String>,
    /// From the whole revision to pipelines and uploads done, milliseconds.
    pub prepare_ms: f64,
    /// Milliseconds of each frame, without reading it back.
    pub frame_ms: Vec<f64>,
    /// What is approximate or replaced.
    pub notes: Vec<String>,
    /// What is wrong: the project's and the preview's.
    pub diagnostics: Vec<Diagnostic>,
    /// The pictures, in order.
    pub files: Vec<PathBuf>,
}

/// Renders frames of the first revision from `revision_min` on.
///
/// # Errors
/// No device, no revision in time, nothing that can be drawn, a [`crate::RefusedParameter`], or a folder that cannot be
/// written; the message names the step.
pub fn run_headless(options: &HeadlessOptions) -> anyhow::Result<HeadlessReport> {
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("making the folder {}", options.out.display()))?;
    let gpu = Gpu::headless().context("opening a graphics device")?;
    let mut viewer = HeadlessViewer::new(gpu, options.size);
    viewer.view = options.view.clone();
    viewer.select(options.selection.clone());
    let client = Client::connect(options.daemon.clone(), "preview, headless");
    client.want(options.selection.targets(&options.view));
    let revision = wait_for_revision(&client, options)?;
    let received_unix_ms = unix_ms();
    viewer.apply(&revision);
    let applied = viewer.assign(&options.parameters)?;
    let ready_unix_ms = unix_ms();
    ensure!(applied.shown.scene.is_some(), "revision {} has no scene to show", applied.revision);
    let mut report = begin_report(&viewer, &revision, applied, ready_unix_ms - received_unix_ms);
    for frame in 1..=options.frames {
        report.frame_ms.push(draw_frame(&mut viewer)?);
        if frame == 1 {
            let (revision, drawn_unix_ms) = (report.revision, unix_ms());
            client.report_frame(FrameReport { revision, received_unix_ms, ready_unix_ms, drawn_unix_ms });
        }
        report.files.push(write_frame(&mut viewer, options, frame)?);
        viewer.view.environment_rotation_rad += options.rotation_step_rad;
    }
    let errors = viewer.gpu().take_errors();
    ensure!(errors.is_empty(), "the graphics device reported: {}", errors.join("; "));
    let path = options.out.join("report.json");
    let text = serde_json::to_string_pretty(&report).context("writing the report")?;
    std::fs::write(&path, text + "\n").with_context(|| format!("writing {}", path.display()))?;
    Ok(report)
}

fn wait_for_revision(client: &Client, options: &HeadlessOptions) -> anyhow::Result<std::sync::Arc<Revision>> {
    let deadline = Instant::now() + options.timeout;
    let mut last_reason = "nothing was heard from a daemon".to_owned();
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        match client.events().recv_timeout(left) {
            Ok(ClientEvent::Revision(revision)) if revision.table.number >= options.revision_min => {
                return Ok(revision);
            }
            Ok(ClientEvent::Revision(revision)) => {
                last_reason = format!("the newest revision is {}", revision.table.number);
            }
            Ok(ClientEvent::Disconnected { reason }) => last_reason = reason,
            Ok(ClientEvent::Connected { .. }) => last_reason = "the daemon published nothing yet".to_owned(),
            Ok(ClientEvent::Progress { current, .. }) => {
                last_reason = format!("the daemon is busy: {current}");
            }
            Ok(ClientEvent::Answer(_)) => {}
            Err(_) => {
                let (revision, seconds) = (options.revision_min, options.timeout.as_secs_f64());
                bail!("no revision from {revision} on came within {seconds} s: {last_reason}");
            }
        }
    }
}

fn begin_report(
    viewer: &HeadlessViewer,
    revision: &Revision,
    applied: ApplyReport,
    prepare_ms: f64,
) -> HeadlessReport {
    let mut diagnostics = revision.table.diagnostics.clone();
    diagnostics.extend(applied.diagnostics);
    HeadlessReport {
        adapter: viewer.gpu().description(),
        revision: applied.revision,
        scene: applied.shown.scene,
        env: applied.shown.env,
        prepare_ms,
        frame_ms: Vec::new(),
        notes: applied.notes,
        diagnostics,
        files: Vec::new(),
    }
}

fn draw_frame(viewer: &mut HeadlessViewer) -> anyhow::Result<f64> {
    let start = Instant::now();
    viewer.draw().context("drawing a frame")?;
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

fn write_frame(
    viewer: &mut HeadlessViewer,
    options: &HeadlessOptions,
    frame: usize,
) -> anyhow::Result<PathBuf> {
    let picture = viewer.render().context("reading a frame")?;
    let path = options.out.join(format!("frame_{frame:04}.png"));
    picture.save(&path).with_context(|| format!("writing {}", path.display()))?;
    Ok(path)
}
