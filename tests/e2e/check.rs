//! `kiln check`: what it says, how it ends, what may be allowed.

use serde_json::Value;

use crate::harness::{Project, text};

/// `kiln check --json` with these arguments: exit code and report.
fn check(project: &Project, arguments: &[&str]) -> (i32, Value) {
    let output = project.run(&[&["check", "--json"], arguments].concat());
    let report = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}{}", text(&output.stdout), text(&output.stderr)));
    (output.status.code().unwrap(), report)
}

fn subject<'a>(report: &'a Value, name: &str) -> &'a Value {
    let found = report["subjects"].as_array().unwrap().iter().find(|subject| subject["name"] == name);
    found.unwrap_or_else(|| panic!("{name} is not in {report:#}"))
}

/// Names of the checks that found something of at least a warning that is not allowed.
fn found(subject: &Value) -> Vec<&str> {
    let findings = subject["findings"].as_array().unwrap().iter();
    let counts = findings.filter(|it| it["severity"] != "note" && it["allowed"].is_null());
    counts.map(|finding| finding["check"].as_str().unwrap()).collect()
}

/// A panorama of 32 × 16 with one texel that is no light, as OpenEXR.
fn broken_exr() -> Vec<u8> {
    let mut rgb = vec![0.5; 32 * 16 * 3];
    rgb[(3 * 32 + 4) * 3] = f32::NAN;
    let image = kiln_image::Image::new(32, 16, rgb).unwrap();
    kiln_image::exr_write::encode_image(&image, kiln_image::Cancel::NEVER).unwrap()
}

#[test]
fn sample_project_is_sound_and_its_furnace_is_white() {
    let project = Project::sample();
    let page = project.beside("report.html");
    let (code, report) = check(&project, &["DIR", "--html", page.to_str().unwrap()]);
    assert_eq!((code, &report["ok"]), (0, &Value::Bool(true)), "{report:#}");
    let furnace = subject(&report, "furnace/pbr");
    let is_skipped = furnace["unchecked"].as_array().is_some_and(|unchecked| !unchecked.is_empty());
    assert!(!is_skipped || std::env::var_os("KILN_REQUIRE_GPU").is_none(), "{furnace:#}");
    assert_eq!(found(furnace), [""; 0], "{furnace:#}");
    for name in ["env/sky", "env/sky/specular", "env/sky/sh", "shader/pbr"] {
        assert!(!subject(&report, name)["facts"].as_array().unwrap().is_empty(), "{name}");
    }
    let page = std::fs::read_to_string(page).unwrap();
    assert!(
        page.contains("env/sky/specular")
            && page.contains("data:image/png;base64,")
            && !page.contains("<script")
    );
}

#[test]
fn shader_that_makes_light_fails_the_furnace_and_may_be_allowed() {
    let project = Project::sample();
    let (_, before) = check(&project, &["DIR"]);
    if subject(&before, "furnace/pbr")["unchecked"].as_array().is_some_and(|it| !it.is_empty()) {
        return;
    }
    let shader = project.read("shaders/lib/environment.wgsl");
    let from = "return textureSampleLevel(env_irradiance";
    assert!(shader.contains("fn irradiance_over_pi"), "{shader}");
    let start = shader.find("fn irradiance_over_pi").unwrap();
    let at = start + shader[start..].find("return ").unwrap_or_else(|| panic!("no {from}"));
    project.write(
        "shaders/lib/environment.wgsl",
        format!("{}return 1.2 * {}", &shader[..at], &shader[at + 7..]),
    );
    let (code, report) = check(&project, &["DIR"]);
    assert_eq!(code, 1, "{report:#}");
    assert!(found(subject(&report, "furnace/pbr")).contains(&"furnace"), "{report:#}");
    let allow =
        "[check]\nallow = [{ check = \"furnace\", target = \"furnace/*\", reason = \"a glow is wanted\" }]\n";
    project.edit("kiln.toml", "[check]\n", allow);
    let (code, report) = check(&project, &["DIR"]);
    assert_eq!(code, 0, "{report:#}");
    let furnace = subject(&report, "furnace/pbr");
    assert_eq!(furnace["findings"][0]["allowed"], "a glow is wanted", "{furnace:#}");
}

