//! What `kiln watch` shows on a terminal: one block that is redrawn in place. What it says follows from notices alone.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;

use kiln_daemon::Notice;
use kiln_diagnostic::Diagnostic;
use kiln_link::ServerEvent;

use crate::report;

/// Lines of what the last build did.
const WORK_LINES_MAX: usize = 6;
/// Terminals that do not tell their size.
const USUAL_SIZE: [usize; 2] = [80, 24];

/// The state of a watched project, as far as it was told.
#[derive(Debug, Default)]
pub(crate) struct Screen {
    project: String,
    help: String,
    revision: Option<String>,
    work: Vec<String>,
    /// What goes on now.
    activity: Option<String>,
    faults: Vec<Diagnostic>,
    failure: Option<String>,
    clients: BTreeMap<u64, Client>,
    /// When the edit behind the newest revision was noticed, or that was published: what the frames of clients are late after.
    since_unix_ms: f64,
    is_by_edit: bool,
}

#[derive(Debug, Default)]
struct Client {
    name: String,
    shows: String,
}

impl Screen {
    /// Of a project that nothing is known of yet.
    pub(crate) fn new(project: &str, help: &str) -> Screen {
        Screen { project: project.to_owned(), help: help.to_owned(), ..Screen::default() }
    }

    /// Takes note of what happened.
    pub(crate) fn take(&mut self, notice: &Notice) {
        match notice {
            Notice::Building { files } if files.is_empty() => self.activity = Some("building all".to_owned()),
            Notice::Building { files } => {
                self.activity = Some(format!("building: {} changed", shortened(files)));
            }
            Notice::Unchanged { files } => {
                self.failure = None;
                self.activity = (!files.is_empty())
                    .then(|| format!("{}: nothing that anything uses is different", shortened(files)));
            }
            Notice::Published(table) => {
                (self.activity, self.failure) = (None, None);
                if !table.building.is_empty() {
                    self.activity = Some(format!("still building {}", shortened(&table.building)));
                }
                self.is_by_edit = table.work.noticed_unix_ms > 0.0;
                self.since_unix_ms =
                    if self.is_by_edit { table.work.noticed_unix_ms } else { table.work.published_unix_ms };
                self.work = report::work_lines(&table.work);
                self.revision = Some(report::revision_line(table));
                self.faults = table.diagnostics.iter().filter(|fault| fault.is_error()).cloned().collect();
            }
            Notice::Unfinished { files } => {
                self.activity = Some(format!("{} being written; waiting for the rest", shortened(files)));
            }
            Notice::Failed(reason) => {
                self.activity = None;
                self.failure = Some(format!("the tool failed: {reason}; what was published stays"));
            }
            Notice::Client(event) => self.take_client(event),
        }
    }

    fn take_client(&mut self, event: &ServerEvent) {
        match event {
            ServerEvent::Connected { client, name } => {
                _ = self.clients.insert(*client, Client { name: name.clone(), ..Client::default() });
            }
            ServerEvent::Gone { client, .. } => _ = self.clients.remove(client),
            ServerEvent::Frame { client, report } => {
                let after = report::duration(report.drawn_unix_ms - self.since_unix_ms);
                let what = if self.is_by_edit { "the edit" } else { "it was published" };
                if let Some(client) = self.clients.get_mut(client) {
                    client.shows = format!(" shows revision {} {after} after {what}", report.revision);
                }
            }
            ServerEvent::StopAsked => self.activity = Some("asked to end".to_owned()),
            ServerEvent::Wants { .. } | ServerEvent::Asked { .. } => {}
        }
    }

    /// The block: no line is longer than the terminal is wide, and there are fewer lines than it has.
    pub(crate) fn lines(&self, columns: usize, rows: usize) -> Vec<String> {
        let mut lines = vec![self.project.clone(), self.help.clone()];
        lines.push(self.revision.clone().unwrap_or_else(|| "nothing is published yet".to_owned()));
        lines.extend(self.work.iter().take(WORK_LINES_MAX).map(|line| format!("  {line}")));
        if let Some(more) = self.work.len().checked_sub(WORK_LINES_MAX).filter(|more| *more > 0) {
            lines.push(format!("  and {more} more"));
        }
        lines.extend(self.activity.clone());
        lines.extend(self.clients.iter().map(|(number, client)| {
            let Client { name, shows } = client;
            format!("client {number} ({name}){}", if shows.is_empty() { " connected" } else { shows })
        }));
        lines.extend(self.failure.clone());
        // Errors last, just above the cursor, and as many as there is room for.
        let mut faults: Vec<String> = self.faults.iter().flat_map(fault_lines).collect();
        let room = rows.saturating_sub(1 + lines.len());
        if faults.len() > room {
            faults.truncate(room.saturating_sub(1));
            faults.push(format!(
                "{} in all; `kiln status` has them",
                report::count(self.faults.len(), "error")
            ));
        }
        lines.extend(faults);
        lines.truncate(rows.saturating_sub(1).max(1));
        lines
            .iter()
            .map(|line| line.chars().filter(|sign| !sign.is_control()).take(columns).collect())
            .collect()
    }
}

