//! What is broken, absent or malformed never takes the picture away.

use kiln_link::Revision;
use serde_json::json;

use super::fixture::{Build, gpu};
use crate::{ApplyReport, HeadlessViewer, Selection};

fn viewer() -> Option<(HeadlessViewer, Build)> {
    let build = Build::ball(json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.4 } }));
    Some((HeadlessViewer::new(gpu()?, [64, 64]), build))
}

fn pixels(viewer: &mut HeadlessViewer) -> Vec<u8> {
    viewer.render().expect("the device reads back").into_raw()
}

/// Applies a good revision, then what `damage` makes of it: the picture must stay the same.
#[track_caller]
fn check_damage_keeps_pixels(damage: impl FnOnce(&mut Build)) -> Option<ApplyReport> {
    let (mut viewer, mut build) = viewer()?;
    let report = viewer.apply(&build.revision());
    assert_eq!((report.diagnostics, report.notes), (vec![], vec![]));
    let before = pixels(&mut viewer);
    build.table.number = 2;
    damage(&mut build);
    let report = viewer.apply(&build.revision());
    assert!(pixels(&mut viewer) == before, "the picture changed: {report:?}");
    assert_eq!(viewer.gpu().take_errors(), Vec::<String>::new());
    Some(report)
}

/// The one error's message and notes, after `damage`.
#[track_caller]
fn check_error(damage: impl FnOnce(&mut Build), expected: &str) {
    let Some(report) = check_damage_keeps_pixels(damage) else { return };
    assert_eq!(report.diagnostics.len(), 1, "{:?}", report.diagnostics);
    let text = report.diagnostics[0].to_string();
    assert!(text.contains(expected), "{text}");
}

const VERTEX: &str = "@vertex fn vs_main(@location(0) position: vec3f) -> @builtin(position) vec4f {
    return vec4f(position, 1.0);
}";

fn material_text(declarations: &str, color: &str) -> String {
    format!("{declarations}\n{VERTEX}\n@fragment fn fs_main() -> @location(0) vec4f {{ return {color}; }}")
}

#[test]
fn good_edit_changes_pixels() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    viewer.apply(&build.revision());
    let before = pixels(&mut viewer);
    let text = "@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
            return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
        }
        @fragment fn fs_main() -> @location(0) vec4f { return vec4f(0.1, 0.6, 0.2, 1.0); }";
    viewer.apply(&build.shader_text("background", "background", text).revision());
    assert!(pixels(&mut viewer) != before);
}

#[test]
fn text_that_is_not_wgsl_keeps_the_last_pixels() {
    check_error(
        |build| {
            let target = build.table.targets["shader/pbr/base"].clone();
            let reflection =
                build.revision().part("shader/pbr/base", "reflection").expect("it has one").to_vec();
            let parts = [("wgsl", b"fn vs_main( {".to_vec()), ("reflection", reflection)];
            build.target("shader/pbr/base", "shader", target.meta, &parts);
        },
        "does not accept `shader/pbr/base`",
    );
}

#[test]
fn interface_that_does_not_fit_the_text_keeps_the_last_pixels() {
    check_error(
        |build| {
            let revision = build.revision();
            let other = revision.part("shader/tonemap/base", "reflection").expect("it has one").to_vec();
            let wgsl = revision.part("shader/background/base", "wgsl").expect("it has one").to_vec();
            let meta = build.table.targets["shader/background/base"].meta.clone();
            build.target("shader/background/base", "shader", meta, &[("wgsl", wgsl), ("reflection", other)]);
        },
        "hdr_color",
    );
}

#[test]
fn unknown_names_are_refused_by_name() {
    let texture = "@group(0) @binding(0) var env_glow: texture_cube<f32>;";
    let sample = "textureLoad(normal_texture, vec2i(0), 0)";
    let cases = [
        (
            material_text(texture, "vec4f(vec2f(textureDimensions(env_glow)), 0.0, 1.0)"),
            "`env_glow`, which Kiln does not know",
        ),
        (
            material_text("@group(0) @binding(0) var normal_texture: texture_2d<f32>;", sample),
            "its group is 1",
        ),
        (
            material_text(
                "@group(1) @binding(0) var normal_texture: texture_2d<u32>;",
                "vec4f(textureLoad(normal_texture, vec2i(0), 0))",
            ),
            "something else than a texture_2d<f32>",
        ),
        (
            material_text(
                "struct F { mood: f32 }\n@group(0) @binding(0) var<uniform> frame: F;",
                "vec4f(frame.mood)",
            ),
            "`frame.mood`, which Kiln does not know",
        ),
        (
            material_text(
                "struct F { exposure: vec3f }\n@group(0) @binding(0) var<uniform> frame: F;",
                "vec4f(frame.exposure, 1.0)",
            ),
            "as vec3<f32>; it is a f32",
        ),
        (
            material_text("", "vec4f(1.0)")
                .replace("position: vec3f", "velocity: vec3f")
                .replace("vec4f(position", "vec4f(velocity"),
            "unknown vertex input `velocity`",
        ),
        (material_text("", "vec4f(1.0)").replace("fs_main", "main"), "no entry point `fs_main`"),
    ];
    for (text, expected) in cases {
        check_error(
            |build| {
                build.shader_text("pbr", "material", &text);
            },
            expected,
        );
    }
}

