//! `kiln watch`: bake, then follow every edit.

use std::process::ExitCode;

use anyhow::Context as _;
use kiln_daemon::{Daemon, DaemonError, DaemonOptions, Notice, StopHandle};
use kiln_link::{Ask, ServerEvent};
use serde_json::json;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::args::WatchArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let options = DaemonOptions {
        folder: place::project_folder(&args.build.dir)?,
        cache: place::cache_folder()?,
        jobs: place::jobs(args.build.jobs),
        memory_bytes: place::memory_bytes(args.build.memory),
        cache_bytes_max: place::cache_bytes_max()?,
        write_outputs: !args.no_output,
        poll: args.poll,
    };
    let daemon = match Daemon::start(&options) {
        Err(DaemonError::Lock(error)) => {
            eprintln!("error: {error}");
            return Ok(ExitCode::from(INPUT_IS_WRONG));
        }
        daemon => daemon.context("starting to watch")?,
    };
    stop_on_signals(daemon.stop_handle())?;
    // The first edit does not wait for a process to start.
    kiln_worker::warm_up();
    if args.build.json {
        say!("{}", json!({"event": "listening", "socket": daemon.socket()}));
        daemon.run(&mut |notice| say!("{}", to_json(&notice)));
    } else {
        eprintln!("watching {}", options.folder.display());
        eprintln!("look at it with `kiln preview {}`; Ctrl-C ends\n", args.build.dir.display());
        let mut screen = Screen::default();
        daemon.run(&mut |notice| screen.show(&notice));
        eprintln!("\nended; nothing published was lost");
    }
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn stop_on_signals(stop: StopHandle) -> anyhow::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("listening to signals")?;
    std::thread::spawn(move || {
        for _ in signals.forever() {
            stop.stop();
        }
    });
    Ok(())
}

/// Lines for a person who looks up now and then.
#[derive(Default)]
struct Screen {
    noticed_unix_ms: f64,
    published_unix_ms: f64,
}

impl Screen {
    fn show(&mut self, notice: &Notice) {
        match notice {
            Notice::Building { files } if files.is_empty() => {}
            Notice::Building { files } => say!("{} changed", files.join(", ")),
            Notice::Unchanged { .. } => say!("  nothing that anything uses is different"),
            Notice::Published(table) => {
                self.noticed_unix_ms = table.work.noticed_unix_ms;
                self.published_unix_ms = table.work.published_unix_ms;
                report::work_lines(&table.work).iter().for_each(|line| say!("  {line}"));
                report::print_diagnostics(&table.diagnostics, table.number == 1);
                say!("  {}", report::revision_line(table));
            }
            Notice::Unfinished { files } => {
                say!("  {} being written; waiting for the rest", files.join(", "));
            }
            Notice::Failed(reason) => eprintln!("  the tool failed: {reason}; what was published stays"),
            Notice::Client(event) => self.show_client(event),
        }
    }

    fn show_client(&self, event: &ServerEvent) {
        match event {
            ServerEvent::Connected { client, name } => say!("client {client} ({name}) connected"),
            ServerEvent::Gone { client, reason } => say!("client {client} left: {reason}"),
            ServerEvent::StopAsked => say!("asked to end"),
            // What follows of it is told.
            ServerEvent::Wants { .. } => {}
            ServerEvent::Asked { client, request } => say!("client {client} asks to {}", asked(&request.ask)),
            ServerEvent::Frame { client, report } => {
                let since =
                    if self.noticed_unix_ms > 0.0 { self.noticed_unix_ms } else { self.published_unix_ms };
                say!(
                    "  client {client} shows revision {} {} after {}",
                    report.revision,
                    report::duration(report.drawn_unix_ms - since),
                    if self.noticed_unix_ms > 0.0 { "the edit" } else { "it was published" },
                );
            }
        }
    }
}

fn to_json(notice: &Notice) -> serde_json::Value {
    match notice {
        Notice::Building { files } => json!({"event": "building", "files": files}),
        Notice::Unchanged { files } => json!({"event": "unchanged", "files": files}),
        Notice::Published(table) => json!({
            "event": "published",
            "revision": table.number,
            "work": table.work,
            "building": table.building,
            "diagnostics": table.diagnostics,
            "targets": table.targets.iter().map(|(name, target)| {
                (name.clone(), json!({"state": target.state, "sha256": target.digest(), "bytes": target.bytes()}))
            }).collect::<serde_json::Map<_, _>>(),
        }),
        Notice::Unfinished { files } => json!({"event": "unfinished", "files": files}),
        Notice::Failed(reason) => json!({"event": "failed", "reason": reason}),
        Notice::Client(ServerEvent::Connected { client, name }) => {
            json!({"event": "client connected", "client": client, "name": name})
        }
        Notice::Client(ServerEvent::Gone { client, reason }) => {
            json!({"event": "client gone", "client": client, "reason": reason})
        }
        Notice::Client(ServerEvent::Frame { client, report }) => {
            json!({"event": "frame", "client": client, "report": report})
        }
        Notice::Client(ServerEvent::Wants { client }) => json!({"event": "client wants", "client": client}),
        Notice::Client(ServerEvent::StopAsked) => json!({"event": "stop asked"}),
        Notice::Client(ServerEvent::Asked { client, request }) => {
            json!({"event": "asked", "client": client, "request": request})
        }
    }
}

/// What a client asks for, after "asks to".
fn asked(ask: &Ask) -> String {
    match ask {
        Ask::WriteParameters { parameters } => {
            let names: Vec<String> =
                parameters.iter().map(|write| format!("{}.{}", write.shader, write.name)).collect();
            format!("write {}", names.join(", "))
        }
        Ask::AddFiles { paths } => format!("add {}", paths.join(", ")),
        Ask::Unknown => "do something that this Kiln does not know".to_owned(),
    }
}
