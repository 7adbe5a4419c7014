//! The window as a tool: keys, comparing, holding, history. Driven as a user does.

use std::collections::BTreeSet;

use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use kiln_diagnostic::Diagnostic;
use kiln_link::{FrameReport, RevisionTable, Target, TargetState, Work};

use super::panels::{harness, state};
use crate::history::{BUILDS_MAX, History, Stage};
use crate::panel::compare::{Mode, Numbers, PINS_MAX, Side};
use crate::panel::keys::BINDINGS;
use crate::panel::turntable::Turning;
use crate::panel::{Framing, PanelState};
use crate::view::View;

fn press(harness: &mut Harness<'_, PanelState>, key: Key, shift: bool) {
    harness.key_press_modifiers(if shift { Modifiers::SHIFT } else { Modifiers::NONE }, key);
    harness.run_steps(3);
}

/// A window in which nothing has to be scrolled to.
fn tall(state: PanelState) -> Harness<'static, PanelState> {
    let mut harness = harness(state);
    harness.set_size(egui::vec2(1280.0, 2400.0));
    harness.run_steps(4);
    harness
}

#[test]
fn every_key_is_bound_once_and_stands_in_the_help() {
    let keys: BTreeSet<(Key, bool)> = BINDINGS.iter().map(|binding| (binding.key, binding.shift)).collect();
    assert_eq!(keys.len(), BINDINGS.len(), "two bindings have one key");
    let mut harness = harness(state());
    press(&mut harness, Key::H, false);
    for binding in BINDINGS {
        assert!(harness.query_by_label(binding.help).is_some(), "help lacks `{}`", binding.help);
    }
    press(&mut harness, Key::Escape, false);
    assert!(harness.query_by_label(BINDINGS[0].help).is_none(), "the help is closed");
}

#[test]
fn keys_step_through_what_the_project_has_and_around_its_end() {
    let mut harness = harness(state());
    press(&mut harness, Key::ArrowRight, false);
    assert_eq!(harness.state().selection.env.as_deref(), Some("studio"));
    press(&mut harness, Key::ArrowUp, false);
    assert_eq!(harness.state().selection.scene.as_deref(), Some("car"), "before the first is the last");
    assert_eq!(harness.state().selection.env, None, "its own light");
}

#[test]
fn keys_frame_reset_turn_hide_and_shoot() {
    let mut harness = harness(state());
    harness.state_mut().view.exposure_ev = 2.0;
    press(&mut harness, Key::F, false);
    assert_eq!(harness.state().frame_asked, Some(Framing::Scene));
    press(&mut harness, Key::R, false);
    assert_eq!(harness.state().view, View::default());
    press(&mut harness, Key::T, true);
    assert_eq!(harness.state().turntable.turning, Some(Turning::Light));
    press(&mut harness, Key::T, true);
    assert_eq!(harness.state().turntable.turning, None);
    press(&mut harness, Key::S, true);
    assert_eq!(harness.state().shots.asked, Some(true));
    assert!(harness.query_by_label("Builds").is_some() || harness.query_by_label("No build yet").is_some());
    press(&mut harness, Key::Tab, false);
    assert!(harness.query_by_label("No build yet").is_none(), "the panels are hidden");
    press(&mut harness, Key::Tab, false);
    assert!(harness.query_by_label("No build yet").is_some());
}

#[test]
fn keys_are_left_to_a_field_that_somebody_types_in() {
    let mut harness = harness(state());
    harness.get_by_role_and_label(egui::accesskit::Role::SpinButton, "Exposure").focus();
    harness.run_steps(2);
    press(&mut harness, Key::F, false);
    assert_eq!(harness.state().frame_asked, None);
    harness.state_mut().view.exposure_ev = 0.0;
}

#[test]
fn modified_keys_are_not_the_windows() {
    let mut harness = harness(state());
    harness.key_press_modifiers(Modifiers::CTRL, Key::P);
    harness.run_steps(3);
    assert!(harness.state().compare.pins.is_empty());
}

