//! Status, stop, wants and pings over a real socket.

use std::io::Write as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use kiln_diagnostic::Diagnostic;

use super::{LIMIT, next_revision, serve, table};
use crate::wire::Message as _;
use crate::*;

/// Asks until the answer is as wanted.
#[track_caller]
fn status_when(socket: &std::path::Path, is_wanted: impl Fn(&DaemonStatus) -> bool) -> DaemonStatus {
    let deadline = Instant::now() + LIMIT;
    loop {
        let status = status(socket, LIMIT).unwrap();
        if is_wanted(&status) {
            return status;
        }
        assert!(Instant::now() < deadline, "still {status:?}");
    }
}

#[test]
fn status_says_what_is_published_and_built_and_who_looks() {
    let bench = serve(&[b"x"]);
    let empty = status(&bench.socket, LIMIT).unwrap();
    assert_eq!((empty.revision, empty.pid, empty.project.as_str()), (0, std::process::id(), "test"));
    assert!(empty.clients.is_empty() && empty.building.is_none(), "who asks is no client");
    let mut revision = table(7, &[b"x"]);
    revision.diagnostics = vec![Diagnostic::error("shader is broken"), Diagnostic::warning("sky is dark")];
    revision.targets.values_mut().for_each(|target| target.state = TargetState::Stale);
    bench.server.publish(Arc::new(revision));
    bench.server.set_building(Some(vec!["a.wgsl".into()]));
    bench.server.report_progress(&ProgressReport { done: 1, total: 3, current: "compile".into() });
    let client = Client::connect(bench.socket.clone(), "viewer");
    next_revision(&client);
    client.want(vec!["env/a".into()]);
    client.report_frame(FrameReport {
        revision: 7,
        received_unix_ms: 1.0,
        ready_unix_ms: 2.0,
        drawn_unix_ms: 30.0,
    });
    let status = status_when(&bench.socket, |status| {
        let viewer = status.clients.first();
        viewer.is_some_and(|viewer| {
            viewer.shown_revision == 7 && viewer.round_trip_ms.is_some() && !viewer.wants.is_empty()
        })
    });
    assert_eq!((status.revision, status.targets), (7, 1));
    assert_eq!(status.stale, ["env/a/specular"]);
    assert_eq!(
        status.errors.iter().map(|error| error.message.as_str()).collect::<Vec<_>>(),
        ["shader is broken"]
    );
    let building = status.building.unwrap();
    assert_eq!((building.files, building.progress.done), (vec!["a.wgsl".to_owned()], 1));
    let viewer = &status.clients[0];
    assert_eq!((viewer.name.as_str(), viewer.told_revision, viewer.waiting_contents), ("viewer", 7, 0));
    assert_eq!(viewer.shown_after_ms, Some(30.0), "the table says it was published at 0");
    assert_eq!(viewer.wants, ["env/a"]);
    assert_eq!(bench.server.wanted().targets, ["env/a"]);
    bench.server.set_building(None);
    assert_eq!(super::super::status(&bench.socket, LIMIT).unwrap().building, None);
}

#[test]
fn who_only_asks_is_not_announced() {
    let bench = serve(&[]);
    status(&bench.socket, LIMIT).unwrap();
    let client = Client::connect(bench.socket.clone(), "viewer");
    let first = bench.events.recv_timeout(LIMIT).unwrap();
    assert!(matches!(&first, ServerEvent::Connected { name, .. } if name == "viewer"), "{first:?}");
    drop(client);
}

#[test]
fn wants_are_said_again_to_the_next_daemon() {
    let bench = serve(&[]);
    let client = Client::connect(bench.socket.clone(), "viewer");
    client.want(vec!["scene/balls".into()]);
    status_when(&bench.socket, |status| status.clients.iter().any(|viewer| !viewer.wants.is_empty()));
    drop(bench.server);
    let _next = Server::bind(&bench.socket, "test", Box::new(|_| None), Box::new(drop)).unwrap();
    status_when(&bench.socket, |status| status.clients.iter().any(|viewer| viewer.wants == ["scene/balls"]));
}

#[test]
fn ping_is_answered_and_timed() {
    let bench = serve(&[]);
    bench.server.publish(Arc::new(table(1, &[])));
    let client = Client::connect(bench.socket.clone(), "viewer");
    next_revision(&client);
    assert_eq!(client.round_trip(), None);
    client.ping();
    let deadline = Instant::now() + LIMIT;
    while client.round_trip().is_none() {
        assert!(Instant::now() < deadline);
        std::thread::yield_now();
    }
}

#[test]
fn stop_returns_when_socket_and_lock_are_free() {
    let bench = serve(&[]);
    let held = ProjectLock::take(&bench.socket).unwrap();
    let (socket, events, server) = (bench.socket.clone(), bench.events, bench.server);
    let daemon = std::thread::spawn(move || {
        while events.recv_timeout(LIMIT).unwrap() != ServerEvent::StopAsked {}
        drop(server);
        drop(held);
    });
    stop(&socket, LIMIT).unwrap();
    assert!(!socket.exists());
    ProjectLock::take(&socket).unwrap();
    daemon.join().unwrap();
    assert!(matches!(stop(&socket, LIMIT), Err(ControlError::NoDaemon)));
}

#[test]
fn daemon_that_does_not_end_is_said_to_be_late() {
    let bench = serve(&[]);
    let error = stop(&bench.socket, Duration::from_millis(50)).unwrap_err();
    assert!(matches!(error, ControlError::Late { what: "end", .. }), "{error}");
}

#[test]
fn socket_without_a_daemon_is_none_and_one_of_another_version_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("p.sock");
    assert!(matches!(status(&socket, LIMIT), Err(ControlError::NoDaemon)));
    let listener = UnixListener::bind(&socket).unwrap();
    let old = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let hello = Hello { protocol: 1, ..Hello::new("old", &[]) };
        stream.write_all(&ServerMessage::Hello(hello).encode()).unwrap();
        stream
    });
    assert!(matches!(status(&socket, LIMIT), Err(ControlError::Version { theirs: 1 })));
    drop(old.join().unwrap());
    assert!(matches!(status(&socket, LIMIT), Err(ControlError::NoDaemon)), "its socket is stale");
}

#[test]
fn frames_that_cannot_be_are_not_passed_on() {
    let bench = serve(&[]);
    bench.server.publish(Arc::new(table(1, &[])));
    let client = Client::connect(bench.socket.clone(), "viewer");
    next_revision(&client);
    let report =
        |revision| FrameReport { revision, received_unix_ms: 1.0, ready_unix_ms: 2.0, drawn_unix_ms: 3.0 };
    [99, 1, 1, 1].map(report).into_iter().for_each(|report| client.report_frame(report));
    drop(client);
    let events: Vec<ServerEvent> = bench.events.iter().take(3).collect();
    assert!(
        matches!(
            &events[..],
            [
                ServerEvent::Connected { .. },
                ServerEvent::Frame { report: FrameReport { revision: 1, .. }, .. },
                ServerEvent::Gone { .. }
            ]
        ),
        "{events:?}"
    );
}

#[test]
fn connections_beyond_the_limit_are_refused_and_later_ones_served() {
    let bench = serve(&[]);
    let silent: Vec<UnixStream> = (0..64).map(|_| UnixStream::connect(&bench.socket).unwrap()).collect();
    let refused = status(&bench.socket, LIMIT).unwrap_err();
    assert!(!matches!(refused, ControlError::Late { .. }), "{refused}");
    drop(silent);
    let deadline = Instant::now() + LIMIT;
    while status(&bench.socket, LIMIT).is_err() {
        assert!(Instant::now() < deadline);
    }
}
