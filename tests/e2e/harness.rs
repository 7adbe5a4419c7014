//! A project in a folder of its own, and the processes that work on it.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use kiln_link::{Client, ClientEvent, Revision};
use serde_json::Value;

/// No wait is longer, unless something is broken.
pub const LIMIT: Duration = Duration::from_secs(120);

/// Width of generated panoramas: small, because what is tested here is the loop and not the baker.
pub const PANORAMA_WIDTH: &str = "128";

pub fn kiln() -> Command {
    Command::new(env!("CARGO_BIN_EXE_kiln"))
}

/// A project with its own cache and runtime folder.
pub struct Project {
    folder: tempfile::TempDir,
}

impl Project {
    /// What `kiln init` writes.
    pub fn sample() -> Project {
        let project = Project { folder: tempfile::tempdir().unwrap() };
        for folder in ["cache", "runtime"] {
            std::fs::create_dir(project.folder.path().join(folder)).unwrap();
        }
        let output = project.run(&["init", "DIR", "--panorama-width", PANORAMA_WIDTH]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        project
    }

    pub fn dir(&self) -> PathBuf {
        self.folder.path().join("project")
    }

    /// A folder beside the project for whatever a test writes.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `kiln` with this project's cache and runtime folder; `DIR` stands for the project's folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = kiln();
        for argument in arguments {
            match *argument {
                "DIR" => command.arg(self.dir()),
                argument => command.arg(argument),
            };
        }
        command
            .env("KILN_CACHE", self.beside("cache"))
            .env("XDG_RUNTIME_DIR", self.beside("runtime"))
            .env("XDG_STATE_HOME", self.beside("state"));
        command.stdin(Stdio::null());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// `kiln bake --keep-going --json`: its exit code and report.
    pub fn bake(&self) -> (i32, Value) {
        let output = self.run(&["bake", "DIR", "--keep-going", "--json"]);
        let report = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|error| panic!("{error}: {}{}", text(&output.stdout), text(&output.stderr)));
        (output.status.code().unwrap(), report)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir().join(name)
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Saves a file whole, as careful editors do: a busy machine sees no half of it.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        let new = path.with_extension("being-saved");
        std::fs::write(&new, content).unwrap();
        std::fs::rename(new, path).unwrap();
    }

    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = self.read(name);
        assert!(text.contains(from), "{name} has no `{from}`");
        self.write(name, text.replacen(from, to, 1));
    }

    pub fn watch(&self) -> Watch {
        Watch::start(self)
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Names of the actions with a status in a bake report, sorted.
pub fn actions_with(report: &Value, status: &str) -> Vec<String> {
    let actions = report["actions"].as_array().unwrap().iter();
    let named =
        actions.filter(|action| action["status"] == status).map(|action| action["name"].as_str().unwrap());
    let mut names: Vec<String> = named.map(str::to_owned).collect();
    names.sort();
    names
}

/// A process that is killed when the test ends.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A running `kiln watch --json`.
pub struct Watch {
    process: Process,
    events: Receiver<Value>,
    pub socket: PathBuf,
}

impl Watch {
    fn start(project: &Project) -> Watch {
        let mut command = project.command(&["watch", "DIR", "--json"]);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let (sender, events) = channel();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let event = serde_json::from_str(&line).unwrap_or(Value::String(line));
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        let mut watch = Watch { process: Process(child), events, socket: PathBuf::new() };
        watch.socket = Path::new(watch.wait_for("listening")["socket"].as_str().unwrap()).to_owned();
        watch
    }

    /// The next event of this kind; others before it are passed over.
    pub fn wait_for(&self, kind: &str) -> Value {
        let deadline = Instant::now() + LIMIT;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let event = self.events.recv_timeout(left).unwrap_or_else(|error| panic!("no `{kind}`: {error}"));
            if event["event"] == kind {
                return event;
            }
        }
    }

    /// The next published revision.
    pub fn published(&self) -> Value {
        self.wait_for("published")
    }

    pub fn client(&self, name: &str) -> Viewer {
        Viewer(Client::connect(self.socket.clone(), name))
    }

    /// The processes that it started.
    pub fn worker_ids(&self) -> Vec<u32> {
        let parent = self.process.0.id();
        let of_entry = |entry: std::io::Result<std::fs::DirEntry>| -> Option<u32> {
            let id: u32 = entry.ok()?.file_name().to_str()?.parse().ok()?;
            let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
            // `man 5 proc`: the name in parentheses, the state, the parent.
            let found: u32 = stat.rsplit_once(')')?.1.split_ascii_whitespace().nth(1)?.parse().ok()?;
            (found == parent).then_some(id)
        };
        std::fs::read_dir("/proc").unwrap().filter_map(of_entry).collect()
    }

    /// Kills the daemon as a crash would.
    pub fn kill(mut self) {
        self.process.0.kill().unwrap();
        self.process.0.wait().unwrap();
    }

    /// Asks it to end, as Ctrl-C does; returns its exit code.
    #[cfg(unix)]
    pub fn interrupt(self) -> i32 {
        self.end("-INT")
    }

    /// Sends it a signal that ends it; returns its exit code.
    #[cfg(unix)]
    pub fn end(mut self, signal: &str) -> i32 {
        let pid = self.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        self.process.0.wait().unwrap().code().unwrap()
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.process.0.id()
    }
}

/// A client of the daemon in this process.
pub struct Viewer(pub Client);

impl Viewer {
    /// The next whole revision.
    pub fn revision(&self) -> Arc<Revision> {
        let deadline = Instant::now() + LIMIT;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.0.events().recv_timeout(left).expect("a revision in time") {
                ClientEvent::Revision(revision) => return revision,
                ClientEvent::Connected { .. }
                | ClientEvent::Disconnected { .. }
                | ClientEvent::Progress { .. }
                | ClientEvent::Answer(_) => {}
            }
        }
    }

    /// Waits until the daemon is gone.
    pub fn disconnected(&self) -> String {
        loop {
            match self.0.events().recv_timeout(LIMIT).expect("to be disconnected") {
                ClientEvent::Disconnected { reason } => return reason,
                ClientEvent::Connected { .. }
                | ClientEvent::Revision(_)
                | ClientEvent::Progress { .. }
                | ClientEvent::Answer(_) => {}
            }
        }
    }
}

/// Names of the actions that made a published revision, sorted.
pub fn ran(published: &Value) -> Vec<String> {
    let actions = published["work"]["ran"].as_array().unwrap();
    let mut names: Vec<String> =
        actions.iter().map(|action| action["name"].as_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

/// Says what a test does without, and why; with `KILN_REQUIRE_GPU=1` that is a failure.
pub fn skip(test: &str, reason: &str) {
    assert!(std::env::var_os("KILN_REQUIRE_GPU").is_none(), "{test} may not be skipped: {reason}");
    eprintln!("SKIPPED: {test}: {reason}");
}