#[test]
fn nan_in_a_file_is_an_error_with_its_place() {
    let project = Project::sample();
    let file = project.beside("broken.exr");
    std::fs::write(&file, broken_exr()).unwrap();
    let (code, report) = check(&project, &[file.to_str().unwrap()]);
    assert_eq!(code, 1, "{report:#}");
    let finding = &report["subjects"][0]["findings"][0];
    assert_eq!(finding["check"], "non-finite", "{finding:#}");
    assert!(finding["places"][0].as_str().unwrap().contains("(4, 3)"), "{finding:#}");
    let output = project.run(&["check", file.to_str().unwrap(), "--no-furnace"]);
    assert!(text(&output.stdout).contains("error: 1 value is NaN [non-finite]"), "{}", text(&output.stdout));
}

#[test]
fn warnings_fail_where_they_are_denied() {
    let project = Project::sample();
    let file = project.beside("bright.hdr");
    let mut rgb = vec![0.5; 64 * 32 * 3];
    rgb[3000..3003].fill(1e5);
    let image = kiln_image::Image::new(64, 32, rgb).unwrap();
    std::fs::write(&file, kiln_image::hdr::encode(&image)).unwrap();
    let file = file.to_str().unwrap();
    assert_eq!(check(&project, &[file]).0, 0);
    let (code, report) = check(&project, &[file, "--deny", "warnings"]);
    assert_eq!((code, found(&report["subjects"][0])), (1, vec!["above-f16"]), "{report:#}");
}

#[test]
fn what_cannot_be_checked_is_named_with_the_reason() {
    let project = Project::sample();
    let file = project.beside("half.hdr");
    std::fs::write(&file, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n").unwrap();
    let (code, report) = check(&project, &[file.to_str().unwrap()]);
    assert_eq!((code, found(&report["subjects"][0])), (1, vec!["unreadable"]), "{report:#}");
    let (_, report) = check(&project, &["DIR", "--no-furnace"]);
    let reason = &subject(&report, "furnace/pbr")["unchecked"][0]["reason"];
    assert!(reason.as_str().unwrap().contains("--no-furnace"), "{reason}");
    let small = project.beside("small.exr");
    std::fs::write(&small, broken_exr()).unwrap();
    let (code, report) = check(&project, &[small.to_str().unwrap(), "--memory", "10kB"]);
    assert_eq!((code, found(&report["subjects"][0])), (1, vec!["unreadable"]), "{report:#}");
}

#[test]
fn allowance_without_a_known_check_or_a_reason_is_refused_with_the_names() {
    let project = Project::sample();
    let toml = project.read("kiln.toml");
    let refused = |allow: &str| {
        project.write("kiln.toml", toml.replace("[check]\n", &format!("[check]\nallow = [{allow}]\n")));
        let output = project.run(&["bake", "DIR"]);
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        text(&output.stderr) + &text(&output.stdout)
    };
    let said = refused("{ check = \"wrap-colum\", target = \"env/sky\", reason = \"x\" }");
    assert!(said.contains("none of") && said.contains("wrap-column") && said.contains("furnace"), "{said}");
    let said = refused("{ check = \"poles\", target = \"env/sky\" }");
    assert!(said.contains("reason"), "{said}");
    let said = refused("{ check = \"poles\", target = \"env/sky\", reason = \" \" }");
    assert!(said.contains("an allowance needs a reason"), "{said}");
}

#[test]
fn baked_file_is_checked_against_its_source() {
    let project = Project::sample();
    project.run(&["bake", "DIR"]);
    let map = project.path("baked/env/sky/specular.ktx2");
    let [map, sky, studio] =
        [map, project.path("environments/sky.hdr"), project.path("environments/studio.hdr")]
            .map(|path| path.to_str().unwrap().to_owned());
    let (code, report) = check(&project, &[&map, "--source", &sky]);
    assert_eq!(code, 0, "{report:#}");
    let (code, report) = check(&project, &[&map, "--source", &studio]);
    assert_eq!(code, 1, "{report:#}");
    assert!(found(&report["subjects"][0]).contains(&"mip-energy"), "{report:#}");
}
