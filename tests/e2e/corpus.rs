//! Real files that nobody of this project made, read in place from `KILN_CORPUS`.

use std::path::PathBuf;

use serde_json::Value;

use crate::harness::{Project, text};

const PANORAMAS: [&str; 4] = ["hdr/polyhaven-bevy", "hdr/polyhaven-pmndrs", "hdr/nvpro", "exr/pmndrs-npm"];
const SCENES: [(&str, &str); 6] = [
    ("ToyCar", "ToyCar/glTF/ToyCar.gltf"),
    ("ClearCoatTest", "ClearCoatTest/glTF/ClearCoatTest.gltf"),
    ("SheenCloth", "SheenCloth/glTF/SheenCloth.gltf"),
    ("UnlitTest", "UnlitTest/glTF/UnlitTest.gltf"),
    ("Spheres", "MetalRoughSpheresNoTextures/glTF-Binary/MetalRoughSpheresNoTextures.glb"),
    ("Fox", "Fox/glTF/Fox.gltf"),
];

/// The corpus, or a loud word that it is not there.
pub fn corpus(test: &str) -> Option<PathBuf> {
    let corpus = std::env::var_os("KILN_CORPUS").map(PathBuf::from);
    if corpus.is_none() {
        eprintln!("SKIPPED: {test}: KILN_CORPUS is not set");
    }
    corpus
}

/// A sample project that sees the corpus through a link and asks for what `toml` says.
pub fn project_on(corpus: &PathBuf, toml: &str) -> Project {
    let project = Project::sample();
    std::os::unix::fs::symlink(corpus, project.path("corpus")).unwrap();
    let shaders = ["pbr", "background", "tonemap"]
        .map(|name| format!("[shader.{name}]\nsource = \"shaders/pbr/{name}.wgsl\"\n"))
        .concat();
    project.write("kiln.toml", format!("version = 1\n{toml}{shaders}"));
    project
}

#[test]
fn every_panorama_bakes() {
    let Some(corpus) = corpus("every_panorama_bakes") else { return };
    let mut toml = String::new();
    let mut count = 0;
    for folder in PANORAMAS {
        for entry in corpus.join(folder).read_dir().unwrap() {
            let file = entry.unwrap().file_name().into_string().unwrap();
            if file.ends_with(".hdr") || file.ends_with(".exr") {
                count += 1;
                toml += &format!("[env.e{count}]\nsource = \"corpus/{folder}/{file}\"\nsize = 32\n");
            }
        }
    }
    assert!(count >= 15, "only {count} panoramas");
    let (code, report) = project_on(&corpus, &toml).bake();
    assert_eq!(code, 0, "{:#}", report["diagnostics"]);
    let targets = report["targets"].as_object().unwrap();
    let specular = targets.keys().filter(|name| name.ends_with("/specular")).count();
    assert_eq!(specular, count);
}

#[test]
fn every_named_scene_is_packed_and_drawn() {
    let Some(corpus) = corpus("every_named_scene_is_packed_and_drawn") else { return };
    let mut toml = "[env.room]\nsource = \"environments/studio.hdr\"\nsize = 32\n".to_owned();
    for (name, path) in SCENES {
        toml += &format!("[scene.{name}]\nsource = \"corpus/gltf/khronos-sample-assets/{path}\"\n");
    }
    let project = project_on(&corpus, &toml);
    let (code, report) = project.bake();
    assert_eq!(code, 0, "{:#}", report["diagnostics"]);
    for (name, _) in SCENES {
        assert_eq!(report["targets"][format!("scene/{name}")]["state"], "fresh", "{name}");
    }
    if cfg!(feature = "preview") {
        let watch = project.watch();
        watch.published();
        SCENES.iter().for_each(|(name, _)| draw(&project, name));
    }
}

fn draw(project: &Project, scene: &str) {
    let out = project.beside(scene);
    let mut command =
        project.command(&["preview", "DIR", "--headless", "--size", "64x36", "--scene", scene, "--out"]);
    let output = command.arg(&out).output().unwrap();
    let said = text(&output.stderr);
    if said.contains("mesa-vulkan-drivers") {
        return crate::harness::skip("every_named_scene_is_packed_and_drawn", "there is no graphics device");
    }
    assert!(output.status.success(), "{scene}: {said}");
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    let errors = report["diagnostics"].as_array().unwrap().iter().filter(|one| one["severity"] == "error");
    assert_eq!(errors.count(), 0, "{scene}: {report:#}");
    let picture = image::open(out.join("frame_0001.png")).unwrap().to_rgb8();
    let first = *picture.get_pixel(0, 0);
    assert!(picture.pixels().any(|pixel| *pixel != first), "{scene} shows nothing");
}
