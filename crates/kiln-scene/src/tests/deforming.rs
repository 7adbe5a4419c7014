//! What moves geometry: skins, morph targets, instances; when they are effects and when they are not.

use serde_json::{Value, json};

use super::build::File;
use super::motion::{animate, pointer, variant};
use super::{check_within, pack_alone, refusal, scene_of};
use crate::{Effect, EffectOverrides, Instance, MorphDelta, Scene, load};

/// A triangle that hangs on nodes 1 and 2, the second below the first; node 0 has the mesh and stands elsewhere.
pub(super) fn skinned() -> File {
    let mut file = File::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 5121, 3, "VEC4");
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]]);
    let primitive = file.primitive();
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    file.root["skins"] = json!([{"joints": [1, 2]}]);
    file.root["nodes"] = json!([
        {"name": "thing", "mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"name": "hip", "translation": [0, 10, 0], "children": [2]},
        {"name": "knee", "translation": [0, 0, 4]},
    ]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    file
}

fn moved(mut file: File, node: usize, to: [f32; 3]) -> File {
    let [x, y, z] = to;
    let from = [0.0, 0.0, 4.0];
    let values = [from, [x, y, z]].concat();
    animate(&mut file, json!({"node": node, "path": "translation"}), "LINEAR", &[0.0, 1.0], &values, "VEC3");
    file
}

/// A triangle with three targets along z, of which the first counts at rest.
pub(super) fn morphed() -> File {
    let mut file = File::triangle();
    let deltas = |height: f32| [[0.0, 0.0, 0.0], [0.0, 0.0, height], [0.0, 0.0, 0.0]];
    let targets = [8.0, 16.0, 32.0].map(|height| json!({"POSITION": file.floats(&deltas(height))}));
    file.primitive()["targets"] = json!(targets);
    file.root["meshes"][0]["weights"] = json!([0.5, 0, 0]);
    file
}

fn weighted(mut file: File, values: &[f32]) -> File {
    let times: Vec<f32> = (0..values.len() / 3).map(|at| at as f32).collect();
    animate(&mut file, json!({"node": 0, "path": "weights"}), "LINEAR", &times, values, "SCALAR");
    file
}

fn instanced(places: &[[f32; 3]], scales: &[[f32; 3]]) -> File {
    let mut file = File::triangle();
    let (translation, scale) = (file.floats(places), file.floats(scales));
    file.root["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation, "SCALE": scale}}});
    file
}

fn positions(scene: &Scene) -> Vec<[f32; 3]> {
    scene.primitives[0].vertices.iter().map(|vertex| vertex.position).collect()
}

#[test]
fn skin_is_an_effect_where_an_animation_really_moves_a_joint() {
    assert_eq!(variant(moved(skinned(), 2, [0.0, 1.0, 4.0])), "skin");
    assert_eq!(variant(moved(skinned(), 1, [0.0, 1.0, 4.0])), "skin", "what the joint hangs on");
    assert_eq!(variant(moved(skinned(), 2, [0.0, 0.0, 4.0])), "base", "the curve holds the rest value");
    assert_eq!(variant(skinned()), "base");
    let scene = scene_of(&moved(skinned(), 2, [0.0, 0.0, 4.0]).bytes());
    assert_eq!(positions(&scene), [[0.0, 10.0, 0.0], [2.0, 10.0, 4.0], [0.0, 11.0, 2.0]], "baked");
}

#[test]
fn rotation_of_either_sign_and_any_length_is_the_same_rotation() {
    let turned = |key: [f32; 4]| {
        let mut file = skinned();
        file.root["nodes"][2]["rotation"] = json!([0, 0.6, 0, 0.8]);
        animate(&mut file, json!({"node": 2, "path": "rotation"}), "LINEAR", &[0.0], &key, "VEC4");
        variant(file)
    };
    assert_eq!(turned([0.0, -0.6, 0.0, -0.8]), "base");
    assert_eq!(turned([0.0, 0.6, 0.0, 0.799_999]), "base");
    assert_eq!(turned([0.0, 0.61, 0.0, 0.79]), "skin");
}

#[test]
fn skinned_draw_stands_where_its_joints_do() {
    let scene = scene_of(&moved(skinned(), 2, [0.0, 1.0, 4.0]).bytes());
    let (draw, skin) = (&scene.draws[0], &scene.skins[0]);
    assert_eq!((draw.skin, draw.world), (Some(0), glam::Mat4::IDENTITY));
    let names: Vec<&str> = skin.joints.iter().map(|&joint| scene.nodes[joint].name.as_str()).collect();
    assert_eq!(names, ["hip", "knee"]);
    let influence = scene.primitives[0].influences[2];
    assert_eq!((influence.joints, influence.weights), ([0, 1, 0, 0], [0.5, 0.5, 0.0, 0.0]));
    let bounds = scene.bounds.unwrap();
    assert_eq!((bounds.min.to_array(), bounds.max.to_array()), ([0.0, 10.0, 0.0], [2.0, 11.0, 4.0]));
}

/// A skin that turns out not to be drawn leaves no nodes, and what hangs on its joints hangs where it moves.
#[test]
fn joints_of_what_is_not_drawn_are_not_kept() {
    let mut file = moved(skinned(), 1, [1.0, 0.0, 4.0]);
    let mesh = file.root["meshes"][0].clone();
    file.primitive()["mode"] = json!(1);
    file.root["meshes"].as_array_mut().unwrap().push(mesh);
    file.root["nodes"][2]["mesh"] = json!(1);
    let scene = scene_of(&file.bytes_of());
    let names: Vec<&str> = scene.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!((names, scene.skins.len()), (vec!["hip"], 0));
    assert_eq!((scene.carried.len(), scene.carried[0].node), (1, 0));
    assert_eq!(variant(file), "base");
}

#[test]
fn four_heaviest_of_eight_joints_count_and_that_is_said() {
    let file = |last: f32| {
        let mut file = skinned();
        let joints = [[0, 1, 2, 3]; 3].concat();
        let more = file.accessor(&joints.iter().map(|it| it + 4).collect::<Vec<u8>>(), 5121, 3, "VEC4");
        let joints = file.accessor(&joints, 5121, 3, "VEC4");
        let first = file.floats(&[[0.2, 0.3, last, 0.0]; 3]);
        let second = file.floats(&[[0.3, 0.2 - last, 0.0, 0.0]; 3]);
        let attributes = &mut file.primitive()["attributes"];
        for (name, index) in
            [("JOINTS_0", joints), ("WEIGHTS_0", first), ("JOINTS_1", more), ("WEIGHTS_1", second)]
        {
            attributes[name] = json!(index);
        }
        file.root["skins"] = json!([{"joints": [1, 2, 1, 2, 1, 2, 1, 2]}]);
        moved(file, 2, [1.0, 0.0, 4.0])
    };
    let scene = scene_of(&file(0.05).bytes());
    let influence = scene.primitives[0].influences[0];
    assert_eq!(influence.joints, [0, 1, 4, 5]);
    let wanted = [0.2, 0.3, 0.3, 0.15].map(|it: f32| it / 0.95);
    check_within("scaled", &influence.weights, &wanted, 1e-6);
    let said =
        |scene: &Scene| scene.notes.iter().any(|note| note.contains("3 vertices hang on more than four"));
    assert!(said(&scene), "{:?}", scene.notes);
    assert!(!said(&scene_of(&file(0.005).bytes())), "half a percent is lost without a word");
    assert_eq!(variant(file(0.05)), "skin");
}

#[test]
fn more_joints_than_a_byte_holds_are_kept() {
    let mut file = skinned();
    let joints: Vec<u8> = [299u16, 0, 0, 0].repeat(3).into_iter().flat_map(u16::to_le_bytes).collect();
    let joints = file.accessor(&joints, 5123, 3, "VEC4");
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0]; 3]);
    let attributes = &mut file.primitive()["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    let names: Vec<usize> = std::iter::repeat_n(1, 299).chain([2]).collect();
    file.root["skins"] = json!([{ "joints": names }]);
    let file = moved(file, 2, [1.0, 0.0, 4.0]);
    assert_eq!(scene_of(&file.bytes_of()).primitives[0].influences[0].joints[0], 299);
    assert_eq!(variant(file), "skin");
}

