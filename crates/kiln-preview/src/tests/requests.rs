//! What the window asks the daemon to do, driven as a user drives it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use kiln_diagnostic::Diagnostic;
use kiln_link::{Answer, Ask, ParameterWrite, RevisionTable, Target, TargetState};

use super::panels::{harness, state, state_with_parameters, values};
use crate::panel::{PanelState, requests};

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("nobody reads it here".to_owned())
    }
}

fn drop_files(harness: &mut Harness<'_, PanelState>, paths: &[PathBuf]) {
    for path in paths {
        harness.input_mut().dropped_files.push(Arc::new(Dropped(path.clone())));
    }
    harness.run_steps(1);
    harness.input_mut().dropped_files.clear();
    harness.run_steps(3);
}

fn write(name: &str, value: &[f64]) -> ParameterWrite {
    ParameterWrite { shader: "pbr".to_owned(), name: name.to_owned(), value: value.to_vec() }
}

/// Wetness and mode are not what the source says.
fn changed() -> PanelState {
    let mut state = state_with_parameters();
    let offered = state.report.parameters.clone();
    state.view.parameters.set(&offered[0], vec![1.5]);
    state.view.parameters.set(&offered[3], vec![1.0]);
    state
}

fn table(targets: &[&str]) -> RevisionTable {
    let target = Target {
        kind: "cube".to_owned(),
        state: TargetState::Fresh,
        meta: serde_json::Value::Null,
        parts: Vec::new(),
    };
    let targets = targets.iter().map(|name| ((*name).to_owned(), target.clone())).collect();
    RevisionTable { targets, ..RevisionTable::default() }
}

#[test]
fn changed_value_can_be_written_alone_or_with_all_others() {
    let mut harness = harness(changed());
    assert!(harness.query_by_label("write pbr.tint").is_none(), "the source says it already");
    harness.get_by_label("write pbr.wetness").click();
    harness.run_steps(4);
    let parameters = vec![write("wetness", &[1.5])];
    assert_eq!(harness.state_mut().requests.take(), [Ask::WriteParameters { parameters }]);
    harness.get_by_label("Write all of pbr").click();
    harness.run_steps(4);
    let parameters = vec![write("wetness", &[1.5]), write("mode", &[1.0])];
    assert_eq!(harness.state_mut().requests.take(), [Ask::WriteParameters { parameters }]);
    assert_eq!(harness.state_mut().requests.take(), [], "each is sent once");
    assert!(harness.query_by_label("asked the daemon …").is_some());
}

#[test]
fn value_that_the_source_says_now_is_no_longer_the_users() {
    let mut state = changed();
    let mut offered = state.report.parameters.clone();
    offered[0].first = vec![f64::from(1.5_f32)];
    state.view.parameters.settle(&offered);
    assert!(!state.view.parameters.is_set(&offered[0]));
    assert!(state.view.parameters.is_set(&offered[3]), "the source says another value");
    // A colour's channels are halves of what an `f64` holds; the source has its short form.
    let tint = &mut offered[1];
    state.view.parameters.set(tint, [0.1_f32, 0.2, 0.3].map(f64::from).to_vec());
    tint.first = vec![0.1, 0.2, 0.3];
    state.view.parameters.settle(&offered);
    assert!(!state.view.parameters.is_set(&offered[1]));
}

#[test]
fn dropped_files_are_asked_for_with_their_paths() {
    let mut harness = harness(state());
    drop_files(&mut harness, &["/elsewhere/sky.hdr".into(), "/elsewhere/car.glb".into()]);
    let paths = vec!["/elsewhere/sky.hdr".to_owned(), "/elsewhere/car.glb".to_owned()];
    assert_eq!(harness.state_mut().requests.take(), [Ask::AddFiles { paths }]);
}

#[cfg(unix)]
#[test]
fn dropped_file_whose_name_is_no_text_is_refused_here() {
    use std::os::unix::ffi::OsStringExt as _;
    let mut harness = harness(state());
    drop_files(&mut harness, &[std::ffi::OsString::from_vec(b"/tmp/\xff.hdr".to_vec()).into()]);
    assert_eq!(harness.state_mut().requests.take(), []);
    assert!(harness.query_by_label("help: give it another name").is_some());
}

#[test]
fn files_over_the_window_say_what_a_drop_would_do() {
    let mut harness = harness(state());
    let hint = "Drop to add to demo: .hdr .exr .ktx .ktx2 .dds .gltf .glb";
    assert!(harness.query_by_label(hint).is_none());
    harness.input_mut().hovered_files.push(egui::HoveredFile::default());
    harness.run_steps(2);
    assert!(harness.query_by_label(hint).is_some());
}

#[test]
fn answer_is_shown_until_it_is_dismissed() {
    let mut harness = harness(state());
    let done = Answer { message: "wrote shaders/pbr.wgsl".to_owned(), ..Answer::default() };
    requests::receive(harness.state_mut(), done);
    harness.run_steps(4);
    assert!(harness.query_by_label("wrote shaders/pbr.wgsl").is_some());
    let fault = Diagnostic::error("this file was changed meanwhile; it stays as it is").in_file("pbr.wgsl");
    requests::receive(harness.state_mut(), Answer::refused(2, fault.with_help("ask again")));
    harness.run_steps(4);
    assert!(harness.query_by_label("wrote shaders/pbr.wgsl").is_none());
    for label in ["this file was changed meanwhile; it stays as it is", "pbr.wgsl", "help: ask again"] {
        assert!(harness.query_by_label(label).is_some(), "`{label}` is not shown");
    }
    harness.get_by_label("Dismiss").click();
    harness.run_steps(4);
    assert!(harness.query_by_label("pbr.wgsl").is_none());
}

#[test]
fn what_was_added_is_shown_once_a_revision_has_it() {
    let mut state = state();
    state.selection.env = Some("studio".to_owned());
    let targets = vec!["env/dusk".to_owned(), "scene/boat".to_owned()];
    requests::receive(&mut state, Answer { targets, ..Answer::default() });
    assert_eq!(state.selection.env.as_deref(), Some("studio"), "there is none yet");
    state.receive(&table(&["env/duskier/specular", "env/sky/specular"]), 0.0);
    assert_eq!(state.selection.env.as_deref(), Some("studio"));
    state.receive(&table(&["env/dusk/specular", "env/sky/specular"]), 0.0);
    assert_eq!((state.selection.env.as_deref(), state.selection.scene.as_deref()), (Some("dusk"), None));
    state.receive(&table(&["env/dusk/specular", "scene/boat"]), 0.0);
    assert_eq!(
        (state.selection.env.as_deref(), state.selection.scene.as_deref()),
        (Some("dusk"), Some("boat"))
    );
    state.selection.scene = Some("ball".to_owned());
    state.receive(&table(&["scene/boat"]), 0.0);
    assert_eq!(state.selection.scene.as_deref(), Some("ball"), "it is shown once, not whenever it changes");
}

#[test]
fn what_the_project_has_already_is_shown_at_once() {
    let mut state = state();
    let targets = vec!["env/studio".to_owned()];
    requests::receive(&mut state, Answer { targets, ..Answer::default() });
    assert_eq!(state.selection.env.as_deref(), Some("studio"));
    assert!(values(&state).is_empty());
}
