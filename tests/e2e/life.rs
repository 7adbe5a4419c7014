//! How a daemon lives with editors, with many clients, with other users, with nothing to do, and how it ends.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use kiln_link::ClientEvent;
use serde_json::Value;

use crate::harness::{Project, ran, text};

const TONEMAP: &str = "shaders/pbr/tonemap.wgsl";

/// The tonemap with another white balance.
fn balanced(text: &str, green: usize) -> String {
    let changed = text.replace("vec3f(1.0, 1.0, 1.0)", &format!("vec3f(1.0, 0.{green}, 1.0)"));
    assert_ne!(changed, text);
    changed
}

/// An editor, and how it puts a text into the file.
type Save<'a> = (&'a str, &'a dyn Fn(&str));

fn has_error(published: &Value) -> bool {
    published["diagnostics"].as_array().unwrap().iter().any(|fault| fault["severity"] == "error")
}

#[test]
fn each_editors_way_to_save_is_one_revision_without_an_error() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let (file, backup) = (project.path(TONEMAP), project.path("shaders/pbr/tonemap.wgsl~"));
    let text = project.read(TONEMAP);
    let write = |path: &Path, text: &str| std::fs::write(path, text).unwrap();
    let rename = |from: &Path, to: &Path| std::fs::rename(from, to).unwrap();
    let remove = |path: &Path| std::fs::remove_file(path).unwrap();
    let saves: [Save; 5] = [
        ("vim: the old one becomes a backup", &|text| {
            rename(&file, &backup);
            write(&file, text);
            remove(&backup);
        }),
        ("vim with backupcopy: copied, then written in place", &|text| {
            std::fs::copy(&file, &backup).unwrap();
            write(&file, text);
            remove(&backup);
        }),
        ("VS Code: emptied and written in place", &|text| write(&file, text)),
        ("emacs: the backup stays", &|text| {
            rename(&file, &backup);
            write(&file, text);
        }),
        ("deleted and made anew", &|text| {
            remove(&file);
            write(&file, text);
        }),
    ];
    for (green, (editor, save)) in (11..).zip(saves) {
        save(&balanced(&text, green));
        let published = watch.published();
        assert_eq!(ran(&published), ["compile shader/tonemap/base"], "{editor}");
        assert!(!has_error(&published), "{editor}: {published}");
    }
}

#[test]
fn signals_end_a_daemon_cleanly_in_the_middle_of_a_build() {
    for signal in ["-TERM", "-HUP", "-INT"] {
        let project = Project::sample();
        let watch = project.watch();
        let client = watch.client("viewer");
        watch.wait_for("building");
        let socket = watch.socket.clone();
        assert_eq!(watch.end(signal), 0, "{signal}");
        client.disconnected();
        assert!(!socket.exists(), "{signal}");
        let next = project.watch();
        let first = next.published();
        assert!(!has_error(&first), "{signal}: {first}");
    }
}

#[test]
fn a_stuck_client_among_32_holds_up_none_of_the_others() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let mut stuck = std::os::unix::net::UnixStream::connect(&watch.socket).unwrap();
    let hello = kiln_link::ClientMessage::Hello(kiln_link::Hello::new("stuck", &["revisions"]));
    std::io::Write::write_all(&mut stuck, &kiln_link::Message::encode(&hello)).unwrap();
    let clients: Vec<_> = (1..32).map(|index| watch.client(&format!("viewer {index}"))).collect();
    assert!(clients.iter().all(|client| client.revision().table.number == 1));
    let text = project.read(TONEMAP);
    for number in 2..=5_u64 {
        project.write(TONEMAP, balanced(&text, number as usize + 10));
        for client in &clients {
            assert_eq!(client.revision().table.number, number);
        }
    }
    let answer = project.run(&["status", "DIR", "--json"]);
    let answer: Value = serde_json::from_slice(&answer.stdout).unwrap();
    assert_eq!(answer["daemon"]["clients"].as_array().unwrap().len(), 32);
}

/// Clock ticks (1/100 s) of computing that a process has used: fields 14 and 15 of `man 5 proc`.
#[cfg(target_os = "linux")]
fn ticks(id: u32) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap();
    let fields = stat.rsplit_once(')').unwrap().1.split_ascii_whitespace();
    fields.skip(11).take(2).map(|field| field.parse::<u64>().unwrap()).sum()
}

#[cfg(target_os = "linux")]
#[test]
fn daemon_with_nothing_to_do_computes_nothing() {
    const WINDOW: Duration = Duration::from_secs(4);
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let client = watch.client("looks on");
    client.revision();
    let quiet = |limit: Duration| {
        let begun = Instant::now();
        while let Some(left) = limit.checked_sub(begun.elapsed()) {
            // What comes now is the end of the first build.
            if let Ok(ClientEvent::Revision(_)) = client.0.events().recv_timeout(left) {
                panic!("nobody edited anything");
            }
        }
    };
    quiet(Duration::from_secs(2));
    let before = ticks(watch.id());
    quiet(WINDOW);
    let used = ticks(watch.id()) - before;
    // Half a percent, and one tick because the account is kept in whole ones.
    assert!(used <= 3, "{used} ticks in {} s", WINDOW.as_secs());
}

/// Connects, greets, and prints what comes first: a number of bytes.
const STRANGER: &str = r#"
import json, os, socket, struct, sys
os.setuid(int(sys.argv[2]))
stream = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
stream.settimeout(20)
stream.connect(sys.argv[1])
hello = json.dumps({"protocol": 2, "name": "stranger", "capabilities": ["revisions"]}).encode()
try:
    stream.sendall(struct.pack("<IB", 1 + len(hello), 1) + hello)
    print(len(stream.recv(64)))
except (BrokenPipeError, ConnectionResetError):
    print(0)
"#;

#[cfg(target_os = "linux")]
#[test]
fn another_users_process_is_refused_even_where_it_can_reach_the_socket() {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
    let project = Project::sample();
    if std::fs::metadata(project.dir()).unwrap().uid() != 0 {
        eprintln!("SKIPPED: another_users_process: only root can become another user");
        return;
    }
    let watch = project.watch();
    watch.published();
    // As if somebody had opened every folder above it.
    let allow = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    allow(&watch.socket, 0o666);
    let below = project.beside("");
    watch
        .socket
        .ancestors()
        .skip(1)
        .take_while(|path| path.starts_with(&below))
        .for_each(|path| allow(path, 0o755));
    let heard = |user: &str| {
        let output =
            Command::new("python3").args(["-c", STRANGER, watch.socket.to_str().unwrap(), user]).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout).trim().parse::<usize>().unwrap()
    };
    assert!(heard("0") > 0, "the twin: this user is greeted");
    assert_eq!(heard("65534"), 0);
}
