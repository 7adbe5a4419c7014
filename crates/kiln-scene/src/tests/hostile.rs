//! Broken and hostile files end in a message with a place.

use serde_json::json;

use super::build::File;
use super::{pack_alone, refusal};
use crate::{load, pack};

#[track_caller]
fn check_refused(bytes: &[u8], wanted: &[&str]) {
    let message = refusal(bytes);
    for wanted in wanted {
        assert!(message.contains(wanted), "{wanted:?} is not in:\n{message}");
    }
}

#[test]
fn invalid_json_shows_line_column_and_caret() {
    let text = "{\n  \"asset\": {\"version\": \"2.0\"},\n  \"nodes\": [oops]\n}\n";
    let packed = pack_alone(text.as_bytes());
    let span = packed.diagnostics[0].span.as_ref().unwrap();
    assert_eq!((span.line, span.source_line.as_str()), (3, "  \"nodes\": [oops]"));
    assert!(packed.diagnostics[0].message.starts_with("invalid JSON"), "{}", packed.diagnostics[0]);
}

#[test]
fn wrong_type_shows_the_line() {
    let text = "{\n\"asset\": {\"version\": \"2.0\"},\n\"scene\": \"first\"\n}\n";
    let packed = pack_alone(text.as_bytes());
    assert_eq!(packed.diagnostics[0].span.as_ref().unwrap().line, 3);
    check_refused(text.as_bytes(), &["not as the glTF schema wants it"]);
}

#[test]
fn fault_inside_a_table_points_at_the_table_entry() {
    let mut file = File::triangle();
    file.root["nodes"][0]["mesh"] = json!(7);
    let packed = pack_alone(&file.bytes());
    let diagnostic = &packed.diagnostics[0];
    assert_eq!(diagnostic.message, "/nodes/0/mesh: mesh 7 does not exist, the file has 1");
    assert!(diagnostic.span.as_ref().unwrap().source_line.contains("\"mesh\": 7"), "{diagnostic}");
}

#[test]
fn other_versions_are_refused_by_name() {
    check_refused(br#"{"asset": {"version": "1.0"}}"#, &["glTF 1.0 is not supported", "export it again"]);
    check_refused(br#"{"scenes": {}}"#, &["`asset` is missing"]);
    check_refused(b"glTF\x01\0\0\0\x14\0\0\0", &["GLB version 1"]);
}

#[test]
fn truncated_glb_is_refused_at_every_length() {
    let glb = pack_alone(&File::triangle().bytes()).glb.unwrap();
    for length in 0..glb.len() {
        assert!(load(&glb[..length]).is_err(), "{length} bytes");
    }
    assert!(load(&glb).is_ok());
}

#[test]
fn no_flipped_byte_of_a_glb_makes_it_panic() {
    let glb =
        pack_alone(&File::with_material(json!({"normalTexture": {"index": 0}})).texture([9; 4]).bytes())
            .glb
            .unwrap();
    let mut refused = 0;
    for at in 0..glb.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut broken = glb.clone();
            broken[at] ^= flip;
            refused += usize::from(pack("broken.glb", &broken, &mut |_| None).glb.is_none());
        }
    }
    assert!(refused > glb.len() / 4, "{refused}");
}

#[test]
fn required_extension_that_is_unknown_is_named() {
    let mut file = File::triangle();
    file.root["extensionsRequired"] = json!(["KHR_texture_transform", "KHR_draco_mesh_compression"]);
    check_refused(&file.bytes(), &["KHR_draco_mesh_compression", "without mesh compression"]);
}

#[test]
fn index_out_of_range_is_named() {
    let mut file = File::triangle();
    let indices = file.accessor(&[0, 1, 3], 5121, 3, "SCALAR");
    file.primitive()["indices"] = json!(indices);
    check_refused(
        &file.bytes(),
        &["/meshes/0/primitives/0/indices", "index 3 (number 2) is outside the 3 vertices"],
    );
}

#[test]
fn attributes_of_different_lengths_are_refused() {
    let mut file = File::triangle();
    let normals = file.floats(&[[0.0, 0.0, 1.0]; 2]);
    file.primitive()["attributes"]["NORMAL"] = json!(normals);
    check_refused(&file.bytes(), &["2 elements for 3 vertices"]);
}

#[test]
fn accessor_of_a_billion_zeros_is_refused_before_it_is_made() {
    let mut file = File::triangle();
    file.root["accessors"][0] = json!({"componentType": 5126, "count": 4_000_000_000u64, "type": "VEC3"});
    check_refused(&file.bytes(), &["exceed"]);
}

