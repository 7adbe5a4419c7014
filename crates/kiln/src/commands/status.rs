//! `kiln status`: whether a daemon watches a project, and how it is.

use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use kiln_link::{ClientStatus, ControlError, DaemonStatus};
use serde_json::json;

use crate::args::StatusArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

/// A daemon answers at once, whatever it builds.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);

pub(crate) fn run(args: &StatusArgs) -> anyhow::Result<ExitCode> {
    let status = match kiln_link::status(&place::socket_of(&args.dir)?, ANSWER_LIMIT) {
        Ok(status) => status,
        Err(ControlError::NoDaemon) => {
            let dir = args.dir.display();
            match args.json {
                true => say!("{:#}", json!({"running": false})),
                false => say!("no daemon serves this project; start one with `kiln watch {dir}`"),
            }
            return Ok(ExitCode::from(INPUT_IS_WRONG));
        }
        Err(error) => return Err(error).context("asking the daemon"),
    };
    if args.json {
        say!("{:#}", json!({"running": true, "daemon": status}));
    } else {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        lines(&status, now.as_secs_f64() * 1e3).iter().for_each(|line| say!("{line}"));
        report::print_diagnostics(&status.errors, false);
    }
    Ok(ExitCode::SUCCESS)
}

fn lines(status: &DaemonStatus, now_unix_ms: f64) -> Vec<String> {
    let ago = |unix_ms: f64| report::duration(now_unix_ms - unix_ms);
    let mut lines = vec![format!(
        "{} is watched by process {} for {}",
        status.project,
        status.pid,
        ago(status.since_unix_ms)
    )];
    lines.push(match status.revision {
        0 => "nothing is published yet".to_owned(),
        number => format!(
            "revision {number} with {}, published {} ago",
            report::count(status.targets, "target"),
            ago(status.published_unix_ms)
        ),
    });
    if let Some(building) = &status.building {
        let files = match building.files.is_empty() {
            true => "all".to_owned(),
            false => building.files.join(", "),
        };
        let progress = &building.progress;
        let line = format!("building {files}: {} of {} {}", progress.done, progress.total, progress.current);
        lines.push(line.trim_end().to_owned());
    }
    lines.extend(status.stale.iter().map(|target| format!("stale: {target}")));
    lines.extend(status.clients.iter().map(|client| client_line(client, status.revision)));
    lines
}

fn client_line(client: &ClientStatus, revision: u64) -> String {
    let shows = match (client.shown_revision, client.shown_after_ms) {
        (0, _) => format!("was told of revision {}", client.told_revision),
        (shown, Some(after_ms)) if shown == revision => {
            format!("shows revision {shown}, {} after it was published", report::duration(after_ms))
        }
        (shown, _) if shown == revision => format!("shows revision {shown}"),
        (shown, _) => format!(
            "shows revision {shown}, {} behind",
            report::count(usize::try_from(revision.saturating_sub(shown)).unwrap_or(usize::MAX), "revision")
        ),
    };
    let mut line = format!("client {} ({}) {shows}", client.client, client.name);
    if client.waiting_contents > 0 {
        line += &format!(", waits for {}", report::count(client.waiting_contents, "content"));
    }
    if let Some(round_trip_ms) = client.round_trip_ms {
        line += &format!(", answers in {}", report::duration(round_trip_ms));
    }
    if !client.wants.is_empty() {
        line += &format!(", wants {}", client.wants.join(", "));
    }
    line
}
