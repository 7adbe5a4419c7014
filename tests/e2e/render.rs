//! `kiln render` and `kiln diff`: pictures without a daemon, and what differs between them.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use crate::harness::{Project, kiln, skip, text};

const SMALL: [&str; 4] = ["render", "DIR", "--size", "96x54"];

/// Runs `kiln render` into a folder; `None` without a graphics device.
fn render(project: &Project, out: &Path, more: &[&str]) -> Option<Output> {
    let output = project.command(&SMALL).args(more).arg("--out").arg(out).output().unwrap();
    if text(&output.stderr).contains("mesa-vulkan-drivers") {
        skip("rendering", "there is no graphics device");
        return None;
    }
    Some(output)
}

fn diff(reference: &Path, test: &Path, more: &[&str]) -> Output {
    kiln().arg("diff").args([reference, test]).args(more).output().unwrap()
}

#[test]
fn picture_is_the_one_that_the_preview_shows() {
    let project = Project::sample();
    let out = project.beside("frames");
    let Some(output) = render(&project, &out, &["--env", "studio", "--exr"]) else { return };
    assert!(output.status.success(), "{}", text(&output.stderr));
    let watch = project.watch();
    watch.published();
    let shown = project.beside("shown");
    let mut preview =
        project.command(&["preview", "DIR", "--headless", "--size", "96x54", "--env", "studio"]);
    assert!(preview.arg("--out").arg(&shown).status().unwrap().success());
    let rendered = image::open(out.join("balls-studio.png")).unwrap().to_rgb8();
    assert!(rendered == image::open(shown.join("frame_0001.png")).unwrap().to_rgb8());
    // The radiance goes through the same curve, rounded to half floats as the picture's was.
    let compared = diff(&out.join("balls-studio.exr"), &out.join("balls-studio.png"), &["--steps", "1"]);
    assert_eq!(compared.status.code(), Some(0), "{}", text(&compared.stdout));
}

#[test]
fn every_scene_and_light_and_choice_is_drawn_and_laid_out() {
    let project = Project::sample();
    let (out, sheet) = (project.beside("frames"), project.beside("sheet.png"));
    let more =
        ["--env", "all", "--vary", "tonemap.tone_mapper", "--json", "--sheet", sheet.to_str().unwrap()];
    let Some(output) = render(&project, &out, &more) else { return };
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["pictures"].as_array().unwrap().len(), 3 * 5);
    let sheet = image::open(&sheet).unwrap().to_rgb8();
    assert!(sheet.width() > 5 * 96 && sheet.height() > 3 * 54, "{:?}", sheet.dimensions());
}

#[test]
fn what_a_project_does_not_have_is_named_with_what_it_has() {
    let project = Project::sample();
    let out = project.beside("frames");
    for (more, expected) in [
        (["--scene", "bals"], "no scene `bals`\n  help: it has balls"),
        (["--env", "moon"], "no environment `moon`"),
        (["--camera", "Front"], "no camera `Front`"),
        (["--animation", "Walk"], "no animation `Walk`\n  help: it has none"),
        (["--material-variant", "red"], "no material variant `red`\n  help: it has none"),
        (
            ["--vary", "tone_maper"],
            "no shader in use offers `tone_maper`\n  help: to vary: tonemap.tone_mapper",
        ),
        (["--param", "tone_mapper=filmic"], "filmic"),
    ] {
        let Some(output) = render(&project, &out, &more) else { return };
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{more:?}: {said}");
        assert!(said.contains(expected), "{more:?}: {said}");
    }
}

#[test]
fn broken_shader_is_said_and_the_rest_is_drawn() {
    let project = Project::sample();
    project.edit("shaders/pbr/background.wgsl", "vec4f(", "vec5f(");
    let out = project.beside("frames");
    let Some(output) = render(&project, &out, &[]) else { return };
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.contains("background.wgsl") && said.contains("vec5f"), "{said}");
    assert!(out.join("balls-sky.png").is_file());
}

fn write(path: &Path, color: [u8; 3]) {
    image::RgbImage::from_pixel(40, 30, image::Rgb(color)).save(path).unwrap();
}

#[test]
fn diff_passes_what_is_alike_and_shows_what_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let [golden, actual, shown] = ["golden", "actual", "shown"].map(|name| folder.path().join(name));
    [&golden, &actual].into_iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    for name in ["same.png", "other.png", "lost.png"] {
        write(&golden.join(name), [90, 120, 150]);
    }
    write(&actual.join("same.png"), [90, 120, 150]);
    write(&actual.join("other.png"), [90, 160, 150]);
    let same = diff(&golden.join("same.png"), &actual.join("same.png"), &["--steps", "0", "--flip", "0"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stdout));
    let output = diff(&golden, &actual, &["--json", "--out", shown.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let verdicts: Vec<(&str, bool)> = report["pictures"]
        .as_array()
        .unwrap()
        .iter()
        .map(|picture| (picture["name"].as_str().unwrap(), picture["passes"].as_bool().unwrap()))
        .collect();
    assert_eq!(verdicts, [("lost.png", false), ("other.png", false), ("same.png", true)]);
    assert!(report["pictures"][0]["fault"].as_str().unwrap().contains("lost.png"));
    assert_eq!(report["pictures"][1]["found"]["difference_max"], 40);
    assert!(shown.join("other.png").is_file() && !shown.join("same.png").exists());
}

#[test]
fn diff_refuses_what_it_cannot_compare() {
    let folder = tempfile::tempdir().unwrap();
    let [small, text_file] = ["small.png", "notes.png"].map(|name| folder.path().join(name));
    write(&small, [1, 2, 3]);
    std::fs::write(&text_file, "no picture").unwrap();
    let large = folder.path().join("large.png");
    image::RgbImage::new(50, 50).save(&large).unwrap();
    for (reference, test, expected) in [
        (&small, &large, "one is 40x30 pixels, the other 50x50"),
        (&small, &text_file, "is no picture"),
        (&small, &folder.path().to_owned(), "not one of each"),
    ] {
        let output = diff(reference, test, &[]);
        let said = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn parameter_sheet_is_drawn_and_what_it_names_must_be_there() {
    let project = Project::sample();
    let out = project.beside("frames");
    let sheet = project.beside("sheet.json");
    let write = |env: &str| {
        let look = json!({ "selection": { "env": env }, "view": { "exposure_ev": 1.0 } });
        std::fs::write(&sheet, json!({ "kiln_look": 1, "size": [80, 45], "look": look }).to_string())
            .unwrap();
    };
    write("studio");
    let render =
        |more: &[&str]| project.command(&["render", "DIR", "--look"]).arg(&sheet).args(more).output();
    let output = render(&["--out", out.to_str().unwrap()]).unwrap();
    if text(&output.stderr).contains("mesa-vulkan-drivers") {
        return skip("rendering", "there is no graphics device");
    }
    assert!(output.status.success(), "{}", text(&output.stderr));
    let drawn = image::open(out.join("balls-studio.png")).unwrap().to_rgb8();
    assert_eq!(drawn.dimensions(), (80, 45));
    let other = project.beside("other");
    let same = ["render", "DIR", "--env", "studio", "--exposure", "1", "--size", "80x45", "--out"];
    assert!(project.command(&same).arg(&other).status().unwrap().success());
    assert!(drawn == image::open(other.join("balls-studio.png")).unwrap().to_rgb8());
    write("moon");
    let output = render(&[]).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("the environment `moon`"), "{}", text(&output.stderr));
    std::fs::write(&sheet, "{}").unwrap();
    let output = render(&[]).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no parameter sheet"), "{}", text(&output.stderr));
}