#[test]
fn skinned_mesh_that_an_animation_shows_is_hidden_at_rest() {
    let mut file = skinned();
    file.root["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    let (input, output) =
        (file.accessor(&0f32.to_le_bytes(), 5126, 1, "SCALAR"), file.accessor(&[1], 5121, 1, "SCALAR"));
    let target = pointer("/nodes/0/extensions/KHR_node_visibility/visible");
    file.root["animations"] = json!([{"channels": [{"sampler": 0, "target": target}],
        "samplers": [{"input": input, "output": output, "interpolation": "STEP"}]}]);
    let scene = scene_of(&file.bytes_of());
    assert_eq!((scene.draws.len(), scene.hidden.len(), scene.hidden[0].skin), (0, 1, Some(0)));
    assert!(!scene.pose(None, 0.0).hidden[0].visible);
    let posed = scene.pose(Some(0), 0.0);
    assert!(posed.hidden[0].visible && posed.hidden[0].world == glam::Mat4::IDENTITY);
    assert_eq!(variant(file), "skin");
}

#[test]
fn morph_is_an_effect_where_a_weight_changes() {
    assert_eq!(variant(weighted(morphed(), &[0.5, 0.0, 0.0, 0.5, 0.0, 1.0])), "morph");
    assert_eq!(variant(weighted(morphed(), &[0.5, 0.0, 0.0])), "base", "the curve holds the rest values");
    assert_eq!(variant(morphed()), "base");
    assert_eq!(positions(&scene_of(&morphed().bytes()))[1], [2.0, 0.0, 4.0], "baked");
    let mut flat = weighted(morphed(), &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let nothing = flat.floats(&[[0.0; 3]; 3]);
    flat.primitive()["targets"][2] = json!({ "POSITION": nothing });
    flat.root["meshes"][0]["weights"] = json!([0.25, 0, 0]);
    assert_eq!(variant(flat), "morph", "the first weight leaves its rest value");
    let mut flat = weighted(morphed(), &[0.5, 0.0, 0.0, 0.5, 0.0, 1.0]);
    let nothing = flat.floats(&[[0.0; 3]; 3]);
    flat.primitive()["targets"][2] = json!({ "POSITION": nothing });
    assert_eq!(variant(flat.clone()), "base", "the target whose weight changes adds nothing");
    assert_eq!(positions(&scene_of(&flat.bytes()))[1], [2.0, 0.0, 4.0], "so the others are baked");
}

#[test]
fn only_targets_that_a_weight_calls_for_are_kept_and_curves_follow() {
    let scene = scene_of(&weighted(morphed(), &[0.5, 0.0, 0.0, 0.5, 0.0, 1.0]).bytes());
    let heights: Vec<f32> =
        scene.primitives[0].targets.iter().map(|target| target.deltas[1].position[2]).collect();
    assert_eq!(heights, [8.0, 32.0]);
    assert_eq!(positions(&scene)[1], [2.0, 0.0, 0.0], "unmorphed");
    let curve = &scene.animations[0].curves[0];
    assert_eq!((curve.width, &curve.values), (2, &vec![0.5, 0.0, 0.5, 1.0]));
    assert_eq!(scene.morphs, [[0.5, 0.0]]);
    assert_eq!(scene.bounds.unwrap().max.to_array(), [2.0, 1.0, 4.0], "morphed as at rest");
}

#[test]
fn morph_deltas_go_along_when_vertices_are_split_and_mirrored() {
    let mut file = File::with_material(json!({"normalTexture": {"index": 0}})).texture([160, 120, 240, 255]);
    let quad = file.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]]);
    let uvs = file.floats(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let indices = file.accessor(&[0, 1, 2, 0, 2, 3], 5121, 6, "SCALAR");
    let deltas: Vec<[f32; 3]> = (0..4).map(|at| [at as f32, 0.0, 1.0]).collect();
    let deltas = file.floats(&deltas);
    *file.primitive() = json!({"attributes": {"POSITION": quad, "TEXCOORD_0": uvs}, "indices": indices,
        "material": 0, "targets": [{"POSITION": deltas}]});
    file.root["nodes"][0]["scale"] = json!([-1, 1, 1]);
    animate(&mut file, json!({"node": 0, "path": "weights"}), "LINEAR", &[0.0, 1.0], &[0.0, 1.0], "SCALAR");
    let scene = scene_of(&file.bytes_of());
    let primitive = &scene.primitives[0];
    assert!(primitive.vertices.len() > 4, "flat normals split it");
    for (vertex, delta) in primitive.vertices.iter().zip(&primitive.targets[0].deltas) {
        let [x, y, _] = vertex.position;
        let source = if y == 0.0 { -x } else { 3.0 + x };
        assert_eq!(delta, &MorphDelta { position: [-source, 0.0, 1.0], ..MorphDelta::default() });
    }
    assert!(
        scene.notes.iter().any(|note| note.contains("1 morph targets do not move the normals")),
        "{:?}",
        scene.notes
    );
    assert_eq!(variant(file), "morph+normal_map");
}

