//! Prints what a daemon publishes, a line for each revision: `cargo run -p kiln-link --example print_revisions -- DIR [COUNT]`.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use std::path::Path;
use std::process::ExitCode;

use kiln_link::{Client, ClientEvent, Revision};

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (Some(folder), count) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: print_revisions DIR [COUNT]");
        return ExitCode::FAILURE;
    };
    let count = count.and_then(|count| count.parse().ok()).unwrap_or(usize::MAX);
    match print_revisions(Path::new(&folder), count) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{folder}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn print_revisions(folder: &Path, count: usize) -> std::io::Result<()> {
    let socket = kiln_link::socket_path(&folder.canonicalize()?)?;
    let client = Client::connect(socket, "print_revisions");
    let mut printed = 0;
    while printed < count {
        match client.events().recv() {
            Ok(ClientEvent::Connected { project }) => println!("connected to {project}"),
            Ok(ClientEvent::Disconnected { reason }) => println!("waiting: {reason}"),
            Ok(ClientEvent::Progress { .. } | ClientEvent::Answer(_)) => {}
            Ok(ClientEvent::Revision(revision)) => {
                println!("{}", line(&revision));
                printed += 1;
            }
            Err(_) => return Ok(()),
        }
    }
    Ok(())
}

fn line(revision: &Revision) -> String {
    let table = &revision.table;
    let bytes: u64 = table.targets.values().map(|target| target.bytes()).sum();
    let errors = table.diagnostics.iter().filter(|diagnostic| diagnostic.is_error()).count();
    format!(
        "revision {}: {} targets, {bytes} bytes, {errors} errors, after {}",
        table.number,
        table.targets.len(),
        table.work.changed_files.join(", ")
    )
}
