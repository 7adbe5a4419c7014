//! Parameters that a shader's author offers, changed while one looks.

use std::str::FromStr as _;

use super::fixture::{Build, gpu};
use crate::{Assignment, HeadlessViewer};

/// A tonemap whose picture is its parameters.
const SHADER: &str = "
struct Params {
    level: f32,  // @slider(0, 1, 0.25) how red
    steps: u32,  // @slider(0, 4, 2)
    tint: vec4f, // @color(0.5, 1.0, 0.0)
    mode: u32,   // @choice(0, flat, doubled)
    is_on: u32,  // @toggle(true)
}
@group(3) @binding(0) var<uniform> params: Params;
override gain: f32 = 1.0; // @slider(0, 2)
@id(7) override is_bright: bool = true; // @toggle(true)
@vertex fn vs_main(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn fs_main() -> @location(0) vec4f {
    let red = params.level * gain * f32(params.mode + 1u);
    return vec4f(red, f32(params.steps) * 0.25 * params.tint.x, params.tint.w * f32(params.is_on) * select(0.0, 1.0, is_bright), 1.0);
}";

const FIRST: [u8; 4] = [64, 64, 255, 255];

fn viewer() -> Option<(HeadlessViewer, Build)> {
    let mut viewer = HeadlessViewer::new(gpu()?, [8, 8]);
    let mut build = Build::new();
    build.shaders(&[&[]]).env("sky", [[0.25; 3]; 6]).shader_text("tonemap", "tonemap", SHADER);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics, vec![]);
    Some((viewer, build))
}

fn assign(viewer: &mut HeadlessViewer, text: &str) -> Result<(), String> {
    let assignment = Assignment::from_str(text)?;
    let report = viewer.assign(&[assignment]).map_err(|refused| refused.to_string())?;
    report.diagnostics.first().map_or(Ok(()), |diagnostic| Err(diagnostic.to_string()))
}

fn pixel(viewer: &mut HeadlessViewer) -> [u8; 4] {
    viewer.render().expect("the device reads back").get_pixel(4, 4).0
}

#[test]
fn parameters_start_at_the_values_of_their_annotations() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    assert_eq!(pixel(&mut viewer), FIRST);
    build.shader_text("tonemap", "tonemap", &SHADER.replace("0.25)", "0.75)"));
    viewer.apply(&build.revision());
    assert_eq!(pixel(&mut viewer), [191, 64, 255, 255]);
}

#[test]
fn every_kind_of_parameter_changes_the_picture_at_once() {
    let cases = [
        ("level=0.75", [191, 64, 255, 255]),
        ("tonemap.steps=4", [64, 128, 255, 255]),
        ("tint=1,0,0", [64, 128, 255, 255]),
        ("mode=doubled", [128, 64, 255, 255]),
        ("is_on=false", [64, 64, 0, 255]),
        ("is_bright=false", [64, 64, 0, 255]),
        ("gain=2", [128, 64, 255, 255]),
        ("gain = 0", [0, 64, 255, 255]),
    ];
    for (text, expected) in cases {
        let Some((mut viewer, _)) = viewer() else { return };
        assert_eq!(pixel(&mut viewer), FIRST);
        assign(&mut viewer, text).expect(text);
        assert_eq!(pixel(&mut viewer), expected, "{text}");
    }
}

#[test]
fn members_change_without_anything_made_anew() {
    let Some((mut viewer, _)) = viewer() else { return };
    let level = Assignment::from_str("level=0.75").expect("it is well formed");
    let made = |report: crate::ApplyReport| report.made;
    // The report is the one of the first revision: nothing was prepared again.
    let first = made(viewer.assign(&[]).expect("nothing is refused"));
    assert!(!first.is_empty());
    assert_eq!(made(viewer.assign(&[level]).expect("it exists")), first);
    let gain = Assignment::from_str("gain=2").expect("it is well formed");
    assert_eq!(made(viewer.assign(&[gain]).expect("it exists")), Vec::<String>::new(), "pipelines alone");
}