#[test]
fn pinned_picture_is_compared_with_the_live_one_and_freed_again() {
    let mut harness = tall(state());
    press(&mut harness, Key::C, false);
    assert!(!harness.state().compare.is_on, "there is nothing to compare with");
    press(&mut harness, Key::P, false);
    let compare = &harness.state().compare;
    assert_eq!((compare.sides, compare.is_shown()), ([Side::Pin(1), Side::Live], true));
    assert_eq!((compare.pins[0].revision, compare.pins[0].look.selection.env.as_deref()), (7, Some("sky")));
    for (key, mode) in [(Key::Num2, Mode::Flip), (Key::Num3, Mode::HeatMap), (Key::Num1, Mode::Swipe)] {
        press(&mut harness, key, false);
        assert_eq!(harness.state().compare.mode, mode);
    }
    press(&mut harness, Key::A, false);
    assert_eq!((harness.state().compare.mode, harness.state().compare.flipped_to), (Mode::Flip, 0));
    harness.get_by_label("unpin 1").click();
    harness.run_steps(3);
    assert!(harness.state().compare.pins.is_empty() && !harness.state().compare.is_shown());
}

#[test]
fn pins_have_a_limit_and_the_oldest_goes() {
    let mut state = state();
    for _ in 0..=PINS_MAX {
        state.pin_as_a();
    }
    let ids: Vec<u64> = state.compare.pins.iter().map(|pin| pin.id).collect();
    assert_eq!(ids, (2..=PINS_MAX as u64 + 1).collect::<Vec<_>>());
    assert_eq!(state.compare.sides, [Side::Pin(PINS_MAX as u64 + 1), Side::Live]);
    state.compare.unpin(PINS_MAX as u64 + 1);
    assert_eq!(state.compare.sides[0], Side::Pin(PINS_MAX as u64), "the newest of the others");
    let mut empty = PanelState::new(String::new(), Default::default(), View::default());
    empty.pin_as_a();
    assert!(empty.compare.pins.is_empty(), "nothing was shown yet");
}

#[test]
fn any_two_of_live_and_pins_stand_side_by_side() {
    let mut state = state();
    state.pin_as_a();
    state.pin_as_a();
    let mut harness = tall(state);
    harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "side B").click();
    harness.run_steps(4);
    let title = harness.state().compare.pins[0].title();
    let choices: Vec<_> = harness.get_all_by_label(&title).collect();
    choices.last().expect("the list is open").click();
    harness.run_steps(4);
    assert_eq!(harness.state().compare.sides, [Side::Pin(2), Side::Pin(1)]);
}

#[test]
fn numbers_are_worded_for_equal_pictures_too() {
    let numbers =
        Numbers { rmse: 0.0, psnr_db: f64::INFINITY, flip_mean: 0.0, flip_max: 0.0, difference_max: 0 };
    assert_eq!(numbers.text(), "RMSE 0.00000   PSNR equal   FLIP 0.0000, at most 0.000   channel ≤ 0/255");
}

#[test]
fn held_revision_says_what_waits_and_is_let_go() {
    let mut state = state();
    state.hold.is_on = true;
    state.hold.waiting = Some(9);
    let mut harness = harness(state);
    assert!(harness.query_by_label("revision 7 is held").is_some());
    harness.get_by_label("Go to revision 9").click();
    harness.run_steps(3);
    assert!(!harness.state().hold.is_on);
    assert!(harness.query_by_label("revision 7 is held").is_none());
}

fn stale_table(number: u64) -> RevisionTable {
    let target = Target {
        kind: "shader".to_owned(),
        state: TargetState::Stale,
        meta: serde_json::Value::Null,
        parts: Vec::new(),
    };
    let diagnostics = vec![Diagnostic::error("first"), Diagnostic::error("second")];
    let targets = [("shader/pbr/base".to_owned(), target)].into();
    RevisionTable { number, targets, diagnostics, ..RevisionTable::default() }
}

#[test]
fn stale_badge_opens_all_errors_with_since_when_and_copies_them() {
    let mut state = state();
    state.receive(&stale_table(5), 0.0);
    state.receive(&stale_table(6), 0.0);
    state.report.stale = vec!["shader/pbr/base".to_owned()];
    let mut harness = harness(state);
    for label in ["first", "second", "shader/pbr/base is stale since revision 5"] {
        assert!(harness.query_by_label(label).is_some(), "`{label}` is not shown");
    }
    harness.get_by_label("Copy").click();
    harness.step();
    let copied = harness.output().platform_output.commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    harness.run_steps(2);
    let expected = "error: first\nerror: second\nshader/pbr/base is stale since revision 5";
    assert_eq!(copied.as_deref(), Some(expected));
    harness.get_by_label("Close").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("first").is_none(), "the card is closed");
    harness.get_by_label("stale").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("first").is_some(), "the badge opens it");
}

