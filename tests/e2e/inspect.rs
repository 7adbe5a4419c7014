//! Seeing inside frames with `kiln render`.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::harness::{Project, skip, text};

/// Runs `kiln render` into a folder; `None` without a graphics device.
fn render(project: &Project, out: &Path, more: &[&str]) -> Option<Output> {
    let small = ["render", "DIR", "--size", "96x54", "--env", "studio", "--json"];
    let output = project.command(&small).args(more).arg("--out").arg(out).output().unwrap();
    if text(&output.stderr).contains("mesa-vulkan-drivers") {
        skip("rendering", "there is no graphics device");
        return None;
    }
    Some(output)
}

#[test]
fn channels_and_pixels_are_rendered_and_leave_nothing_in_the_project() {
    let project = Project::sample();
    let out = project.beside("frames");
    let asked = ["--channel", "roughness", "--channel", "specular", "--probe", "48,27", "--mark-faults"];
    let Some(output) = render(&project, &out, &asked) else { return };
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let [roughness, specular] = report["pictures"].as_array().unwrap().as_slice() else { panic!("{report}") };
    for (picture, channel) in [(roughness, "roughness"), (specular, "specular")] {
        assert_eq!(picture["channel"], channel);
        assert!(out.join(format!("balls-studio-{channel}.png")).is_file());
        assert_eq!(picture["faults"]["nan"], 0, "{picture}");
        assert_eq!(picture["probe"]["channel"][0], channel);
    }
    let value = &roughness["probe"]["channel"][1];
    assert!(value.is_null() || (0.0..=1.0).contains(&value[0].as_f64().unwrap()), "{value}");
    assert!(specular["probe"]["radiance"][0].is_number() && roughness["probe"]["radiance"].is_null());
    let plan = project.run(&["plan", "DIR", "--json"]);
    assert!(!text(&plan.stdout).contains("inspect/"), "the plain plan knows nothing of it");
    let bake = project.run(&["bake", "DIR"]);
    assert!(bake.status.success(), "{}", text(&bake.stderr));
    let manifest = std::fs::read_to_string(project.dir().join("baked/manifest.json")).unwrap();
    assert!(manifest.contains("shader/pbr/") && !manifest.contains("inspect"), "neither does a bake");
}

#[test]
fn channel_that_the_scene_lacks_and_pixel_outside_are_refused() {
    let project = Project::sample();
    let out = project.beside("frames");
    let lacking = ["--channel", "transmission", "--param", "tone_mapper=agx"];
    let Some(output) = render(&project, &out, &lacking) else { return };
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.contains("no material of this scene has transmission or diffuse_transmission"), "{said}");
    let output = render(&project, &out, &["--probe", "96,0"]).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("outside of the picture"), "{}", text(&output.stderr));
    let output = render(&project, &out, &["--channel", "rough"]).unwrap();
    assert!(text(&output.stderr).contains("there is no channel `rough`"), "{}", text(&output.stderr));
}