#[test]
fn values_survive_a_reload_while_name_and_type_exist() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    assign(&mut viewer, "level=0.75").expect("it exists");
    assign(&mut viewer, "gain=0.5").expect("it exists");
    assign(&mut viewer, "steps=4").expect("it exists");
    let mut reload = |from: &str, to: &str| {
        let text = SHADER.replace(from, to);
        assert_ne!(text, SHADER);
        viewer.apply(&build.shader_text("tonemap", "tonemap", &text).revision());
        pixel(&mut viewer)
    };
    assert_eq!(
        reload("1.0);\n}", "0.9);\n}"),
        [96, 128, 255, 230],
        "another shader with the same parameters"
    );
    assert_eq!(
        reload("f32,  // @slider(0, 1,", "f32,  // @slider(0, 0.5,"),
        [64, 128, 255, 255],
        "within its new bounds"
    );
    let signed = reload("steps: u32", "steps: i32");
    assert_eq!(signed, [96, 64, 255, 255], "another type begins anew");
    assert_eq!(reload("level: f32,  // @slider(0, 1, 0.25)", "level: f32,  // @toggle(false)")[0], 128);
    // What came back has its value again.
    assert_eq!(reload("how red", "how very red"), [96, 128, 255, 255]);
}

#[test]
fn reset_restores_the_first_value() {
    let Some((mut viewer, build)) = viewer() else { return };
    assign(&mut viewer, "level=0.75").expect("it exists");
    assign(&mut viewer, "gain=0.5").expect("it exists");
    for parameter in viewer.apply(&build.revision()).parameters {
        viewer.view.parameters.reset(&parameter);
    }
    viewer.apply(&build.revision());
    assert_eq!(pixel(&mut viewer), FIRST);
}

#[test]
fn what_no_parameter_takes_is_refused_by_name() {
    let cases = [
        (
            "levle=1",
            "no shader that is shown has a parameter `levle`; there are tonemap.level, tonemap.steps",
        ),
        ("pbr.level=1", "no shader `pbr` that is shown has a parameter `level`"),
        ("level=1,2", "`tonemap.level` is a f32 and takes 1 number; 2 are given"),
        ("tint=1", "`tonemap.tint` is a vec4<f32> and takes 3 numbers; 1 are given"),
        ("level=high", "`tonemap.level` is a f32 from 0 to 1; `high` is none"),
        ("level=3", "`tonemap.level` is a f32 from 0 to 1; 3 is none"),
        ("level=NaN", "`NaN` is none"),
        ("steps=1.5", "`tonemap.steps` is a u32 from 0 to 4; 1.5 is none"),
        ("mode=round", "`tonemap.mode` is one of flat, doubled; `round` is none"),
        ("is_on=2", "`tonemap.is_on` is true or false; 2 is none"),
        ("level", "write it as name=0.5"),
        ("=1", "write it as name=0.5"),
    ];
    for (text, expected) in cases {
        let Some((mut viewer, _)) = viewer() else { return };
        let refused = assign(&mut viewer, text).expect_err(text);
        assert!(refused.contains(expected), "{text}: {refused}");
        assert_eq!(pixel(&mut viewer), FIRST, "{text}");
    }
}

#[test]
fn override_that_the_device_refuses_keeps_the_last_picture_and_says_so() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    let parts = "override parts: u32 = 4u; // @slider(0, 8)\nconst gain = 1.0;";
    let text = SHADER.replace("override gain: f32 = 1.0; // @slider(0, 2)", parts);
    let text = text.replace("params.level * gain", "params.level * gain * f32(4u / parts)");
    let report = viewer.apply(&build.shader_text("tonemap", "tonemap", &text).revision());
    assert_eq!(report.diagnostics, vec![]);
    assign(&mut viewer, "parts=2").expect("half is possible");
    assert_eq!(pixel(&mut viewer)[0], 128);
    let refused = assign(&mut viewer, "parts=0").expect_err("nothing can be divided by 0");
    assert!(refused.contains("does not accept `shader/tonemap/base`"), "{refused}");
    assert!(refused.contains("parts = 0"), "{refused}");
    assert_eq!(pixel(&mut viewer)[0], 128);
    assert_eq!(viewer.gpu().take_errors(), Vec::<String>::new());
    assign(&mut viewer, "parts=1").expect("it is possible again");
    assert_eq!(pixel(&mut viewer)[0], 255);
}

#[test]
fn annotation_that_does_not_suit_its_type_is_noted() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    let text = SHADER.replace("@slider(0, 1, 0.25)", "@color(1, 0, 0)");
    let report = viewer.apply(&build.shader_text("tonemap", "tonemap", &text).revision());
    let wanted = "`level` of shader `tonemap` is a f32, which its annotation cannot change";
    assert!(report.notes.iter().any(|note| note == wanted), "{:?}", report.notes);
    assert!(report.parameters.iter().all(|parameter| parameter.name != "level"));
}
