//! Lights that ever shine are an effect of every lit material, others leave no trace.

use serde_json::{Value, json};

use super::build::File;
use super::{pack_alone, scene_of};
use crate::variant_name;

/// A triangle with this material under a light.
fn lit(material: Value, light: Value) -> File {
    let mut file = File::with_material(material);
    file.root["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    let lamp = json!({ "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } });
    file.root["nodes"].as_array_mut().unwrap().push(lamp);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    file
}

/// The variant that draws it, and how many lights its pack has.
#[track_caller]
fn demand(file: &File) -> (String, usize) {
    let packed = pack_alone(&file.bytes_of());
    let messages: Vec<String> = packed.diagnostics.iter().map(ToString::to_string).collect();
    assert!(packed.glb.is_some(), "{messages:#?}");
    (variant_name(&packed.effects[0].effects), packed.summary.lights)
}

#[track_caller]
fn check(light: Value, shines: bool) {
    let expected = if shines { ("punctual_lights".to_owned(), 1) } else { ("base".to_owned(), 0) };
    assert_eq!(demand(&lit(json!({}), light.clone())), expected, "{light}");
}

#[test]
fn light_counts_where_colour_intensity_range_and_cone_leave_something() {
    for kind in ["point", "spot", "directional"] {
        check(json!({ "type": kind }), true);
        check(json!({ "type": kind, "intensity": 0 }), false);
        check(json!({ "type": kind, "color": [0, 0, 0] }), false);
        check(json!({ "type": kind, "color": [0, 0, 0.01] }), true);
    }
    check(json!({ "type": "point", "range": 0.001 }), true);
    check(json!({ "type": "point", "range": 0 }), false);
    check(json!({ "type": "spot", "spot": { "outerConeAngle": 0 } }), false);
    check(json!({ "type": "spot", "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.2 } }), true);
}

#[test]
fn light_that_an_animation_turns_on_counts() {
    let animated = |property: &str, kind: &str, values: &[f32], light: Value| {
        let mut file = lit(json!({}), light);
        let input = file.accessor(&[0.0f32, 1.0].map(f32::to_le_bytes).concat(), 5126, 2, "SCALAR");
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let output = file.accessor(&bytes, 5126, 2, kind);
        let pointer = format!("/extensions/KHR_lights_punctual/lights/0/{property}");
        file.root["animations"] = json!([{
            "samplers": [{ "input": input, "output": output }],
            "channels": [{ "sampler": 0, "target": { "path": "pointer",
                "extensions": { "KHR_animation_pointer": { "pointer": pointer } } } }],
        }]);
        demand(&file)
    };
    let shines = ("punctual_lights".to_owned(), 1);
    let dark = ("base".to_owned(), 0);
    let off = || json!({ "type": "point", "intensity": 0 });
    assert_eq!(animated("intensity", "SCALAR", &[0.0, 5.0], off()), shines);
    assert_eq!(animated("intensity", "SCALAR", &[0.0, 0.0], off()), dark);
    assert_eq!(animated("color", "VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], off()), dark, "a colour times 0");
    let black = json!({ "type": "point", "color": [0, 0, 0] });
    assert_eq!(animated("color", "VEC3", &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], black), shines);
    let closed = json!({ "type": "spot", "spot": { "outerConeAngle": 0 } });
    assert_eq!(animated("spot/outerConeAngle", "SCALAR", &[0.0, 0.5], closed), shines);
}

#[test]
fn unlit_material_has_no_lights() {
    let unlit = json!({ "extensions": { "KHR_materials_unlit": {} } });
    assert_eq!(demand(&lit(unlit, json!({ "type": "point" }))), ("unlit".to_owned(), 1));
}

#[test]
fn light_on_a_node_invisible_for_ever_does_not_count() {
    let mut file = lit(json!({}), json!({ "type": "point" }));
    file.root["nodes"][1]["extensions"]["KHR_node_visibility"] = json!({ "visible": false });
    assert_eq!(demand(&file), ("base".to_owned(), 0));
}

#[test]
fn light_without_effect_leaves_no_byte_in_the_pack() {
    let dark = pack_alone(&lit(json!({}), json!({ "type": "point", "intensity": 0 })).bytes());
    let mut none = lit(json!({}), json!({ "type": "point" }));
    none.root.as_object_mut().unwrap().remove("extensions");
    none.root["nodes"][1].as_object_mut().unwrap().remove("extensions");
    assert!(dark.glb == pack_alone(&none.bytes()).glb);
    let shining = pack_alone(&lit(json!({}), json!({ "type": "point" })).bytes());
    assert!(dark.glb != shining.glb, "the check sees a light");
}

#[test]
fn light_that_is_drawn_is_in_no_note() {
    let scene = scene_of(&lit(json!({}), json!({ "type": "point" })).bytes());
    assert_eq!((scene.lights.len(), scene.notes), (1, vec![]));
}
