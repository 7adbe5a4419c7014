//! `kiln demo`: the main job in one command, on an empty machine.
//!
//! A sample project is written, served by a real daemon and followed by a real client over the socket; then edits
//! are made to its files, and for each it is shown what ran again, how long each stage took from save to frame, and
//! the frame. Without a graphics device the artefacts are shown as a contact sheet that the CPU makes.

use std::path::{Path, PathBuf};
use std::process::{Child, ExitCode};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, bail};
use kiln_daemon::{Daemon, DaemonOptions, StopHandle};
use kiln_diagnostic::has_errors;
use kiln_link::{Client, ClientEvent, FrameReport, Revision};

use crate::args::DemoArgs;
use crate::commands::init;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report, sheet};

mod edits;
mod eyes;

use edits::Edit;
use eyes::Eyes;

/// Marks a folder as one that a demo made and may make afresh.
const MARKER: &str = ".kiln-demo";
const FRAMES: &str = "frames";
/// Longer than the first bake takes on a slow machine; nothing waits this long unless something is broken.
const PATIENCE: Duration = Duration::from_secs(300);

pub(crate) fn run(args: &DemoArgs) -> anyhow::Result<ExitCode> {
    if is_foreign(&args.dir) {
        let dir = args.dir.display();
        eprintln!(
            "error: {dir} exists and no demo made it\n  help: choose another folder: `kiln demo FOLDER`"
        );
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    say!("Kiln demo in {}\n", args.dir.display());
    let files = init::write_sample(&args.dir, &args.sample)?;
    kiln_build::write_atomically(&kiln_build::Disk, &args.dir.join(MARKER), b"made by `kiln demo`\n")?;
    let bytes = files.iter().map(|(_, bytes)| bytes).sum();
    say!("wrote a sample project: {}, {}", report::count(files.len(), "file"), report::size(bytes));

    let mut demo = Demo::start(args)?;
    demo.first_build()?;
    let window = demo.open_window();
    for (index, edit) in edits::script(&args.sample)?.iter().enumerate() {
        demo.perform(index + 1, edit)?;
    }
    demo.finish(window)
}

fn is_foreign(dir: &Path) -> bool {
    let occupied = dir.read_dir().map_or(dir.exists(), |mut entries| entries.next().is_some());
    occupied && !dir.join(MARKER).is_file()
}

struct Demo {
    dir: PathBuf,
    frames: PathBuf,
    daemon: Option<std::thread::JoinHandle<()>>,
    stop: StopHandle,
    client: Client,
    eyes: Eyes,
    shown: u64,
    no_window: bool,
    written: Vec<PathBuf>,
}

impl Demo {
    fn start(args: &DemoArgs) -> anyhow::Result<Demo> {
        let eyes = Eyes::open(args.size);
        say!("{}\n", eyes.describe());
        let options = DaemonOptions {
            folder: place::project_folder(&args.dir)?,
            cache: place::cache_folder()?,
            jobs: place::jobs(None),
            memory_bytes: place::memory_bytes(None),
            cache_bytes_max: place::cache_bytes_max()?,
            write_outputs: true,
            poll: None,
            listen: None,
        };
        let daemon = Daemon::start(&options).context("starting the daemon")?;
        let (stop, socket) = (daemon.stop_handle(), daemon.socket().to_owned());
        super::watch::stop_on_signals(stop.clone())?;
        let thread = std::thread::spawn(move || {
            daemon.run(&mut |notice| {
                if let kiln_daemon::Notice::Failed(reason) = notice {
                    eprintln!("the tool failed: {reason}");
                }
            });
        });
        let frames = args.dir.join(FRAMES);
        Ok(Demo {
            dir: args.dir.clone(),
            frames,
            daemon: Some(thread),
            stop,
            client: Client::connect(socket, "demo"),
            eyes,
            shown: 0,
            no_window: args.no_window,
            written: Vec::new(),
        })
    }

    fn first_build(&mut self) -> anyhow::Result<()> {
        say!("0. the first bake");
        let (revision, received) = self.next_revision()?;
        self.show(0, "first", &revision, received, None)?;
        for env in revision.table.targets.keys().filter_map(|name| name.strip_suffix("/skybox")) {
            let env = env.trim_start_matches("env/");
            if let Some(png) = sheet::environment_sheet(&revision, env) {
                self.save(&format!("artefacts-{env}.png"), &png)?;
            }
        }
        say!();
        Ok(())
    }

    fn perform(&mut self, index: usize, edit: &Edit) -> anyhow::Result<()> {
        say!("{index}. {}  ({})", edit.title, edit.file);
        let path = self.dir.join(edit.file);
        let old = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        let new = (edit.change)(&old)?;
        let saved = unix_ms();
        kiln_build::write_atomically(&kiln_build::Disk, &path, &new)?;
        let (revision, received) = self.next_revision()?;
        if has_errors(&revision.table.diagnostics) != edit.breaks {
            report::print_diagnostics(&revision.table.diagnostics, true);
            bail!("this edit should {}break the project", if edit.breaks { "" } else { "not " });
        }
        self.show(index, edit.name, &revision, received, Some(saved))?;
        say!();
        Ok(())
    }

    fn next_revision(&mut self) -> anyhow::Result<(Arc<Revision>, f64)> {
        loop {
            match self.client.events().recv_timeout(PATIENCE).context("waiting for the daemon")? {
                ClientEvent::Revision(revision) if revision.table.number > self.shown => {
                    self.shown = revision.table.number;
                    return Ok((revision, unix_ms()));
                }
                ClientEvent::Revision(_)
                | ClientEvent::Connected { .. }
                | ClientEvent::Progress { .. }
                | ClientEvent::Answer(_) => {}
                ClientEvent::Disconnected { reason } => bail!("the daemon went away: {reason}"),
            }
        }
    }

    fn show(
        &mut self,
        index: usize,
        name: &str,
        revision: &Arc<Revision>,
        received: f64,
        saved: Option<f64>,
    ) -> anyhow::Result<()> {
        let work = &revision.table.work;
        report::work_lines(work).iter().for_each(|line| say!("   {line}"));
        say!("   {} reused", report::count(work.reused, "action"));
        report::print_diagnostics(&revision.table.diagnostics, index == 0);
        let Some(seen) = self.eyes.look(revision)? else { return Ok(()) };
        let drawn = FrameReport {
            revision: revision.table.number,
            received_unix_ms: received,
            ready_unix_ms: seen.ready_unix_ms,
            drawn_unix_ms: seen.drawn_unix_ms,
        };
        if let Some(saved) = saved {
            say!("   {}", stages(saved, revision, &drawn));
        }
        self.client.report_frame(drawn);
        let file = format!("{index}-{name}.png");
        if seen.is_unchanged {
            say!("   the picture is what it was: the last good shader still draws");
        }
        self.save(&file, &seen.png)
    }

    fn save(&mut self, name: &str, png: &[u8]) -> anyhow::Result<()> {
        let path = self.frames.join(name);
        kiln_build::write_atomically(&kiln_build::Disk, &path, png)?;
        say!("   {}", path.display());
        self.written.push(path);
        Ok(())
    }

    fn open_window(&self) -> Option<Child> {
        if self.no_window || !self.eyes.can_open_window() {
            return None;
        }
        let program = std::env::current_exe().ok()?;
        let window = std::process::Command::new(program).arg("preview").arg(&self.dir).spawn();
        match window {
            Ok(window) => {
                say!("A window opens: watch the edits arrive there too.\n");
                Some(window)
            }
            Err(error) => {
                eprintln!("no window: {error}");
                None
            }
        }
    }

    fn finish(mut self, window: Option<Child>) -> anyhow::Result<ExitCode> {
        say!("{} in {}", report::count(self.written.len(), "picture"), self.frames.display());
        let dir = self.dir.display();
        if let Some(mut window) = window {
            say!("\nThe project stays live until you close the window: edit the files in {dir} and watch.");
            window.wait().context("waiting for the window")?;
        } else {
            say!(
                "\nGo on by yourself:\n  kiln watch {dir}\n  kiln preview {dir}   (in a second terminal; --headless without a display)"
            );
        }
        self.stop.stop();
        if let Some(daemon) = self.daemon.take()
            && daemon.join().is_err()
        {
            bail!("the daemon panicked");
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// How long each stage took, from save to frame.
fn stages(saved: f64, revision: &Revision, drawn: &FrameReport) -> String {
    let work = &revision.table.work;
    let times = [
        ("noticed", work.noticed_unix_ms),
        ("built", work.published_unix_ms),
        ("received", drawn.received_unix_ms),
        ("ready", drawn.ready_unix_ms),
        ("drawn", drawn.drawn_unix_ms),
    ];
    let mut text = "save".to_owned();
    let mut before = saved;
    for (stage, at) in times {
        text.push_str(&format!(" → {stage} {}", report::duration((at - before).max(0.0))));
        before = at;
    }
    format!("{text}  =  {} from save to frame", report::duration(drawn.drawn_unix_ms - saved))
}

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}
