//! What is not as glTF 2.0 wants it is said at its place; the twin of each case is a file that says nothing.

use kiln_diagnostic::Severity;
use serde_json::{Value, json};

use super::build::File;
use super::{pack_alone, refusal};

/// Findings in a file, a line each.
fn findings(bytes: &[u8]) -> Vec<String> {
    let packed = pack_alone(bytes);
    assert!(packed.glb.is_some(), "{:?}", packed.diagnostics);
    let warnings = packed.diagnostics.iter().filter(|it| it.severity == Severity::Warning);
    warnings.map(|it| it.message.clone()).collect()
}

/// A triangle, an animated node, a skin and a camera, without a fault.
fn sound() -> File {
    let mut file = File::with_material(json!({"pbrMetallicRoughness": {"metallicFactor": 0.5}}));
    let times = file.accessor(&floats(&[0.0, 1.0]), 5126, 2, "SCALAR");
    let rotations = file.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]);
    let identity: [f32; 16] = std::array::from_fn(|at| if at % 5 == 0 { 1.0 } else { 0.0 });
    let matrices = file.floats(&[identity]);
    file.root["accessors"][0]["min"] = json!([0, 0, 0]);
    file.root["accessors"][0]["max"] = json!([2, 1, 0]);
    file.root["accessors"][times]["min"] = json!([0]);
    file.root["accessors"][times]["max"] = json!([1]);
    file.root["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "zfar": 9}}]);
    file.root["skins"] = json!([{"joints": [0], "inverseBindMatrices": matrices}]);
    file.root["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
        "samplers": [{"input": times, "output": rotations}],
    }]);
    file
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Breaks one value of a sound file and wants the first finding to begin like this.
#[track_caller]
fn check_said(pointer: &str, value: Value, wanted: &str) {
    let mut file = sound();
    match file.root.pointer_mut(pointer) {
        Some(place) => *place = value,
        None => {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            file.root.pointer_mut(parent).unwrap()[key] = value;
        }
    }
    let found = findings(&file.bytes());
    assert!(found.iter().any(|it| it.starts_with(wanted)), "{wanted} is not in {found:#?}");
}

#[test]
fn sound_file_has_no_findings() {
    assert_eq!(findings(&sound().bytes()), [""; 0]);
}

#[test]
fn wrong_values_are_said_at_their_place() {
    let metal = "/materials/0/pbrMetallicRoughness/metallicFactor";
    check_said(metal, json!(1.5), &format!("{metal}: 1.5 is out of range"));
    check_said("/bufferViews/0/target", json!(7), "/bufferViews/0/target: 7 is none of");
    check_said(
        "/cameras/0/perspective/zfar",
        json!(0.01),
        "/cameras/0/perspective: `zfar` 0.01 must be more",
    );
    check_said("/scenes/0/name", json!(42), "/scenes/0/name: it must be a text");
    check_said("/textures", json!([]), "/textures: it must not be empty");
    check_said(
        "/nodes/0/rotation",
        json!([0, 0, 0, 0.5]),
        "/nodes/0/rotation: a rotation must have length 1",
    );
    check_said(
        "/nodes/0/matrix",
        json!([1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "/nodes/0/matrix: the matrix is no translation",
    );
}

#[test]
fn references_into_nowhere_are_said_although_nothing_is_drawn_of_them() {
    check_said(
        "/animations/0/samplers/0/input",
        json!(99),
        "/animations/0/samplers/0/input: accessor 99 does not exist",
    );
    check_said("/animations/0/channels/0/sampler", json!(7), "/animations/0/channels/0/sampler: sampler 7");
    check_said("/skins/0/joints", json!([9]), "/skins/0/joints/0: 9 does not exist");
    check_said("/images", json!([{"bufferView": 99, "mimeType": "image/png"}]), "/images/0/bufferView: 99");
}

#[test]
fn animations_that_cannot_be_right_are_said() {
    let channel = json!({"sampler": 0, "target": {"node": 0, "path": "rotation"}});
    check_said(
        "/animations/0/channels",
        json!([channel, channel]),
        "/animations/0/channels/0/target: channel 1 moves the same",
    );
    check_said(
        "/animations/0/channels/0/target/path",
        json!("scale"),
        "/animations/0/channels/0/sampler: accessor 4: the values must be VEC3",
    );
    check_said(
        "/animations/0/samplers/0/interpolation",
        json!("CUBICSPLINE"),
        "/animations/0/channels/0/sampler: 2 values, 6 are needed for 2 times",
    );
    let mut file = sound();
    let times = file.accessor(&floats(&[1.0, 1.0]), 5126, 2, "SCALAR");
    file.root["animations"][0]["samplers"][0]["input"] = json!(times);
    let found = findings(&file.bytes());
    assert!(found.iter().any(|it| it.contains("time 1 s (number 1) does not come after 1 s")), "{found:#?}");
}

#[test]
fn misplaced_and_undeclared_extensions_are_said() {
    let extension = json!({"KHR_materials_unlit": {}});
    check_said("/nodes/0/extensions", extension, "/nodes/0/extensions/KHR_materials_unlit: `extensionsUsed`");
    let mut file = sound();
    file.root["extensionsUsed"] = json!(["KHR_materials_unlit"]);
    file.root["nodes"][0]["extensions"] = json!({"KHR_materials_unlit": {}});
    assert_eq!(
        findings(&file.bytes()),
        ["/nodes/0/extensions/KHR_materials_unlit: this extension has no meaning here and was ignored"]
    );
}

#[test]
fn key_that_occurs_twice_is_said() {
    let text = String::from_utf8(sound().bytes()).unwrap();
    let text = text.replacen("\"NORMAL\": 1", "\"NORMAL\": 1, \"NORMAL\": 1", 1);
    let place = "/meshes/0/primitives/0/attributes/NORMAL";
    assert_eq!(findings(text.as_bytes()), [format!("{place}: this key occurs twice; the last one counts")]);
}

#[test]
fn reserved_index_and_colours_out_of_range_are_noted() {
    let mut file = File::new();
    let positions: Vec<[f32; 3]> = (0..256).map(|at| [at as f32, (at % 2) as f32, 0.0]).collect();
    let (position, color) = (file.floats(&positions), file.floats(&[[2.0, 0.5, 0.5]; 256]));
    let indices = file.accessor(&[0, 1, 255], 5121, 3, "SCALAR");
    file.root["meshes"] = json!([{"primitives": [
        {"attributes": {"POSITION": position, "COLOR_0": color}, "indices": indices}
    ]}]);
    file.root["nodes"][0]["mesh"] = json!(0);
    let packed = pack_alone(&file.bytes());
    let said = packed.diagnostics.iter().map(|it| it.message.as_str()).collect::<Vec<_>>().join("\n");
    assert!(said.contains("/meshes/0/primitives/0/indices: 255 is reserved"), "{said}");
    assert!(said.contains("vertices have colours outside 0 to 1"), "{said}");
}

#[test]
fn wrong_type_names_its_json_pointer() {
    let mut file = sound();
    file.root["nodes"][0]["mesh"] = json!("first");
    assert!(refusal(&file.bytes()).contains("/nodes/0/mesh: not as the glTF schema wants it"));
    let mut file = sound();
    file.root["accessors"][1].as_object_mut().unwrap().remove("count");
    let message = refusal(&file.bytes());
    assert!(message.contains("/accessors/1: not as the glTF schema wants it"), "{message}");
}
