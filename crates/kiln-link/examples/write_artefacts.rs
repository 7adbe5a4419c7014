//! Writes the newest revision of a daemon into a folder, a file for each part, and ends:
//! `cargo run -p kiln-link --example write_artefacts -- DIR OUT`. An engine would make textures of the bytes instead.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use kiln_link::{Client, ClientEvent, Revision};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, out] = arguments.as_slice() else {
        eprintln!("usage: write_artefacts DIR OUT");
        return ExitCode::FAILURE;
    };
    match newest_revision(Path::new(folder)).and_then(|revision| write(&revision, Path::new(out))) {
        Ok(files) => {
            println!("{files} files in {out}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn newest_revision(folder: &Path) -> std::io::Result<Arc<Revision>> {
    let socket = kiln_link::socket_path(&folder.canonicalize()?)?;
    let client = Client::connect(socket, "write_artefacts");
    for event in client.events() {
        match event {
            ClientEvent::Revision(revision) => return Ok(revision),
            ClientEvent::Disconnected { reason } => return Err(std::io::Error::other(reason)),
            ClientEvent::Connected { .. } | ClientEvent::Progress { .. } | ClientEvent::Answer(_) => {}
        }
    }
    Err(std::io::Error::other("the client has ended"))
}

/// `OUT/TARGET/PART`; returns the number of files.
fn write(revision: &Revision, out: &Path) -> std::io::Result<usize> {
    let mut files = 0;
    for (name, target) in &revision.table.targets {
        // A daemon is this user's own, but a name that leads out of the folder is still no target of Kiln's.
        let is_plain = |name: &str| !name.split('/').any(|step| matches!(step, "" | "." | ".."));
        if !is_plain(name) || !target.parts.iter().all(|part| is_plain(&part.name)) {
            return Err(std::io::Error::other(format!("`{name}` is no name of a target")));
        }
        let folder = out.join(name);
        std::fs::create_dir_all(&folder)?;
        for part in &target.parts {
            std::fs::write(folder.join(&part.name), revision.bytes(part))?;
            files += 1;
        }
    }
    Ok(files)
}
