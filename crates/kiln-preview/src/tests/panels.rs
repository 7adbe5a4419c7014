//! The panels, driven as a user drives them.

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use kiln_diagnostic::Diagnostic;
use kiln_link::{ActionTime, RevisionTable, Work};
use kiln_shader::Widget;

use crate::panel::{self, Connection, PanelState};
use crate::theme;
use crate::{AnimationTime, Background, Ground, OfferedAnimation, OfferedParameter, Selection, View};

pub(super) fn state() -> PanelState {
    let mut state = PanelState::new("llvmpipe, Vulkan".to_owned(), Selection::default(), View::default());
    state.connection = Connection::Connected;
    state.project = "demo".to_owned();
    state.report.revision = 7;
    state.report.scenes = vec!["ball".to_owned(), "car".to_owned()];
    state.report.envs = vec!["sky".to_owned(), "studio".to_owned()];
    state.report.shown =
        Selection { scene: Some("ball".to_owned()), env: Some("sky".to_owned()), ..Selection::default() };
    state
}

pub(super) fn harness(state: PanelState) -> Harness<'static, PanelState> {
    let show = |ui: &mut egui::Ui, state: &mut PanelState| {
        theme::apply(ui.ctx());
        panel::show(ui, state, |_, _| ());
    };
    let mut harness = Harness::builder().with_size([1280.0, 2400.0]).build_ui_state(show, state);
    harness.run_steps(4);
    harness
}

#[test]
fn picking_an_environment_changes_the_selection() {
    let mut harness = harness(state());
    assert!(harness.query_by_label("studio").is_none(), "the list is closed");
    harness.get_by_label("environment").click();
    harness.run_steps(4);
    harness.get_by_label("studio").click();
    harness.run_steps(4);
    assert_eq!(harness.state().selection.env.as_deref(), Some("studio"));
    assert_eq!(harness.state().selection.scene, None);
}

#[test]
fn diagnostic_shows_message_place_source_and_caret() {
    let mut state = state();
    let text = "fn f() {\n\tlet x = n_dot_vv;\n}";
    let at = text.find("n_dot_vv").expect("it is there");
    let diagnostic = Diagnostic::error("no definition in scope for `n_dot_vv`")
        .at("shaders/pbr/pbr.wgsl", text, at..at + 8)
        .with_help("did you mean `n_dot_v`?");
    state.receive(&RevisionTable { diagnostics: vec![diagnostic], ..Default::default() }, 0.0);
    let harness = harness(state);
    for label in [
        "no definition in scope for `n_dot_vv`",
        "shaders/pbr/pbr.wgsl:2:10",
        "2 |     let x = n_dot_vv;",
        "  |             ^^^^^^^^",
        "help: did you mean `n_dot_v`?",
        "1 error",
    ] {
        assert!(harness.query_by_label(label).is_some(), "`{label}` is not shown");
    }
}

#[test]
fn without_diagnostics_no_error_is_shown() {
    let harness = harness(state());
    assert!(harness.query_by_label("error").is_none());
    assert!(harness.query_by_label("1 error").is_none());
    assert!(harness.query_by_label("stale").is_none());
}

#[test]
fn lost_daemon_is_said_and_a_daemon_never_seen_is_not_an_alarm() {
    let mut lost = state();
    lost.lose_connection("the daemon ended the connection".to_owned());
    assert!(harness(lost).query_by_label("daemon gone, reconnecting").is_some());
    let mut never = PanelState::new(String::new(), Selection::default(), View::default());
    never.lose_connection("no daemon serves this project".to_owned());
    assert!(harness(never).query_by_label("looking for a daemon").is_some());
}

