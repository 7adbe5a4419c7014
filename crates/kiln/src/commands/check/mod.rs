//! `kiln check`: what is wrong with environments, maps and shaders, for people and for CI.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use kiln_check::{Allowance, Check, Subject, allow};
use kiln_diagnostic::Severity;
use kiln_image::{Cancel, Cancelled};
use kiln_project::PROJECT_FILE;
use serde_json::json;

use crate::args::{Deny, HealthArgs};
use crate::out::say;
use crate::place::WrongInput;
use crate::{INPUT_IS_WRONG, report};

mod file;
#[cfg(feature = "preview")]
mod furnace;
mod project;

pub(crate) fn run(args: &HealthArgs) -> anyhow::Result<ExitCode> {
    if args.list {
        Check::ALL.iter().for_each(|check| say!("{:<18} {}", check.name(), check.about()));
        return Ok(ExitCode::SUCCESS);
    }
    let start = Instant::now();
    let mut all = Session::new(args);
    if let Some(source) = &args.source {
        all.read_source(source)?;
    }
    for path in &args.paths {
        if path.is_dir() {
            project::check(&mut all, path)?;
        } else if path.is_file() {
            file::check(&mut all, path)?;
        } else {
            return Err(WrongInput(format!(
                "{} is neither a file nor a folder that can be read",
                path.display()
            ))
            .into());
        }
    }
    let least = if args.deny == Some(Deny::Warnings) { Severity::Warning } else { Severity::Error };
    allow(&mut all.subjects, &all.allowances, PROJECT_FILE);
    let is_bad = all.subjects.iter().any(|subject| subject.is_bad(least));
    if let Some(path) = &args.html {
        let page = kiln_check::html("Kiln: health report", &all.subjects);
        kiln_build::write_atomically(&kiln_build::Disk, path, page.as_bytes()).context("writing the page")?;
    }
    let ms = start.elapsed().as_secs_f64() * 1e3;
    if args.run.json {
        say!("{:#}", json!({"subjects": all.subjects, "ok": !is_bad, "html": args.html, "ms": ms}));
    } else {
        all.subjects.iter().for_each(print_subject);
        let count = |severity: Severity| {
            let findings = all.subjects.iter().flat_map(|subject| &subject.findings);
            findings.filter(|it| it.severity == severity && it.allowed.is_none()).count()
        };
        let [errors, warnings, notes] =
            [(Severity::Error, "error"), (Severity::Warning, "warning"), (Severity::Note, "note")]
                .map(|(severity, word)| report::count(count(severity), word));
        let checked = report::count(all.subjects.len(), "subject");
        say!("{checked}: {errors}, {warnings}, {notes}; {}", report::duration(ms));
        if let Some(path) = &args.html {
            say!("{}", path.display());
        }
    }
    Ok(if is_bad { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS })
}

/// What one run has found so far.
struct Session<'a> {
    args: &'a HealthArgs,
    subjects: Vec<Subject>,
    allowances: Vec<Allowance>,
    /// Of `--source`.
    source: Option<kiln_check::LevelFacts>,
}

impl<'a> Session<'a> {
    fn new(args: &'a HealthArgs) -> Session<'a> {
        Session { args, subjects: Vec::new(), allowances: Vec::new(), source: None }
    }

    fn with_pictures(&self) -> bool {
        self.args.html.is_some()
    }

    /// Adds what a check says; one that takes too long is named instead.
    fn add(&mut self, name: &str, kind: &str, check: impl FnOnce(Cancel) -> Result<Subject, Cancelled>) {
        let start = Instant::now();
        let limit = Duration::from_secs(self.args.time_limit);
        let mut subject = within(limit, check).unwrap_or_else(|Cancelled| {
            let mut subject = Subject::new(name, kind);
            subject.skip(
                kind,
                format!("it took longer than {} s; `--time-limit` allows more", self.args.time_limit),
            );
            subject
        });
        subject.ms = start.elapsed().as_secs_f64() * 1e3;
        self.subjects.push(subject);
    }

    fn read_source(&mut self, path: &Path) -> anyhow::Result<()> {
        let wrong = |reason: String| WrongInput(format!("--source {}: {reason}", path.display()));
        let bytes = std::fs::read(path).map_err(|error| wrong(error.to_string()))?;
        let decoded = kiln_image::decode_environment(&bytes, None, &file::limits(self.args), Cancel::NEVER)
            .map_err(|error| wrong(error.to_string()))?;
        let facts =
            kiln_check::mean_radiance(&decoded, Cancel::NEVER).map_err(|error| wrong(error.to_string()))?;
        self.source = Some(facts);
        Ok(())
    }
}

/// Does `work`, which is cancelled when `limit` is over.
fn within<T>(limit: Duration, work: impl FnOnce(Cancel) -> Result<T, Cancelled>) -> Result<T, Cancelled> {
    let is_over = AtomicBool::new(false);
    let (done, wait) = channel::<()>();
    std::thread::scope(|scope| {
        let is_over = &is_over;
        scope.spawn(move || {
            if wait.recv_timeout(limit) == Err(RecvTimeoutError::Timeout) {
                is_over.store(true, Ordering::Relaxed);
            }
        });
        let result = work(Cancel::when(is_over));
        drop(done);
        result
    })
}

fn print_subject(subject: &Subject) {
    let verdict = if subject.findings.is_empty() { ": nothing found" } else { "" };
    say!("{} ({}, {}){verdict}", subject.name, subject.kind, report::duration(subject.ms));
    for finding in &subject.findings {
        let allowed =
            finding.allowed.as_ref().map_or_else(String::new, |reason| format!(" (allowed: {reason})"));
        say!("  {}: {} [{}]{allowed}", finding.severity, finding.message, finding.check.name());
        if finding.allowed.is_some() {
            continue;
        }
        finding.places.iter().for_each(|place| say!("    {place}"));
        if let Some(help) = &finding.help {
            say!("    help: {help}");
        }
    }
    for unchecked in &subject.unchecked {
        say!("  not checked: {}: {}", unchecked.what, unchecked.reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_that_takes_too_long_is_cancelled_and_a_quick_one_is_not() {
        let endless = |cancel: Cancel| -> Result<(), Cancelled> {
            loop {
                cancel.check()?;
                std::thread::yield_now();
            }
        };
        assert_eq!(within(Duration::from_millis(5), endless), Err(Cancelled));
        assert_eq!(within(Duration::from_secs(60), |_| Ok(7)), Ok(7));
    }
}