#[test]
fn copies_are_an_effect_where_there_are_two() {
    let ones = [[1.0; 3]; 2];
    assert_eq!(variant(instanced(&[[0.0; 3], [5.0, 0.0, 0.0]], &ones)), "instancing");
    assert_eq!(variant(instanced(&[[5.0, 0.0, 0.0]], &ones[..1])), "base");
    assert_eq!(variant(instanced(&[[0.0; 3], [f32::NAN, 0.0, 0.0]], &ones)), "base", "one can be drawn");
    let packed = pack_alone(&instanced(&[[0.0; 3], [5.0, 0.0, 0.0]], &ones).bytes());
    assert_eq!((packed.summary.draws, packed.summary.triangles), (1, 2));
    let scene = load(&packed.glb.unwrap()).unwrap();
    let second = Instance { translation: [5.0, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };
    assert_eq!(scene.draws[0].instances[1], second);
    assert_eq!(scene.bounds.unwrap().max.to_array(), [7.0, 1.0, 0.0]);
}

#[test]
fn copies_that_mirror_or_flatten_or_are_blended_are_drawn_apart() {
    let places = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]];
    let mirror = [-1.0, 1.0, 1.0];
    let file = instanced(&places, &[[1.0; 3], mirror, mirror, [1.0; 3], [1.0, 1.0, 0.0]]);
    let scene = scene_of(&file.bytes_of());
    let counts: Vec<usize> = scene.draws.iter().map(|draw| draw.instances.len()).collect();
    assert_eq!(counts, [2, 2, 0]);
    assert!(scene.draws[1].instances.iter().all(|it| it.scale == [1.0; 3]), "the geometry is mirrored");
    assert_eq!(scene.bounds.unwrap().min.to_array(), [-1.0, 0.0, 0.0]);
    assert_eq!(pack_alone(&file.bytes_of()).effects.len(), 2, "one material, drawn with and without");
    let mut glass = instanced(&places, &[[1.0; 3]; 5]);
    glass.root["materials"] =
        json!([{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}}]);
    glass.primitive()["material"] = json!(0);
    assert_eq!(scene_of(&glass.bytes_of()).draws.len(), 5);
    assert_eq!(variant(glass), "alpha_blend");
}

