//! `kiln bake`: what runs, what is written, what is reused.

use serde_json::Value;

use crate::harness::{Project, actions_with};

#[test]
fn first_bake_makes_all_artefacts_and_the_second_runs_nothing() {
    let project = Project::sample();
    let (code, first) = project.bake();
    assert_eq!(code, 0, "{:#}", first["diagnostics"]);
    assert!(actions_with(&first, "reused").is_empty());
    for file in [
        "env/sky/skybox.ktx2",
        "env/sky/irradiance.ktx2",
        "env/sky/specular.ktx2",
        "env/sky/sh.json",
        "lut/ggx.ktx2",
        "scene/balls.glb",
        "shader/tonemap/base.wgsl",
        "manifest.json",
    ] {
        assert!(project.path("baked").join(file).is_file(), "{file}");
    }
    let (code, second) = project.bake();
    assert_eq!(code, 0);
    assert!(actions_with(&second, "ran").is_empty(), "{:?}", actions_with(&second, "ran"));
    assert_eq!(second["written"], Value::Array(Vec::new()));
}

#[test]
fn baked_textures_are_read_by_another_reader() {
    let project = Project::sample();
    project.bake();
    for (file, faces, levels) in
        [("env/sky/specular.ktx2", 6, 7), ("env/sky/skybox.ktx2", 6, 6), ("lut/ggx.ktx2", 1, 1)]
    {
        let bytes = std::fs::read(project.path("baked").join(file)).unwrap();
        let reader = ktx2::Reader::new(&bytes[..]).unwrap();
        let header = reader.header();
        assert_eq!((header.face_count, header.level_count), (faces, levels), "{file}");
        assert_eq!(reader.levels().count(), levels as usize);
    }
}

#[test]
fn manifest_holds_no_times_and_no_absolute_paths() {
    let projects = [Project::sample(), Project::sample()];
    let manifests = projects.each_ref().map(|project| {
        project.bake();
        project.read("baked/manifest.json")
    });
    assert_eq!(manifests[0], manifests[1]);
    let manifest: Value = serde_json::from_str(&manifests[0]).unwrap();
    let specular = &manifest["targets"]["env/sky/specular"];
    assert!(specular["facts"]["details"][1]["rms_bound"].as_f64().unwrap() < 1e-2, "{specular:#}");
    assert!(!manifests[0].contains(&*projects[0].dir().to_string_lossy()));
}

#[test]
fn bake_after_each_kind_of_edit_runs_only_what_it_affects() {
    let project = Project::sample();
    project.bake();
    let ran_after = |file: &str, from: &str, to: &str| {
        project.edit(file, from, to);
        let (code, report) = project.bake();
        assert_eq!(code, 0, "{:#}", report["diagnostics"]);
        actions_with(&report, "ran")
    };
    let tonemap = ran_after("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 0.9, 0.8)");
    assert_eq!(tonemap, ["compile shader/tonemap/base"]);
    let size = ran_after("kiln.toml", "# irradiance_size = 64", "irradiance_size = 32 #");
    assert_eq!(size, ["irradiance env/sky", "measure env/sky/irradiance"]);
    let scene = ran_after(
        "scenes/material_balls.gltf",
        "\"version\": \"2.0\"",
        "\"version\": \"2.0\", \"copyright\": \"me\"",
    );
    assert_eq!(scene, ["pack scene/balls"]);
    // Another picture under the same name: the effects stay, so no shader is compiled.
    let other =
        std::fs::read(project.path("scenes/textures/tiles_occlusion_roughness_metallic.png")).unwrap();
    project.write("scenes/textures/tiles_base_color.png", other);
    let (_, report) = project.bake();
    assert_eq!(actions_with(&report, "ran"), ["pack scene/balls"]);
}

#[test]
fn deleted_output_is_written_again_without_baking() {
    let project = Project::sample();
    project.bake();
    std::fs::remove_file(project.path("baked/env/sky/skybox.ktx2")).unwrap();
    let (_, report) = project.bake();
    assert!(actions_with(&report, "ran").is_empty());
    assert_eq!(report["written"], serde_json::json!(["env/sky/skybox.ktx2"]));
}