#[test]
fn stale_targets_and_build_times_are_shown() {
    let mut state = state();
    state.report.stale = vec!["shader/pbr/base".to_owned()];
    let ran =
        vec![ActionTime { name: "compile pbr".into(), wall_ms: 12.5, reason: "pbr.wgsl changed".into() }];
    let work = Work { ran, reused: 30, plan_ms: 1.0, run_ms: 13.0, ..Default::default() };
    state.receive(&RevisionTable { work, ..Default::default() }, 0.0);
    let harness = harness(state);
    for label in ["stale", "compile pbr", "pbr.wgsl changed", "1 ran, 30 reused, plan 1.0 ms, run 13.0 ms"] {
        assert!(harness.query_by_label(label).is_some(), "`{label}` is not shown");
    }
}

#[test]
fn choosing_another_scene_drops_the_camera_of_the_first() {
    let mut state = state();
    state.view.camera = Some(crate::OrbitCamera::BACKGROUND_ONLY);
    state.selection.env = Some("studio".to_owned());
    let mut harness = harness(state);
    harness.get_by_label("scene").click();
    harness.run_steps(4);
    harness.get_by_label("car").click();
    harness.run_steps(4);
    assert_eq!(
        harness.state().selection,
        Selection { scene: Some("car".to_owned()), ..Selection::default() }
    );
    assert_eq!(harness.state().view.camera, None);
}

fn offered(name: &str, ty: &str, widget: Widget, first: Vec<f64>) -> OfferedParameter {
    let (shader, name, ty, label) =
        ("pbr".to_owned(), name.to_owned(), ty.to_owned(), "how it looks".to_owned());
    OfferedParameter { shader, name, ty, is_override: false, widget, first, label }
}

pub(super) fn state_with_parameters() -> PanelState {
    let mut state = state();
    let names = vec!["flat".to_owned(), "smooth".to_owned()];
    state.report.parameters = vec![
        offered("wetness", "f32", Widget::Slider { least: 0.0, greatest: 2.0 }, vec![0.5]),
        offered("tint", "vec3<f32>", Widget::Color, vec![1.0, 0.9, 0.8]),
        offered("is_lit", "u32", Widget::Toggle, vec![1.0]),
        offered("mode", "u32", Widget::Choice { names }, vec![0.0]),
    ];
    state
}

/// What the parameters of the state are set to.
pub(super) fn values(state: &PanelState) -> Vec<Vec<f64>> {
    state.report.parameters.iter().map(|parameter| state.view.parameters.of(parameter)).collect()
}

#[test]
fn parameters_have_a_row_each_and_change_what_is_shown() {
    let mut harness = harness(state_with_parameters());
    assert!(harness.query_by_label("Shader pbr").is_some());
    let first = values(harness.state());
    harness.get_by_role_and_label(egui::accesskit::Role::CheckBox, "is_lit").click();
    harness.run_steps(4);
    harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "mode").click();
    harness.run_steps(4);
    harness.get_by_label("smooth").click();
    harness.run_steps(4);
    let slider = harness.get_by_role_and_label(egui::accesskit::Role::Slider, "wetness");
    slider.click();
    harness.run_steps(4);
    let changed = values(harness.state());
    assert!(changed[0] != first[0] && (0.0..=2.0).contains(&changed[0][0]), "{changed:?}");
    assert_eq!(changed[1..], [vec![1.0, 0.9, 0.8], vec![0.0], vec![1.0]]);
    harness.get_by_label("reset pbr.mode").click();
    harness.run_steps(4);
    assert_eq!(values(harness.state())[3], [0.0]);
    assert_eq!(values(harness.state())[2], [0.0], "the others stay");
    harness.get_by_label("Reset pbr").click();
    harness.run_steps(4);
    assert_eq!(values(harness.state()), first);
}

#[test]
fn resetting_the_light_leaves_parameters_alone() {
    let mut state = state_with_parameters();
    let wetness = state.report.parameters[0].clone();
    state.view.parameters.set(&wetness, vec![1.5]);
    state.view.exposure_ev = 2.0;
    let mut harness = harness(state);
    harness.get_by_label("Reset light").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.exposure_ev, 0.0);
    assert_eq!(harness.state().view.parameters.of(&wetness), [1.5]);
}