#[test]
fn accessor_past_its_buffer_view_is_refused() {
    for (field, value) in [("count", json!(4)), ("byteOffset", json!(8)), ("byteOffset", json!(u64::MAX))] {
        let mut file = File::triangle();
        file.root["accessors"][0][field] = value;
        check_refused(&file.bytes(), &["/accessors/0"]);
    }
}

#[test]
fn buffer_view_past_its_buffer_is_refused() {
    let mut file = File::triangle();
    file.root["bufferViews"][0]["byteOffset"] = json!(u64::MAX);
    check_refused(&file.bytes(), &["/bufferViews/0", "do not fit the buffer's"]);
}

#[test]
fn node_cycles_and_shared_children_are_refused() {
    let mut cycle = File::new();
    cycle.root["nodes"] = json!([{}, {"children": [2]}, {"children": [1]}]);
    check_refused(&cycle.bytes(), &["/nodes/1", "its own ancestor"]);
    let mut shared = File::new();
    shared.root["nodes"] = json!([{"children": [2]}, {"children": [2]}, {}]);
    check_refused(&shared.bytes(), &["/nodes/1/children/0", "two parents"]);
}

#[test]
fn deep_hierarchy_does_not_overflow_the_stack() {
    let mut file = File::triangle();
    let depth = 50_000;
    let mut nodes: Vec<_> = (1..depth).map(|child| json!({"children": [child]})).collect();
    nodes.push(json!({"mesh": 0}));
    file.root["nodes"] = json!(nodes);
    assert_eq!(pack_alone(&file.bytes()).summary.draws, 1);
}

#[test]
fn deep_json_is_an_error_and_no_overflow() {
    let (open, close) = ("[".repeat(1_000_000), "]".repeat(1_000_000));
    let text = format!("{{\"asset\": {{\"version\": \"2.0\", \"extras\": {open}{close}}}}}");
    check_refused(text.as_bytes(), &["recursion limit"]);
    check_refused(&text.as_bytes()[..text.len() / 2], &["invalid JSON"]);
}

#[test]
fn number_too_large_for_single_precision_is_refused_where_it_stands() {
    let mut file = File::with_material(json!({"emissiveFactor": [1e300, 0, 0]}));
    file.root["nodes"][0]["translation"] = json!([1, 2, 3]);
    let packed = pack_alone(&file.bytes());
    assert!(packed.diagnostics[0].message.contains("number out of range"), "{}", packed.diagnostics[0]);
    assert!(
        packed.diagnostics[0].span.as_ref().unwrap().source_line.contains("1e+300"),
        "{}",
        packed.diagnostics[0]
    );
}

#[test]
fn missing_buffer_is_an_error_that_names_it() {
    let mut file = File::triangle();
    let bin = File::triangle().bytes();
    let text = String::from_utf8(bin).unwrap();
    let length =
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["buffers"][0]["byteLength"].clone();
    let bytes = {
        let mut root: serde_json::Value =
            serde_json::from_slice(&std::mem::replace(&mut file, File::new()).bytes()).unwrap();
        root["buffers"] = json!([{"byteLength": length, "uri": "mesh%20data.bin"}]);
        serde_json::to_vec(&root).unwrap()
    };
    check_refused(&bytes, &["/buffers/0/uri", "`mesh%20data.bin` was not found", "scenes/mesh data.bin"]);
}

#[test]
fn missing_image_is_a_warning_and_the_scene_is_drawn() {
    let mut file = File::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.root["images"] = json!([{"uri": "wood.png"}]);
    file.root["textures"] = json!([{"source": 0}]);
    let packed = pack_alone(&file.bytes());
    assert!(packed.glb.is_some() && packed.summary.images == 0);
    let message = packed.diagnostics[0].to_string();
    assert!(message.starts_with("warning: /images/0/uri: `wood.png` was not found"), "{message}");
    assert!(message.contains("neutral texture"), "{message}");
}

#[test]
fn damaged_image_is_a_warning_too() {
    let mut file = File::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let view = file.view(b"\x89PNG\r\n\x1a\nnothing more");
    file.root["images"] = json!([{"bufferView": view}]);
    file.root["textures"] = json!([{"source": 0}]);
    let packed = pack_alone(&file.bytes());
    assert!(packed.glb.is_some());
    assert!(packed.diagnostics[0].message.contains("cannot be read"), "{}", packed.diagnostics[0]);
}