#[test]
fn no_setting_gives_a_draw_joints() {
    let overrides =
        EffectOverrides { force: [Effect::Skin, Effect::Sheen].into(), forbid: [Effect::Morph].into() };
    assert_eq!(overrides.apply(&[Effect::Morph].into()), [Effect::Sheen].into());
    assert_eq!(overrides.apply(&[Effect::Skin].into()), [Effect::Sheen, Effect::Skin].into());
}

#[test]
fn hostile_joints_weights_and_copies_end_in_a_message_or_a_note() {
    let file = moved(skinned(), 2, [0.0, 1.0, 4.0]);
    let with = |change: &dyn Fn(&mut File)| {
        let mut file = file.clone();
        change(&mut file);
        file
    };
    let cyclic = with(&|file| file.root["nodes"][2]["children"] = json!([1]));
    refusal(&cyclic.bytes());
    let many = with(&|file| file.root["skins"] = json!([{ "joints": vec![1; 100_000] }]));
    assert!(refusal(&many.bytes()).contains("100000 joints exceed the limit of 65536"));
    let outside = with(&|file| file.root["skins"] = json!([{"joints": [1]}]));
    assert!(refusal(&outside.bytes()).contains("joint 1 is outside the skin's 1"));
    let lost = with(&|file| file.root["skins"] = json!([{"joints": [1, 9]}]));
    assert!(refusal(&lost.bytes()).contains("/skins/0/joints/1"));
    let odd = with(&|file| {
        let weights = file.floats(&[[f32::NAN, 0.0, 0.0, 0.0], [0.0; 4], [-1.0, 0.5, 0.0, 0.0]]);
        file.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    });
    let scene = scene_of(&odd.bytes_of());
    assert!(
        scene.notes.iter().any(|note| note.contains("3 vertices have joint weights")),
        "{:?}",
        scene.notes
    );
    assert!(scene.primitives[0].influences.iter().all(|it| it.weights == [1.0, 0.0, 0.0, 0.0]));
    assert_eq!(variant(odd), "skin");
    let mut short = weighted(morphed(), &[0.5, 0.0, 0.0, 0.5, 0.0, 1.0]);
    let two = short.floats(&[[0.0; 3]; 2]);
    short.primitive()["targets"][2] = json!({ "POSITION": two });
    assert!(refusal(&short.bytes()).contains("2 elements for 3 vertices"));
    let mut broken = weighted(morphed(), &[0.5, 0.0, 0.0, 0.5, 0.0, 1.0]);
    let nan = broken.floats(&[[f32::NAN; 3], [0.0, 0.0, 1.0], [0.0; 3]]);
    broken.primitive()["targets"][2] = json!({ "POSITION": nan });
    let notes = scene_of(&broken.bytes()).notes;
    assert!(
        notes.iter().any(|note| note.contains("1 vertices of morph targets are not finite")),
        "{notes:?}"
    );
    let uneven = instanced(&[[0.0; 3], [1.0; 3], [2.0; 3]], &[[1.0; 3]; 2]);
    let notes = scene_of(&uneven.bytes()).notes;
    assert!(notes.iter().any(|note| note.contains("the first 2 instances are drawn")), "{notes:?}");
    let mut many = instanced(&[[0.0; 3]; 2], &[[1.0; 3]; 2]);
    for accessor in many.root["accessors"].as_array_mut().unwrap().iter_mut().skip(3) {
        *accessor = json!({"componentType": 5126, "type": "VEC3", "count": 2_000_000});
    }
    assert!(refusal(&many.bytes()).contains("the instances of all nodes exceed"));
}

#[test]
fn morph_targets_that_claim_more_than_the_limit_are_refused() {
    let mut file = File::triangle();
    let claimed = |count: u64| json!({"componentType": 5126, "type": "VEC3", "count": count});
    for accessor in 0..2 {
        file.root["accessors"][accessor] = claimed(1 << 16);
    }
    file.primitive()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    let indices = file.view(&[0, 0]);
    let values = file.view(&[0, 0, 128, 63].repeat(3));
    let mut sparse = claimed(1 << 16);
    sparse["sparse"] = json!({"count": 1, "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": values}});
    file.root["accessors"].as_array_mut().unwrap().push(sparse);
    let target = file.root["accessors"].as_array().unwrap().len() - 1;
    let targets: Vec<Value> = (0..300).map(|_| json!({ "POSITION": target })).collect();
    file.primitive()["targets"] = json!(targets);
    animate(&mut file, json!({"node": 0, "path": "weights"}), "LINEAR", &[0.0], &[1.0; 300], "SCALAR");
    assert!(refusal(&file.bytes()).contains("the vertices of all morph targets exceed"));
}
