//! `kiln watch`: bake, then follow every edit.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use anyhow::Context as _;
use kiln_daemon::{Daemon, DaemonError, DaemonOptions, Notice, StopHandle};
use kiln_link::{Ask, ServerEvent};
use serde_json::json;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::args::WatchArgs;
use crate::out::say;
use crate::screen::{Block, Screen};
use crate::{INPUT_IS_WRONG, log, place, report};

pub(crate) fn run(args: &WatchArgs) -> anyhow::Result<ExitCode> {
    let is_logging = log::start(args.log.as_ref())?;
    let options = DaemonOptions {
        folder: place::project_folder(&args.build.dir)?,
        cache: place::cache_folder()?,
        jobs: place::jobs(args.build.jobs),
        memory_bytes: place::memory_bytes(args.build.memory),
        cache_bytes_max: place::cache_bytes_max()?,
        write_outputs: !args.no_output,
        poll: args.poll,
        listen: args.listen,
    };
    let daemon = match Daemon::start(&options) {
        Err(DaemonError::Lock(error)) => {
            eprintln!("error: {error}");
            return Ok(ExitCode::from(INPUT_IS_WRONG));
        }
        Err(error @ DaemonError::Listen { .. }) => return Err(place::WrongInput(error.to_string()).into()),
        daemon => daemon.context("starting to watch")?,
    };
    stop_on_signals(daemon.stop_handle())?;
    // The first edit does not wait for a process to start.
    kiln_worker::warm_up();
    if args.build.json {
        let mut line = json!({"event": "listening", "socket": daemon.socket()});
        if let Some((address, token_file)) = daemon.tcp() {
            (line["address"], line["token_file"]) = (json!(address), json!(token_file));
        }
        say!("{line}");
        daemon.run(&mut |notice| say!("{}", to_json(&notice)));
    } else {
        let watching = format!("watching {}", options.folder.display());
        let mut help = format!("look at it with `kiln preview {}`; Ctrl-C ends", args.build.dir.display());
        if let Some((address, token_file)) = daemon.tcp() {
            let token_file = token_file.display();
            help = format!(
                "look at it with `kiln preview --connect {address} --token-file {token_file}`; Ctrl-C ends"
            );
        }
        if is_logging || !is_for_a_person() {
            eprintln!("{watching}\n{help}\n");
            let mut lines = Lines::default();
            daemon.run(&mut |notice| lines.show(&notice));
        } else {
            let (mut screen, mut block) = (Screen::new(&watching, &help), Block::default());
            daemon.run(&mut |notice| {
                screen.take(&notice);
                block.draw(&screen);
            });
        }
        eprintln!("\nended; nothing published was lost");
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether somebody looks at a terminal that can be drawn on; others get lines, which can be searched and kept.
fn is_for_a_person() -> bool {
    let can_draw = std::env::var_os("TERM").is_some_and(|kind| kind != "dumb");
    can_draw && std::io::stdout().is_terminal() && std::io::stderr().is_terminal()
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

/// Lines for whoever keeps them.
#[derive(Default)]
struct Lines {
    noticed_unix_ms: f64,
    published_unix_ms: f64,
}

impl Lines {
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
        Ask::BakeAtError { env, error: Some(error) } => format!("bake {env} at an error of {error}"),
        Ask::BakeAtError { env, error: None } => format!("bake {env} as kiln.toml says"),
        Ask::Unknown => "do something that this Kiln does not know".to_owned(),
    }
}