/// What is wrong, where, and what to do; without the excerpt of the source, for which an editor is the better place.
fn fault_lines(fault: &Diagnostic) -> Vec<String> {
    let mut line = String::new();
    if let Some(file) = &fault.file {
        line += file;
        if let Some(span) = &fault.span {
            // Writing to a string does not fail.
            let _ = write!(line, ":{}:{}", span.line, span.column);
        }
        line += ": ";
    }
    let mut lines = vec![format!("{}: {line}{}", fault.severity, fault.message)];
    lines.extend(fault.help.iter().map(|help| format!("  help: {help}")));
    lines
}

/// The first few names, and how many more there are.
fn shortened(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let first = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// A terminal with a block at its end.
#[derive(Debug, Default)]
pub(crate) struct Block {
    drawn_lines: usize,
}

impl Block {
    /// Draws the block in place of what it was.
    pub(crate) fn draw(&mut self, screen: &Screen) {
        let size = terminal_size::terminal_size();
        let [columns, rows] =
            size.map_or(USUAL_SIZE, |(width, height)| [usize::from(width.0), usize::from(height.0)]);
        let lines = screen.lines(columns.max(1), rows.max(1));
        let text = redrawn(self.drawn_lines, &lines);
        self.drawn_lines = lines.len();
        let mut out = std::io::stdout().lock();
        // A terminal that is gone ends the program by a signal.
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    }
}

/// Puts the cursor where `before` lines began, and writes these in their place, in one go so that nothing flickers.
fn redrawn(before: usize, lines: &[String]) -> String {
    let up = if before == 0 { String::new() } else { format!("\x1b[{before}A") };
    let text: String = lines.iter().map(|line| format!("{line}\x1b[K\n")).collect();
    format!("{up}\r{text}\x1b[J")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use kiln_link::{ActionTime, FrameReport, RevisionTable, Work};

    use super::*;

    fn published(number: u64, work: Work, diagnostics: Vec<Diagnostic>) -> Notice {
        Notice::Published(Arc::new(RevisionTable { number, work, diagnostics, ..RevisionTable::default() }))
    }

    fn screen(notices: &[Notice]) -> Screen {
        let mut screen = Screen::new("watching look", "Ctrl-C ends");
        notices.iter().for_each(|notice| screen.take(notice));
        screen
    }

    #[test]
    fn screen_says_what_is_published_built_and_shown_and_what_is_wrong() {
        let action =
            ActionTime { name: "compile shader/a".into(), wall_ms: 2.0, reason: "a.wgsl changed".into() };
        let work = Work {
            ran: vec![action],
            reused: 4,
            plan_ms: 1.0,
            run_ms: 2.0,
            noticed_unix_ms: 1000.0,
            ..Work::default()
        };
        let fault =
            Diagnostic::error("unknown name `x`").at("a.wgsl", "let y = x;", 8..9).with_help("declare it");
        let name = "viewer".to_owned();
        let frame = FrameReport {
            revision: 7,
            received_unix_ms: 1010.0,
            ready_unix_ms: 1020.0,
            drawn_unix_ms: 1030.0,
        };
        let mut screen = screen(&[
            published(7, work, vec![fault, Diagnostic::note("not an error")]),
            Notice::Client(ServerEvent::Connected { client: 3, name }),
            Notice::Client(ServerEvent::Frame { client: 3, report: frame }),
            Notice::Building { files: vec!["b.wgsl".into()] },
        ]);
        let expected = "watching look
Ctrl-C ends
revision 7: 1 action ran, 4 reused; planned in 1.0 ms, ran in 2.0 ms
  compile shader/a                                2.0 ms   a.wgsl changed
building: b.wgsl changed
client 3 (viewer) shows revision 7 30 ms after the edit
error: a.wgsl:1:9: unknown name `x`
  help: declare it";
        assert_eq!(screen.lines(100, 40).join("\n"), expected);
        screen.take(&Notice::Client(ServerEvent::Gone { client: 3, reason: String::new() }));
        screen.take(&published(8, Work::default(), Vec::new()));
        let mended = screen.lines(100, 40).join("\n");
        assert!(!["client", "error", "building"].iter().any(|gone| mended.contains(gone)), "{mended}");
    }

    #[test]
    fn screen_never_outgrows_its_terminal_and_says_what_it_leaves_out() {
        let faults: Vec<Diagnostic> =
            (0..50).map(|index| Diagnostic::error(format!("fault {index}\x1b[2J"))).collect();
        let files: Vec<String> = (0..2000).map(|index| format!("shaders/{index}.wgsl")).collect();
        let screen = screen(&[published(1, Work::default(), faults), Notice::Building { files }]);
        for (columns, rows) in [(1, 1), (20, 5), (80, 24), (200, 60)] {
            let lines = screen.lines(columns, rows);
            assert!(lines.len() <= rows.saturating_sub(1).max(1), "{rows} rows: {}", lines.len());
            assert!(lines.iter().all(|line| line.chars().count() <= columns && !line.contains('\x1b')));
        }
        let text = screen.lines(80, 24).join("\n");
        assert!(text.contains("50 errors in all") && text.contains("and 1997 more"), "{text}");
        assert!(screen.lines(80, 100).join("\n").contains("fault 49"), "where there is room all are named");
    }

    #[test]
    fn block_is_written_over_the_one_before() {
        assert_eq!(redrawn(0, &["a".into()]), "\ra\x1b[K\n\x1b[J");
        assert_eq!(redrawn(2, &["b".into()]), "\x1b[2A\rb\x1b[K\n\x1b[J");
    }
}