fn state_with_motion() -> PanelState {
    let mut state = state();
    let offered = |name: &str, duration_s| OfferedAnimation { name: name.to_owned(), duration_s };
    state.report.animations = vec![offered("walk", 60.0), offered("run", 1.0)];
    state.report.variants = vec!["day".to_owned(), "night".to_owned()];
    state.report.cameras = vec!["front".to_owned(), "top".to_owned()];
    state
}

#[test]
fn chosen_animation_plays_until_it_is_paused() {
    let mut harness = harness(state_with_motion());
    assert!(harness.query_by_label("Pause").is_none(), "the rest pose has nothing to pause");
    harness.get_by_label("animation").click();
    harness.run_steps(4);
    harness.get_by_label("walk").click();
    harness.run_steps(4);
    let time = |harness: &Harness<'_, PanelState>| harness.state().view.animation.expect("it plays");
    let early = time(&harness);
    assert_eq!(early.index, 0);
    harness.run_steps(4);
    assert!(time(&harness).time_s > early.time_s);
    harness.get_by_label("Pause").click();
    harness.run_steps(2);
    let paused = time(&harness);
    harness.run_steps(4);
    assert_eq!(time(&harness), paused);
    harness.key_press(egui::Key::Space);
    harness.run_steps(4);
    assert!(harness.state().playback.is_playing);
}

#[test]
fn animation_that_does_not_loop_stops_at_its_end_and_plays_again() {
    let mut state = state_with_motion();
    state.view.animation = Some(AnimationTime { index: 1, time_s: 0.999 });
    state.playback.is_playing = true;
    state.playback.is_looping = false;
    let mut harness = harness(state);
    harness.run_steps(4);
    assert_eq!(harness.state().view.animation, Some(AnimationTime { index: 1, time_s: 1.0 }));
    assert!(!harness.state().playback.is_playing);
    harness.get_by_label("Play").click();
    harness.run_steps(2);
    assert!(harness.state().view.animation.is_some_and(|time| time.time_s < 0.9));
}

#[test]
fn variants_and_cameras_are_chosen_and_belong_to_their_scene() {
    let mut state = state_with_motion();
    state.view.camera = Some(crate::OrbitCamera::BACKGROUND_ONLY);
    let mut harness = harness(state);
    for (list, choice) in [("material variant", "night"), ("camera", "top")] {
        harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, list).click();
        harness.run_steps(4);
        harness.get_by_label(choice).click();
        harness.run_steps(4);
    }
    assert_eq!(harness.state().selection.variant.as_deref(), Some("night"));
    assert_eq!((harness.state().view.camera, harness.state().view.scene_camera), (None, 1));
    harness.get_by_label("scene").click();
    harness.run_steps(4);
    harness.get_by_label("car").click();
    harness.run_steps(4);
    assert_eq!((harness.state().selection.variant.as_deref(), harness.state().view.scene_camera), (None, 0));
}

#[test]
fn background_and_ground_are_chosen_in_the_panel() {
    let mut harness = harness(state());
    assert!(harness.query_by_label("background colour").is_none(), "the environment has no colour");
    harness.get_by_label("background").click();
    harness.run_steps(4);
    harness.get_by_label("Colour").click();
    harness.run_steps(4);
    assert!(matches!(harness.state().view.background, Background::Color(_)));
    assert!(harness.query_by_label("background colour").is_some());
    harness.get_by_label("Grid").click();
    harness.get_by_label("Shadow on the ground").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.ground, Ground { has_grid: true, catches_shadow: true });
    let why =
        |harness: &Harness<'_, PanelState>| harness.query_by_label_contains("sun is no light").is_some();
    assert!(why(&harness), "a ground that shows no shadow says why");
    harness.state_mut().report.has_sun = true;
    harness.run_steps(2);
    assert!(!why(&harness));
}
