//! Clients and daemons that come and go faster than anybody means them to.

use std::io::Write as _;
use std::os::unix::net::UnixStream;

use kiln_link::Client;

use crate::harness::{Project, Watch};

/// Guests in each wave; an edit falls into the middle of each.
const GUESTS: usize = 40;
const WAVES: usize = 6;
const RESTARTS: usize = 8;

/// Arrives at `socket` in one of the ways that guests have, and stays as long as what it returns.
fn guest(watch: &Watch, index: usize) -> Box<dyn std::any::Any> {
    let connect = || UnixStream::connect(&watch.socket).expect("the daemon listens");
    let hello = br#"{"protocol":2,"name":"guest","capabilities":["revisions"]}"#;
    let frame =
        |kind: u8, payload: &[u8]| [&(payload.len() as u32 + 1).to_le_bytes()[..], &[kind], payload].concat();
    match index % 5 {
        // Gone before it said anything.
        0 => Box::new(()) as Box<dyn std::any::Any>,
        1 => {
            drop(connect());
            Box::new(())
        }
        // Gone in the middle of its greeting.
        2 => {
            let mut stream = connect();
            // A full queue of connections may be closed under it: that is an end too.
            drop(stream.write_all(&frame(1, hello)[..9]));
            Box::new(stream)
        }
        // Greets, never reads, and goes when its wave ends.
        3 => {
            let mut stream = connect();
            drop(stream.write_all(&frame(1, hello)));
            Box::new(stream)
        }
        // A real client, that goes while contents are on their way.
        _ => Box::new(Client::connect(watch.socket.clone(), "guest")),
    }
}

/// Threads and open files of a process.
#[cfg(target_os = "linux")]
fn held(pid: u64) -> [usize; 2] {
    ["task", "fd"].map(|kind| std::fs::read_dir(format!("/proc/{pid}/{kind}")).map_or(0, Iterator::count))
}

fn status(project: &Project) -> serde_json::Value {
    let output = project.run(&["status", "DIR", "--json"]);
    serde_json::from_slice(&output.stdout).expect("it prints JSON")
}

#[test]
fn guests_that_come_and_go_by_hundreds_leave_the_daemon_and_its_client_as_they_were() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let faithful = watch.client("faithful");
    faithful.revision();
    let before = status(&project);
    let pid = before["daemon"]["pid"].as_u64().expect("it has a number");
    #[cfg(target_os = "linux")]
    let held_before = held(pid);
    let mut color = "vec3f(1.0, 1.0, 1.0)".to_owned();
    for wave in 0..WAVES {
        let mut guests: Vec<_> = (0..GUESTS / 2).map(|index| guest(&watch, index)).collect();
        let next = format!("vec3f(1.0, 0.9, 0.{wave}1)");
        project.edit("shaders/pbr/tonemap.wgsl", &color, &next);
        color = next;
        guests.extend((0..GUESTS / 2).map(|index| guest(&watch, index)));
        let published = watch.published();
        let got = loop {
            let revision = faithful.revision();
            if revision.table.number >= published["revision"].as_u64().expect("it is numbered") {
                break revision;
            }
        };
        let tonemap = got.part("shader/tonemap/base", "wgsl").expect("the revision is whole");
        let value = format!("0.{wave}1");
        assert!(String::from_utf8_lossy(tonemap).contains(&value), "{value}");
        drop(guests);
    }
    // Their ends are noticed one by one: asked again until the last is.
    for attempt in 0.. {
        let now = status(&project);
        let clients = now["daemon"]["clients"].as_array().expect("a list");
        let names: Vec<&str> = clients.iter().filter_map(|client| client["name"].as_str()).collect();
        #[cfg(target_os = "linux")]
        let is_as_before = held(pid) <= held_before;
        #[cfg(not(target_os = "linux"))]
        let is_as_before = true;
        // The asking itself is a client.
        if names.iter().filter(|name| **name == "guest").count() == 0 && is_as_before {
            assert!(names.contains(&"faithful"), "{names:?}");
            break;
        }
        assert!(attempt < 500, "{names:?} are still there");
    }
}

#[test]
fn daemons_that_come_and_go_keep_their_client() {
    let project = Project::sample();
    let mut watch = project.watch();
    watch.published();
    let faithful = watch.client("faithful");
    faithful.revision();
    let mut color = "vec3f(1.0, 1.0, 1.0)".to_owned();
    for restart in 0..RESTARTS {
        watch.kill();
        let next = format!("vec3f(1.0, 0.9, 0.{restart}1)");
        project.edit("shaders/pbr/tonemap.wgsl", &color, &next);
        color = next;
        watch = project.watch();
        watch.published();
        let value = format!("0.{restart}1");
        loop {
            let revision = faithful.revision();
            let tonemap = revision.part("shader/tonemap/base", "wgsl").expect("the revision is whole");
            if String::from_utf8_lossy(tonemap).contains(&value) {
                break;
            }
        }
    }
}
