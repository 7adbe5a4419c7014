//! `kiln status` and `kiln stop`.

use serde_json::{Value, json};

use crate::harness::{Project, text};

/// Exit code and answer of `kiln status --json`.
fn status(project: &Project) -> (i32, Value) {
    let output = project.run(&["status", "DIR", "--json"]);
    let answer = serde_json::from_slice(&output.stdout);
    (
        output.status.code().unwrap(),
        answer.unwrap_or_else(|error| panic!("{error}: {}", text(&output.stderr))),
    )
}

#[test]
fn status_and_stop_of_a_running_daemon_and_of_none() {
    let project = Project::sample();
    assert_eq!(status(&project), (1, json!({"running": false})));
    assert_eq!(project.run(&["stop", "DIR"]).status.code(), Some(0), "what was asked for is so already");
    let watch = project.watch();
    watch.published();
    let client = watch.client("viewer");
    client.revision();
    let (code, answer) = status(&project);
    assert_eq!(code, 0);
    let daemon = &answer["daemon"];
    assert_eq!((&daemon["revision"], &daemon["clients"][0]["name"]), (&json!(1), &json!("viewer")));
    assert_eq!(daemon["stale"], json!([]));
    let lines = text(&project.run(&["status", "DIR"]).stdout);
    assert!(lines.contains("revision 1 with") && lines.contains("(viewer)"), "{lines}");
    let stopped = project.run(&["stop", "DIR"]);
    assert_eq!(stopped.status.code(), Some(0), "{}", text(&stopped.stderr));
    client.disconnected();
    assert!(!watch.socket.exists());
    assert_eq!(status(&project).0, 1);
    // Nothing is in the way of the next one.
    project.watch().published();
}
