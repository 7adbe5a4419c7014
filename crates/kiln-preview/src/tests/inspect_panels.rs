//! The panels that look into frames, driven as a user drives them.

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use kiln_scene::Effect;

use super::panels::{harness, state};
use crate::panel::PanelState;
use crate::{Channel, FaultCounts, Inspection, InspectionState, ListedMaterial, PassTime, PixelProbe};

fn state_that_inspects() -> PanelState {
    let mut state = state();
    state.report.inspection = Inspection {
        state: InspectionState::Ready,
        effects: [Effect::NormalMap].into(),
        variants: vec![("base".to_owned(), [0.8, 0.1, 0.1]), ("normal_map".to_owned(), [0.1, 0.1, 0.8])],
    };
    state
}

#[test]
fn channel_is_chosen_and_what_the_scene_lacks_is_grey() {
    let mut harness = harness(state_that_inspects());
    let open = |harness: &mut Harness<'_, PanelState>| {
        harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "channel").click();
        harness.run_steps(4);
    };
    open(&mut harness);
    assert!(harness.get_by_label("sheen light").accesskit_node().is_disabled());
    assert!(!harness.get_by_label("tangent").accesskit_node().is_disabled(), "normal maps have tangents");
    harness.get_by_label("base colour").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.channel, Some(Channel::BaseColor));
    harness.state_mut().view.channel = Some(Channel::Variant);
    harness.run_steps(4);
    assert!(harness.query_by_label("normal_map").is_some(), "the legend names variants");
    open(&mut harness);
    harness.get_by_role_and_label(egui::accesskit::Role::Button, "picture").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.channel, None);
}

#[test]
fn channel_that_cannot_be_shown_says_why_over_the_living_picture() {
    let mut state = state_that_inspects();
    state.view.channel = Some(Channel::Roughness);
    state.report.inspection.state = InspectionState::Unable("the shader knows nothing of it".to_owned());
    assert!(harness(state.clone()).query_by_label("Not shown: the shader knows nothing of it.").is_some());
    state.report.inspection.state = InspectionState::NotAsked;
    assert!(harness(state).query_by_label("Waiting for the shaders that show it.").is_some());
}

#[test]
fn marks_are_switched_on_and_counted_in_the_panel() {
    let mut harness = harness(state_that_inspects());
    harness.get_by_label("Mark faults").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.fault_limit, Some(65504.0));
    assert!(harness.query_by_label("NaN: 0 pixels").is_some());
    harness.state_mut().findings.faults = Some(FaultCounts { nan: 12, ..FaultCounts::default() });
    harness.run_steps(4);
    assert!(harness.query_by_label("NaN: 12 pixels").is_some());
    harness.get_by_label("Mark faults").click();
    harness.run_steps(4);
    assert_eq!(harness.state().view.fault_limit, None);
}

#[test]
fn pixel_and_pass_times_are_shown_in_words_of_the_trade() {
    let mut state = state_that_inspects();
    state.findings.probe = Some(PixelProbe {
        pixel: [640, 360],
        radiance: Some([0.5, 0.25, 12.5]),
        luminance: Some(0.18),
        ev_above_middle_grey: Some(1.0),
        channel: Some((Channel::Roughness, Some(vec![0.5]))),
        srgb: [255, 128, 0],
        depth: Some(0.75),
        position: Some([1.0, -2.0, 0.0]),
    });
    state.findings.pass_times = vec![PassTime { pass: "opaque".to_owned(), ms: 1.25 }];
    state.findings.frame_ms = Some(20.0);
    let harness = harness(state);
    let labels = [
        "640, 360",
        "0.5000  0.2500  12.50",
        "+1.00 EV",
        "255  128  0   #ff8000",
        "opaque",
        "1.25 ms",
        "20.0 ms",
    ];
    for label in labels {
        assert!(harness.query_by_label(label).is_some(), "`{label}` is not shown");
    }
}

#[test]
fn material_opens_to_its_variant_and_the_reasons_for_it() {
    let mut state = state();
    let why = "clearcoatFactor 0.5";
    state.report.materials = vec![ListedMaterial {
        name: "paint".to_owned(),
        variant: "clearcoat".to_owned(),
        draw_count: 2,
        effects: vec![(Effect::Clearcoat, why.to_owned())],
    }];
    let mut harness = harness(state);
    assert!(harness.query_by_label(why).is_none(), "it is closed");
    harness.get_by_label("paint").click();
    harness.run_steps(8);
    assert!(harness.query_by_label("variant clearcoat, 2 draws").is_some());
    assert!(harness.query_by_label(why).is_some());
}
