//! Packs are deterministic, minimal and fixed points.

use std::sync::Arc;

use kiln_diagnostic::Severity;
use serde_json::json;

use super::build::File;
use super::{pack_alone, shared};
use crate::{document, load, pack};

/// A file with much that must survive: textures, transforms, camera, light, mirrored instance, notes.
fn rich() -> Vec<u8> {
    let mut file = File::with_material(json!({
        "name": "paint",
        "normalTexture": {"index": 0, "scale": 0.7, "extensions": {"KHR_texture_transform": {"rotation": 0.3, "scale": [2, 3]}}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 1, "texCoord": 0}, "roughnessFactor": 0.1},
        "emissiveFactor": [0.3, 0.2, 0.1],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3.7},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.4, "anisotropyRotation": 0.3},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.9, "iridescenceIor": 1.8, "iridescenceThicknessMinimum": 120}}
    }))
    .texture([160, 120, 240, 255])
    .texture([9, 99, 199, 255])
    .texture([1, 2, 3, 4]);
    file.root["samplers"] = json!([{"wrapS": 33071, "magFilter": 9728}]);
    file.root["textures"][1]["sampler"] = json!(0);
    file.root["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}]);
    file.root["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 7.3, "color": [1, 0.9, 0.3]}]}});
    file.root["nodes"] = json!([
        {"mesh": 0, "rotation": [0.1, 0.2, 0.3, 0.9], "scale": [1.1, 1.2, -1.3], "children": [1, 2]},
        {"camera": 0, "translation": [0.1, 0.2, 0.3], "name": "main"},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    file.root["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": 0, "output": 0}],
    }]);
    file.bytes()
}

#[test]
fn packing_twice_gives_equal_bytes() {
    assert_eq!(pack_alone(&rich()).glb.unwrap(), pack_alone(&rich()).glb.unwrap());
}

#[test]
fn pack_of_a_pack_is_the_same_pack() {
    let first = pack_alone(&rich());
    let glb = first.glb.as_ref().unwrap();
    let second = pack("scenes/test.gltf", glb, &mut |_| None);
    let again = second.glb.as_ref().unwrap();
    assert!(again == glb, "{}", super::first_difference(again, glb));
    assert_eq!(second.effects, first.effects);
    assert_eq!(second.summary, first.summary);
    // Places where the source is at fault mean nothing in the pack.
    let notes = first.diagnostics.into_iter().filter(|it| it.severity != Severity::Warning);
    assert_eq!(second.diagnostics, notes.collect::<Vec<_>>());
}

#[test]
fn pack_check_notices_another_material_value() {
    let changed = String::from_utf8(rich()).unwrap().replacen("3.7", "3.8", 1);
    assert_ne!(pack_alone(changed.as_bytes()).glb, pack_alone(&rich()).glb);
}

#[test]
fn pack_keeps_what_is_drawn_and_has_nothing_to_say() {
    let packed = pack_alone(&rich());
    let scene = load(packed.glb.as_ref().unwrap()).unwrap();
    assert_eq!(packed.summary.cameras, ["main"]);
    assert_eq!((scene.images.len(), scene.textures.len(), scene.lights.len()), (2, 2, 1));
    super::check_within("emission", &scene.materials[0].emissive_factor, &[1.11, 0.74, 0.37], 1e-6);
    assert_eq!(scene.notes, Vec::<String>::new());
    assert!(packed.diagnostics.iter().all(|it| it.severity != Severity::Note), "{:?}", packed.diagnostics);
}

#[test]
fn pack_holds_only_attributes_that_something_reads() {
    let glb = pack_alone(&File::triangle().bytes()).glb.unwrap();
    let document = document::parse(&glb).unwrap();
    let attributes: Vec<&str> =
        document.root.meshes[0].primitives[0].attributes.keys().map(String::as_str).collect();
    assert_eq!(attributes, ["NORMAL", "POSITION"], "nothing reads the texture coordinates");
}

#[test]
fn pack_does_not_depend_on_how_data_is_referred_to() {
    let embedded = rich();
    let mut root: serde_json::Value = serde_json::from_slice(&embedded).unwrap();
    let uri = root["buffers"][0]["uri"].as_str().unwrap().to_owned();
    let bin = crate::uri::data_payload(&uri).unwrap();
    root["buffers"][0]["uri"] = json!("data/mesh.bin");
    let external = serde_json::to_vec(&root).unwrap();
    let packed = pack("scenes/test.gltf", &external, &mut |path| {
        assert_eq!(path, "scenes/data/mesh.bin");
        Some(shared(&bin))
    });
    assert_eq!(packed.glb, pack_alone(&embedded).glb);
}

#[test]
fn load_reads_any_self_contained_file_but_no_outside_one() {
    assert!(load(&rich()).is_ok());
    let mut root: serde_json::Value = serde_json::from_slice(&rich()).unwrap();
    root["buffers"][0]["uri"] = json!("mesh.bin");
    let error = load(&serde_json::to_vec(&root).unwrap()).unwrap_err();
    assert_eq!(error.pointer, "/buffers/0/uri");
}

#[test]
fn unused_image_is_neither_asked_for_nor_kept() {
    let mut root: serde_json::Value = serde_json::from_slice(&rich()).unwrap();
    root["images"][2] = json!({"uri": "unused.png"});
    let packed =
        pack("scenes/test.gltf", &serde_json::to_vec(&root).unwrap(), &mut |path| -> Option<Arc<[u8]>> {
            panic!("asked for {path}")
        });
    assert_eq!(packed.summary.images, 2);
}

/// A reader that nobody of this project wrote sees the same triangles in a pack.
#[test]
fn pack_is_read_alike_by_the_gltf_crate() {
    let glb = pack_alone(&File::triangle().bytes()).glb.unwrap();
    let other = gltf::Gltf::from_slice(&glb).unwrap();
    let primitive = other.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|buffer| (buffer.index() == 0).then_some(other.blob.as_deref().unwrap()));
    let corners: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let indices: Vec<usize> = match reader.read_indices() {
        Some(indices) => indices.into_u32().map(|index| index as usize).collect(),
        None => (0..corners.len()).collect(),
    };
    let theirs: Vec<[f32; 3]> = indices.iter().map(|&index| corners[index]).collect();
    let own = load(&glb).unwrap();
    let vertices = &own.primitives[0].vertices;
    let ours: Vec<[f32; 3]> =
        own.primitives[0].indices.iter().map(|&index| vertices[index as usize].position).collect();
    assert_eq!(ours, theirs);
    assert_eq!(ours.len(), 3);
}
