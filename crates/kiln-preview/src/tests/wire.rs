//! `run_headless` against a real server on a real socket.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use kiln_link::{Server, ServerEvent};
use serde_json::json;

use super::fixture::{Build, gpu};
use crate::{HeadlessOptions, Selection, View, run_headless};

const PATIENCE: Duration = Duration::from_secs(60);

fn options(folder: &std::path::Path) -> HeadlessOptions {
    HeadlessOptions {
        daemon: folder.join("socket").into(),
        out: folder.join("frames"),
        frames: 2,
        size: [64, 36],
        parameters: Vec::new(),
        selection: Selection::default(),
        view: View::default(),
        rotation_step_rad: 1.0,
        revision_min: 1,
        timeout: PATIENCE,
    }
}

#[test]
fn headless_run_writes_frames_and_reports_the_first_to_the_daemon() {
    if gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = options(folder.path());
    let revision = Arc::new(Build::ball(json!({ "pbrMetallicRoughness": {} })).revision());
    let (sender, events) = channel();
    let blobs = Arc::clone(&revision);
    let source = move |digest: &kiln_build::Digest| {
        let mut parts = blobs.table.targets.values().flat_map(|target| &target.parts);
        parts.find(|part| part.digest == *digest).map(|part| Arc::clone(blobs.bytes(part)))
    };
    let event = move |event| drop(sender.send(event));
    let server = Server::bind(&folder.path().join("socket"), "test", Box::new(source), Box::new(event))
        .expect("the socket is free");
    server.publish(Arc::new(revision.table.clone()));
    let report = run_headless(&options).expect("two frames");
    assert_eq!((report.revision, report.files.len()), (1, 2));
    assert_eq!((report.scene.as_deref(), report.env.as_deref()), (Some("ball"), Some("sky")));
    let frames = report.files.iter().map(|file| image::open(file).expect("a PNG").into_rgba8());
    let frames: Vec<_> = frames.collect();
    assert_eq!(frames[0].dimensions(), (64, 36));
    assert!(frames[0] != frames[1], "the environment turned");
    assert!(options.out.join("report.json").is_file());
    loop {
        let event = events.recv_timeout(PATIENCE).expect("the daemon hears of the frame");
        if let ServerEvent::Frame { report, .. } = event {
            assert_eq!(report.revision, 1);
            assert!(report.received_unix_ms <= report.ready_unix_ms);
            assert!(report.ready_unix_ms <= report.drawn_unix_ms);
            break;
        }
    }
}

#[test]
fn headless_run_without_a_daemon_says_why_it_gave_up() {
    if gpu().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = HeadlessOptions { timeout: Duration::from_millis(300), ..options(folder.path()) };
    let error = run_headless(&options).expect_err("nobody is there").to_string();
    assert!(error.contains("no daemon serves this project"), "{error}");
}