#[test]
fn padding_members_are_accepted() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    let text = material_text(
        "struct F { _pad: vec3f, exposure: f32 }\n@group(0) @binding(0) var<uniform> frame: F;",
        "vec4f(frame.exposure + frame._pad.x)",
    );
    let report = viewer.apply(&build.shader_text("pbr", "material", &text).revision());
    assert_eq!(report.diagnostics, vec![]);
}

#[test]
fn truncated_cube_level_keeps_the_last_pixels() {
    check_error(
        |build| {
            let mut parts = Vec::new();
            for (level, size) in [(0, 4), (1, 2), (2, 1)] {
                parts.push((
                    ["mip0", "mip1", "mip2"][level],
                    vec![0; 6 * size * size * 8 - usize::from(level == 1)],
                ));
            }
            let meta = build.table.targets["env/sky/specular"].meta.clone();
            build.target("env/sky/specular", "cube", meta, &parts);
        },
        "part `mip1` of `env/sky/specular` has 191 bytes, not 192",
    );
}

#[test]
fn hostile_cube_descriptions_are_refused_before_anything_is_allocated() {
    for (size, levels) in [(u32::MAX, 1), (0, 0), (4, 0), (4, 4), (1 << 20, 21)] {
        let meta = json!({ "size": size, "levels": levels, "format": "rgba16f" });
        check_error(
            |build| {
                build.target("env/sky/skybox", "cube", meta, &[]);
            },
            "`env/sky/skybox` has size",
        );
    }
    let meta = json!({ "size": 4, "levels": 3, "format": "rgb565" });
    check_error(
        |build| {
            build.target("env/sky/skybox", "cube", meta, &[]);
        },
        "is malformed",
    );
    check_error(
        |build| {
            build.target("env/sky/skybox", "scene", json!({}), &[]);
        },
        "is a `scene`, not a `cube`",
    );
}

#[test]
fn damaged_scene_keeps_the_last_pixels() {
    check_error(
        |build| {
            build.scene("ball", "sky", b"glTF is not this".to_vec());
        },
        "scene `ball` cannot be loaded",
    );
}

#[test]
fn environment_that_vanishes_keeps_its_last_pixels_and_a_note_says_so() {
    let removed = check_damage_keeps_pixels(|build| {
        let meta = json!({ "name": "test", "scenes": ["ball"], "envs": ["sky"] });
        build.target("project", "project", meta, &[]);
        build.table.targets.retain(|name, _| !name.starts_with("env/"));
    });
    let Some(report) = removed else { return };
    assert_eq!(report.notes.len(), 3, "{:?}", report.notes);
    assert!(report.notes[0].contains("`env/sky/skybox` is absent from revision 2: its last good form"));
}

#[test]
fn missing_environment_still_draws_with_a_note() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    build.table.targets.retain(|name, _| !name.starts_with("env/"));
    let report = viewer.apply(&build.revision());
    let picture = viewer.render().expect("the device reads back");
    assert!(picture.pixels().all(|pixel| pixel[0] > 10), "a neutral light stands in");
    assert!(report.diagnostics.is_empty(), "{report:?}");
    let Revision { table, .. } = build.env("other", [[1.0; 3]; 6]).revision();
    assert!(table.targets.contains_key("env/other/skybox"));
    let report = viewer.select(Selection { env: Some("sky".to_owned()), ..Selection::default() });
    assert!(report.notes.iter().any(|note| note.contains("no environment `sky`")), "{report:?}");
}

#[test]
fn missing_variant_is_drawn_without_its_effects() {
    let Some(gpu) = gpu() else { return };
    let coated = json!({
        "pbrMetallicRoughness": {},
        "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1.0 } },
    });
    let mut viewer = HeadlessViewer::new(gpu, [64, 64]);
    let report = viewer.apply(&Build::ball(coated).revision());
    let note = "`shader/pbr/clearcoat` is absent: what needs it is drawn without its effects";
    assert_eq!(report.notes, [note]);
}

#[test]
fn project_without_any_target_draws_black_and_says_what_is_missing() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = HeadlessViewer::new(gpu, [8, 8]);
    let report = viewer.apply(&Build::new().revision());
    assert!(report.notes.iter().any(|note| note.contains("no tonemap shader")), "{report:?}");
    assert_eq!(viewer.render().expect("the device reads back").get_pixel(4, 4).0, [0, 0, 0, 255]);
}

#[test]
fn equal_content_is_not_uploaded_twice() {
    let Some((mut viewer, mut build)) = viewer() else { return };
    assert_eq!(viewer.apply(&build.revision()).made.len(), 6, "a cube, a table, a scene, three shaders");
    build.table.number = 2;
    assert_eq!(viewer.apply(&build.revision()).made, Vec::<String>::new());
    let report = viewer.apply(&build.env("sky", [[0.25; 3]; 6]).revision());
    assert_eq!(report.made, ["env/sky/skybox"], "three equal maps are one cube");
}
