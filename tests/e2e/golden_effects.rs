//! A golden frame for each effect that a material can call for, and its twin without the effect, which must be another.

use std::path::{Path, PathBuf};

use image::RgbImage;
use serde_json::{Value, json};

use crate::golden::{check, expected, is_within_tolerance};
use crate::harness::{Project, skip, text};

/// The effect, what its material has beside the base's, and the extensions of the material.
fn materials() -> Vec<(&'static str, Value, Value)> {
    let metal =
        json!({ "metallicFactor": 1.0, "roughnessFactor": 0.4, "baseColorFactor": [0.9, 0.85, 0.8, 1.0] });
    let clear =
        json!({ "metallicFactor": 0.0, "roughnessFactor": 0.05, "baseColorFactor": [1.0, 1.0, 1.0, 1.0] });
    let matte =
        json!({ "metallicFactor": 0.0, "roughnessFactor": 0.7, "baseColorFactor": [0.5, 0.1, 0.08, 1.0] });
    let through = json!({ "transmissionFactor": 1.0 });
    let medium =
        json!({ "thicknessFactor": 1.2, "attenuationColor": [0.3, 0.7, 0.9], "attenuationDistance": 0.8 });
    let of = |pbr: &Value| json!({ "pbrMetallicRoughness": pbr });
    let none = json!({});
    vec![
        (
            "clearcoat",
            of(&matte),
            json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.05 } }),
        ),
        (
            "sheen",
            of(&matte),
            json!({ "KHR_materials_sheen": { "sheenColorFactor": [0.3, 0.5, 0.9], "sheenRoughnessFactor": 0.4 } }),
        ),
        ("transmission", of(&clear), json!({ "KHR_materials_transmission": through })),
        (
            "volume",
            of(&clear),
            json!({ "KHR_materials_transmission": through, "KHR_materials_volume": medium }),
        ),
        (
            "dispersion",
            of(&clear),
            json!({ "KHR_materials_transmission": through, "KHR_materials_volume": { "thicknessFactor": 1.2 },
                "KHR_materials_dispersion": { "dispersion": 8.0 } }),
        ),
        (
            "iridescence",
            of(&metal),
            json!({ "KHR_materials_iridescence": { "iridescenceFactor": 1.0, "iridescenceIor": 1.6 } }),
        ),
        ("anisotropy", of(&metal), json!({ "KHR_materials_anisotropy": { "anisotropyStrength": 0.9 } })),
        (
            "diffuse_transmission",
            of(&matte),
            json!({ "KHR_materials_diffuse_transmission": {
                "diffuseTransmissionFactor": 0.9, "diffuseTransmissionColorFactor": [0.9, 0.7, 0.3] } }),
        ),
        (
            "specular",
            of(&matte),
            json!({ "KHR_materials_specular": { "specularFactor": 0.6, "specularColorFactor": [0.2, 2.0, 0.2] } }),
        ),
        ("unlit", of(&matte), json!({ "KHR_materials_unlit": {} })),
        ("emission", with(of(&matte), "emissiveFactor", json!([0.1, 0.3, 0.6])), none.clone()),
        ("occlusion", with(of(&matte), "occlusionTexture", json!({ "index": 2 })), none.clone()),
        ("normal_map", with(of(&metal), "normalTexture", json!({ "index": 1 })), none.clone()),
        (
            "alpha_blend",
            json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.4, 0.8, 0.4] } }),
            none.clone(),
        ),
        ("punctual_lights", of(&matte), none),
    ]
}

fn with(mut object: Value, key: &str, value: Value) -> Value {
    object[key] = value;
    object
}

/// The sample with a scene of one ball for each effect, named as the effect is.
fn project() -> Project {
    let project = Project::sample();
    let sample: Value = serde_json::from_str(&project.read("scenes/material_balls.gltf")).unwrap();
    let mut toml = project.read("kiln.toml");
    for (effect, material, extensions) in materials() {
        let mut scene = sample.clone();
        let ball = scene["nodes"].as_array().unwrap().iter().position(|node| node["name"] == "car paint");
        let named =
            scene["materials"].as_array().unwrap().iter().position(|it| it["name"] == "car_paint").unwrap();
        scene["scenes"] = json!([{ "nodes": [ball.unwrap()] }]);
        let names: Vec<&String> = extensions.as_object().unwrap().keys().collect();
        scene["extensionsUsed"] = json!(names);
        scene["materials"][named] = with(material, "extensions", extensions.clone());
        if effect == "punctual_lights" {
            let lamp = json!({ "type": "point", "intensity": 60.0, "color": [1.0, 0.6, 0.2] });
            scene["extensions"] = json!({ "KHR_lights_punctual": { "lights": [lamp] } });
            scene["extensionsUsed"] = json!(["KHR_lights_punctual"]);
            let node = json!({ "translation": [2.0, 2.5, 4.0], "extensions": { "KHR_lights_punctual": { "light": 0 } } });
            scene["nodes"].as_array_mut().unwrap().push(node);
            let count = scene["nodes"].as_array().unwrap().len();
            scene["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(count - 1));
        }
        let file = format!("scenes/{effect}.gltf");
        project.write(&file, scene.to_string());
        toml += &format!("\n[scene.{effect}]\nsource = \"{file}\"\nenv = \"studio\"\nshader = \"pbr\"\n");
    }
    project.write("kiln.toml", toml);
    project
}

/// Draws every scene; the adapter, or `None` without one.
fn draw(project: &Project, out: &Path) -> Option<String> {
    let mut command =
        project.command(&["render", "DIR", "--scene", "all", "--size", "192x108", "--json", "--out"]);
    let output = command.arg(out).output().unwrap();
    let said = text(&output.stderr);
    if said.contains("mesa-vulkan-drivers") {
        skip("golden frames of effects", "there is no graphics device");
        return None;
    }
    assert!(output.status.success(), "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    Some(report["adapter"].as_str().unwrap().to_owned())
}

fn frame(out: &Path, effect: &str) -> RgbImage {
    let path: PathBuf = out.join(format!("{effect}-studio.png"));
    image::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8()
}

#[test]
fn each_effect_has_its_golden_frame_and_is_missed_where_it_is_forbidden() {
    let project = project();
    let out = project.beside("effects");
    let Some(adapter) = draw(&project, &out) else { return };
    for (effect, ..) in materials() {
        check(&format!("effect-{effect}"), &frame(&out, effect), &adapter);
    }
    let names: Vec<&str> = materials().iter().map(|(effect, ..)| *effect).collect();
    let toml = project.read("kiln.toml");
    project.write("kiln.toml", format!("{toml}\n[effects]\nforbid = {}\n", json!(names)));
    let without = project.beside("without");
    draw(&project, &without);
    for effect in names {
        let golden = expected(&format!("effect-{effect}"));
        let is_same = is_within_tolerance(&golden, &frame(&without, effect), &adapter);
        assert!(!is_same, "the frame of `{effect}` is that of its scene without it");
    }
}
