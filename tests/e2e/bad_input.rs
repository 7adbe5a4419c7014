//! Bad input: one clear diagnostic with file and place, exit code 1, the rest still built.

use crate::harness::{Project, actions_with, text};

/// Breaks a file of a fresh sample and bakes; returns what was said.
fn said_after(break_it: impl FnOnce(&Project)) -> (Project, String) {
    let project = Project::sample();
    break_it(&project);
    let output = project.run(&["bake", "DIR", "--keep-going"]);
    assert_eq!(output.status.code(), Some(1), "{}{}", text(&output.stdout), text(&output.stderr));
    (project, text(&output.stderr))
}

#[track_caller]
fn assert_one_error(said: &str, parts: &[&str]) {
    let errors = said.lines().filter(|line| line.starts_with("error:")).count();
    assert_eq!(errors, 1, "{said}");
    parts.iter().for_each(|part| assert!(said.contains(part), "`{part}` is not in:\n{said}"));
}

#[track_caller]
fn assert_rest_is_built(project: &Project, files: &[&str]) {
    files.iter().for_each(|file| assert!(project.path("baked").join(file).is_file(), "{file}"));
}

#[test]
fn missing_environment_is_named() {
    let (project, said) =
        said_after(|project| std::fs::remove_file(project.path("environments/sky.hdr")).unwrap());
    assert_one_error(&said, &["not found", "environments/sky.hdr", "`source` in kiln.toml"]);
    assert_rest_is_built(&project, &["env/studio/specular.ktx2", "scene/balls.glb"]);
    assert!(!project.path("baked/env/sky/specular.ktx2").exists());
}

#[test]
fn truncated_hdr_is_explained() {
    let (project, said) = said_after(|project| {
        let bytes = std::fs::read(project.path("environments/sky.hdr")).unwrap();
        project.write("environments/sky.hdr", &bytes[..bytes.len() / 2]);
    });
    assert_one_error(&said, &["environments/sky.hdr", "scanline"]);
    assert_rest_is_built(&project, &["env/studio/specular.ktx2", "shader/tonemap/base.wgsl"]);
}

#[test]
fn invalid_gltf_is_placed() {
    let (project, said) =
        said_after(|project| project.edit("scenes/material_balls.gltf", "\"asset\"", "\"asset\" oops"));
    assert_one_error(&said, &["scenes/material_balls.gltf:", "^"]);
    assert_rest_is_built(&project, &["env/sky/specular.ktx2"]);
}

#[test]
fn invalid_wgsl_is_placed_in_the_module_that_holds_it() {
    let (project, said) =
        said_after(|project| project.edit("shaders/pbr/tonemap.wgsl", "hdr_color,", "hdr_colour,"));
    assert_one_error(&said, &["shaders/pbr/tonemap.wgsl:", "hdr_colour", "^^^^^^^^^^"]);
    assert_rest_is_built(
        &project,
        &["env/sky/specular.ktx2", "scene/balls.glb", "shader/background/base.wgsl"],
    );
}

#[test]
fn unknown_key_gets_a_suggestion() {
    let (project, said) = said_after(|project| {
        project.edit(
            "kiln.toml",
            "source = \"environments/studio.hdr\"",
            "sorce = \"environments/studio.hdr\"",
        );
    });
    assert!(said.contains("unknown key `sorce`") && said.contains("did you mean `source`?"), "{said}");
    assert!(said.contains("kiln.toml:"), "{said}");
    assert_rest_is_built(&project, &["env/sky/specular.ktx2"]);
}

#[test]
fn toml_syntax_error_is_placed() {
    let (_, said) = said_after(|project| project.edit("kiln.toml", "version = 1", "version = = 1"));
    assert!(said.contains("kiln.toml:") && said.contains('^'), "{said}");
}

#[test]
fn broken_source_keeps_what_was_baked_before() {
    let project = Project::sample();
    project.bake();
    let good = std::fs::read(project.path("baked/env/sky/specular.ktx2")).unwrap();
    project.write("environments/sky.hdr", "this is no picture");
    let (code, report) = project.bake();
    assert_eq!((code, actions_with(&report, "failed")), (1, vec!["decode env/sky".to_owned()]));
    assert_eq!(report["targets"]["env/sky/specular"]["state"], "stale");
    assert_eq!(std::fs::read(project.path("baked/env/sky/specular.ktx2")).unwrap(), good);
}

#[test]
fn folder_without_a_project_and_folder_that_is_not_there() {
    let project = Project::sample();
    std::fs::create_dir(project.beside("empty")).unwrap();
    for (command, folder) in
        [("bake", "empty"), ("bake", "nowhere"), ("watch", "empty"), ("preview", "nowhere")]
    {
        if command == "preview" && !cfg!(feature = "preview") {
            continue;
        }
        let output = project.command(&[command]).arg(project.beside(folder)).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command} {folder}: {said}");
        assert!(said.contains(folder) && said.contains("kiln init"), "{command} {folder}: {said}");
    }
    assert_eq!(project.beside("empty").read_dir().unwrap().count(), 0, "nothing may be written there");
}

#[test]
fn init_refuses_a_folder_that_holds_something() {
    let project = Project::sample();
    let output = project.run(&["init", "DIR"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("not empty"));
}