#[test]
fn mended_target_is_no_longer_stale() {
    let mut state = state();
    state.receive(&stale_table(5), 0.0);
    state.receive(&RevisionTable { number: 6, ..Default::default() }, 0.0);
    assert!(state.stale_since.is_empty());
}

fn table(number: u64, file: &str) -> RevisionTable {
    let work = Work {
        changed_files: vec![file.to_owned()],
        plan_ms: 2.0,
        run_ms: 10.0,
        noticed_unix_ms: 1000.0,
        published_unix_ms: 1015.0,
        ..Work::default()
    };
    RevisionTable { number, work, ..RevisionTable::default() }
}

#[test]
fn stages_add_up_to_the_time_from_the_change_to_the_picture() {
    let mut history = History::default();
    history.receive(&table(3, "a.wgsl"), 1016.0);
    let report =
        FrameReport { revision: 3, received_unix_ms: 1016.0, ready_unix_ms: 1036.0, drawn_unix_ms: 1040.0 };
    history.note_frame(&report);
    let build = history.chosen().expect("it was received");
    let stages: Vec<f64> = build.stages().iter().map(|(_, ms)| *ms).collect();
    assert_eq!(stages, [2.0, 10.0, 3.0, 1.0, 20.0, 4.0]);
    assert_eq!(build.total_ms(), 40.0);
    assert_eq!(build.stages().len(), Stage::ALL.len());
}

#[test]
fn clock_that_was_set_back_gives_no_negative_stage() {
    let mut history = History::default();
    history.receive(&table(3, "a.wgsl"), 500.0);
    let build = history.chosen().expect("it was received");
    assert!(build.stages().iter().all(|(_, ms)| *ms >= 0.0), "{:?}", build.stages());
}

#[test]
fn history_has_a_limit_and_keeps_what_was_chosen_while_it_is_there() {
    let mut history = History::default();
    history.receive(&table(1, "first"), 0.0);
    let first = history.chosen().expect("it was received").serial;
    history.receive(&table(2, "second"), 0.0);
    history.choose(first);
    assert_eq!(history.chosen().map(|build| build.revision), Some(1));
    for number in 3..3 + BUILDS_MAX as u64 {
        history.receive(&table(number, "more"), 0.0);
    }
    assert_eq!(history.newest_first().count(), BUILDS_MAX);
    assert_eq!(history.chosen().map(|build| build.revision), Some(2 + BUILDS_MAX as u64));
}

#[test]
fn click_on_a_build_shows_its_actions_and_reasons() {
    let mut state = state();
    let mut old = table(6, "old.wgsl");
    let action = |name: &str| kiln_link::ActionTime {
        name: name.to_owned(),
        wall_ms: 1.0,
        reason: format!("{name} changed"),
    };
    old.work.ran = vec![action("compile old")];
    let mut new = table(7, "new.wgsl");
    new.work.ran = vec![action("compile new")];
    state.receive(&old, 1016.0);
    state.receive(&new, 1016.0);
    let mut harness = harness(state);
    assert!(harness.query_by_label("compile new changed").is_some());
    assert!(harness.query_by_label("compile old changed").is_none());
    harness.get_by_label("revision 6").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("compile old changed").is_some());
}

#[test]
fn camera_is_kept_under_a_number_for_its_scene() {
    let mut state = state();
    state.view.camera = Some(crate::OrbitCamera::BACKGROUND_ONLY);
    let mut harness = harness(state);
    harness.get_by_label("Keep view").click();
    harness.run_steps(3);
    harness.state_mut().view.camera = None;
    harness.run_steps(3);
    harness.get_by_label("view 1").click();
    harness.run_steps(3);
    assert_eq!(harness.state().view.camera, Some(crate::OrbitCamera::BACKGROUND_ONLY));
    harness.state_mut().report.shown.scene = Some("car".to_owned());
    harness.run_steps(3);
    assert!(harness.query_by_label("view 1").is_none(), "it belongs to the other scene");
}
