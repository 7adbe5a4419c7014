//! Modes, component types, normals, tangents, skins, morphs, mirrored and flattened instances.

use serde_json::json;

use super::build::File;
use super::{check_within, pack_alone, scene_of};
use crate::topology::{Topology, triangulate};

#[test]
fn strips_and_fans_keep_their_winding() {
    let triangles = |mode| match triangulate(mode, vec![0, 1, 2, 3, 4]) {
        Topology::Triangles(indices) => indices,
        other => panic!("{other:?}"),
    };
    assert_eq!(triangles(4), [0, 1, 2]);
    assert_eq!(triangles(5), [0, 1, 2, 1, 3, 2, 2, 3, 4]);
    assert_eq!(triangles(6), [1, 2, 0, 2, 3, 0, 3, 4, 0]);
    assert_eq!(triangulate(1, vec![0, 1]), Topology::NotDrawn("lines"));
    assert_eq!(triangulate(7, vec![]), Topology::Unknown);
}

#[test]
fn points_are_noted_and_not_drawn() {
    let mut file = File::triangle();
    file.primitive()["mode"] = json!(0);
    let packed = pack_alone(&file.bytes());
    assert_eq!(packed.summary.draws, 0);
    assert!(packed.glb.is_some() && packed.diagnostics[0].message.contains("points are not drawn"));
}

#[test]
fn missing_normals_are_flat_and_face_the_winding() {
    let mut file = File::triangle();
    file.primitive()["attributes"].as_object_mut().unwrap().remove("NORMAL");
    let scene = scene_of(&file.bytes());
    assert!(scene.primitives[0].vertices.iter().all(|vertex| vertex.normal == [0.0, 0.0, 1.0]));
}

#[test]
fn zero_normal_is_replaced_by_its_triangles() {
    let mut file = File::triangle();
    let normals = file.floats(&[[0.0; 3], [0.0, 3.0, 4.0], [f32::NAN; 3]]);
    file.primitive()["attributes"]["NORMAL"] = json!(normals);
    let scene = scene_of(&file.bytes());
    let normals: Vec<[f32; 3]> = scene.primitives[0].vertices.iter().map(|vertex| vertex.normal).collect();
    assert_eq!(normals[0], [0.0, 0.0, 1.0]);
    check_within("made unit", &normals[1], &[0.0, 0.6, 0.8], 1e-6);
    assert_eq!(normals[2], [0.0, 0.0, 1.0]);
    assert!(scene.notes[0].contains("1 normals did not have length 1"), "{:?}", scene.notes);
    assert!(scene.notes[1].contains("2 vertices without a usable normal"), "{:?}", scene.notes);
}

#[test]
fn triangle_with_an_infinite_corner_is_dropped_with_a_note() {
    let mut file = File::triangle();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let broken = [[0.0, f32::INFINITY, 0.0], [1.0, f32::NAN, 0.0], [0.0, 1.0, 0.0]];
    let position = file.floats(&[corners, broken].concat());
    *file.primitive() = json!({"attributes": {"POSITION": position}});
    let scene = scene_of(&file.bytes());
    assert_eq!(scene.primitives[0].indices.len(), 3);
    assert!(scene.notes[0].contains("1 triangles with non-finite positions"), "{:?}", scene.notes);
}

#[test]
fn tangents_follow_u_and_bitangents_go_against_v() {
    let mut file = File::with_material(json!({"normalTexture": {"index": 0}})).texture([160, 120, 240, 255]);
    file.primitive()["material"] = json!(0);
    let scene = scene_of(&file.bytes());
    for vertex in &scene.primitives[0].vertices {
        // u grows along +x, v along +y, so "up" in the texture is −y = −1 · (n × t).
        check_within("tangent", &vertex.tangent, &[1.0, 0.0, 0.0, -1.0], 1e-6);
    }
}

#[test]
fn tangents_follow_a_turned_texture() {
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform": {"rotation": std::f64::consts::FRAC_PI_2}}});
    let file = File::with_material(json!({"normalTexture": turned})).texture([160, 120, 240, 255]);
    let scene = scene_of(&file.bytes());
    // u' = v, v' = −u.
    let [row_u, row_v] = scene.materials[0].normal_texture.unwrap().transform;
    check_within("u", &row_u, &[0.0, 1.0, 0.0], 1e-6);
    check_within("v", &row_v, &[-1.0, 0.0, 0.0], 1e-6);
    check_within("tangent", &scene.primitives[0].vertices[0].tangent, &[0.0, 1.0, 0.0, -1.0], 1e-6);
}

#[test]
fn mirrored_instance_gets_geometry_of_its_own_and_the_same_picture() {
    let mut file = File::with_material(json!({"normalTexture": {"index": 0}})).texture([160, 120, 240, 255]);
    file.root["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1], "translation": [5, 0, 0]}]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = scene_of(&file.bytes());
    assert_eq!((scene.primitives.len(), scene.draws.len()), (2, 2));
    let draw = &scene.draws[1];
    assert!(draw.world.determinant() > 0.0);
    let primitive = &scene.primitives[draw.primitive];
    let corners: Vec<glam::Vec3> = primitive
        .indices
        .iter()
        .map(|&index| draw.world.transform_point3(primitive.vertices[index as usize].position.into()))
        .collect();
    let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    assert!(face.z > 0.0, "still faces +z: {face}");
    assert!(corners.iter().any(|corner| corner.x == 3.0), "{corners:?}");
    let tangent = primitive.vertices[0].tangent;
    check_within("u goes to −x, the bitangent stays", &tangent, &[-1.0, 0.0, 0.0, 1.0], 1e-6);
}

#[test]
fn flattened_instance_is_drawn_flat_with_true_normals() {
    let mut file = File::triangle();
    file.root["nodes"][0]["scale"] = json!([1, 1, 0]);
    let scene = scene_of(&file.bytes());
    assert_eq!(scene.draws[0].world, glam::Mat4::IDENTITY);
    assert_eq!(scene.primitives[0].vertices[0].normal, [0.0, 0.0, 1.0]);
}

#[test]
fn skinned_vertices_follow_their_joints_and_not_their_node() {
    let mut file = File::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 5121, 3, "VEC4");
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]]);
    let primitive = file.primitive();
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    file.root["skins"] = json!([{"joints": [1, 2]}]);
    file.root["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [0, 10, 0], "children": [2]},
        {"translation": [0, 0, 4]},
    ]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = scene_of(&file.bytes());
    let positions: Vec<[f32; 3]> =
        scene.primitives[0].vertices.iter().map(|vertex| vertex.position).collect();
    assert_eq!(positions, [[0.0, 10.0, 0.0], [2.0, 10.0, 4.0], [0.0, 11.0, 2.0]]);
    assert_eq!(scene.draws[0].world, glam::Mat4::IDENTITY);
}

#[test]
fn joint_weights_that_do_not_sum_up_to_one_are_noted() {
    let notes = |weight: f32| {
        let mut file = File::triangle();
        let joints = file.accessor(&[0; 12], 5121, 3, "VEC4");
        let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0], [weight, 0.5, 0.0, 0.0], [weight, 0.5, 0.0, 0.0]]);
        let primitive = file.primitive();
        primitive["attributes"]["JOINTS_0"] = json!(joints);
        primitive["attributes"]["WEIGHTS_0"] = json!(weights);
        file.root["skins"] = json!([{"joints": [0]}]);
        file.root["nodes"][0]["skin"] = json!(0);
        scene_of(&file.bytes()).notes
    };
    assert_eq!(notes(0.5), [""; 0]);
    assert!(notes(0.25)[0].contains("2 vertices have joint weights"), "{:?}", notes(0.25));
    assert!(notes(-0.5)[0].contains("2 vertices have joint weights"), "{:?}", notes(-0.5));
}

#[test]
fn default_morph_weights_move_vertices_and_a_node_overrides_its_mesh() {
    let mut file = File::triangle();
    let deltas = file.floats(&[[0.0, 0.0, 0.0], [0.0, 0.0, 8.0], [0.0, 0.0, 0.0]]);
    file.primitive()["targets"] = json!([{"POSITION": deltas}]);
    file.root["meshes"][0]["weights"] = json!([0.5]);
    file.root["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "weights": [0.25]}]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = scene_of(&file.bytes());
    let z = |draw: usize| scene.primitives[scene.draws[draw].primitive].vertices[1].position[2];
    assert_eq!([z(0), z(1)], [4.0, 2.0]);
}

#[test]
fn sparse_accessor_without_a_base_replaces_zeros() {
    let mut file = File::triangle();
    let indices = file.view(&[1, 0, 2, 0]);
    let bytes: Vec<u8> =
        [7.0f32, 0.0, 0.0, 0.0, 9.0, 0.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let values = file.view(&bytes);
    file.root["accessors"][0] = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 2,
        "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}}});
    let scene = scene_of(&file.bytes());
    let positions: Vec<[f32; 3]> =
        scene.primitives[0].vertices.iter().map(|vertex| vertex.position).collect();
    assert_eq!(positions, [[0.0; 3], [7.0, 0.0, 0.0], [0.0, 9.0, 0.0]]);
}

#[test]
fn normalised_integers_reach_both_ends() {
    let mut file = File::with_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}))
        .texture([9; 4]);
    let uv = file.accessor(&[0, 0, 255, 255, 51, 0, 0, 0, 0, 255, 0, 0], 5121, 3, "VEC2");
    file.root["accessors"][uv]["normalized"] = json!(true);
    file.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    let view = &file.root["accessors"][uv]["bufferView"];
    let view = view.as_u64().unwrap() as usize;
    file.root["bufferViews"][view]["byteStride"] = json!(4);
    let scene = scene_of(&file.bytes());
    let uvs: Vec<[f32; 2]> = scene.primitives[0].vertices.iter().map(|vertex| vertex.uv0).collect();
    check_within("uv", uvs.as_flattened(), &[0.0, 0.0, 0.2, 0.0, 0.0, 1.0], 1e-6);
}

#[test]
fn bounds_are_those_of_the_placed_geometry() {
    let mut file = File::triangle();
    file.root["nodes"][0]["translation"] = json!([10, 0, 0]);
    file.root["nodes"][0]["scale"] = json!([2, 2, 2]);
    let bounds = scene_of(&file.bytes()).bounds.unwrap();
    assert_eq!(bounds.min.to_array(), [10.0, 0.0, 0.0]);
    assert_eq!(bounds.max.to_array(), [14.0, 2.0, 0.0]);
}

/// A triangle that hangs on the given joints, joint j of which is 2^j higher than it was modelled.
fn hung(sets: &[(Vec<u8>, u32, Vec<u8>)]) -> Vec<[f32; 3]> {
    let mut file = File::triangle();
    for (set, (joints, component, weights)) in sets.iter().enumerate() {
        let joints = file.accessor(joints, 5121, 3, "VEC4");
        let weights = file.accessor(weights, *component, 3, "VEC4");
        file.root["accessors"][weights]["normalized"] = json!(*component != 5126);
        let attributes = &mut file.primitive()["attributes"];
        attributes[format!("JOINTS_{set}")] = json!(joints);
        attributes[format!("WEIGHTS_{set}")] = json!(weights);
    }
    let joints: Vec<usize> = (1..9).collect();
    file.root["skins"] = json!([{ "joints": joints }]);
    let mut nodes = vec![json!({"mesh": 0, "skin": 0})];
    nodes.extend((0..8).map(|joint| json!({"translation": [0, 0, f64::powi(2.0, joint)]})));
    file.root["nodes"] = json!(nodes);
    let all: Vec<usize> = (0..9).collect();
    file.root["scenes"][0]["nodes"] = json!(all);
    scene_of(&file.bytes()).primitives[0].vertices.iter().map(|vertex| vertex.position).collect()
}

#[test]
fn eight_influences_of_two_sets_count_alike() {
    let joints = |first: u8| [[first, first + 1, first + 2, first + 3]; 3].concat();
    let weights: Vec<u8> = std::iter::repeat_n(0.125f32, 12).flat_map(f32::to_le_bytes).collect();
    let moved = hung(&[(joints(0), 5126, weights.clone()), (joints(4), 5126, weights.clone())]);
    check_within("mean of 1, 2 … 128", &[moved[0][2], moved[2][2]], &[255.0 / 8.0; 2], 1e-5);
    let first_set_alone = hung(&[(joints(0), 5126, weights)]);
    check_within("mean of 1, 2, 4, 8", &[first_set_alone[0][2]], &[15.0 / 4.0], 1e-5);
}

#[test]
fn normalised_integer_weights_are_shares() {
    let joints = || [[0, 1, 0, 0]; 3].concat();
    let bytes = [[51, 204, 0, 0], [255, 0, 0, 0], [0, 255, 0, 0]].concat();
    let heights = |moved: Vec<[f32; 3]>| -> [f32; 3] { std::array::from_fn(|at| moved[at][2]) };
    check_within("bytes", &heights(hung(&[(joints(), 5121, bytes)])), &[1.8, 1.0, 2.0], 1e-5);
    let shorts = [[13_107u16, 52_428, 0, 0], [65_535, 0, 0, 0], [0, 65_535, 0, 0]].concat();
    let shorts: Vec<u8> = shorts.into_iter().flat_map(u16::to_le_bytes).collect();
    check_within("shorts", &heights(hung(&[(joints(), 5123, shorts)])), &[1.8, 1.0, 2.0], 1e-5);
}

#[test]
fn morphs_move_normals_and_tangents_and_may_be_sparse() {
    let mut file = File::with_material(json!({"normalTexture": {"index": 0}})).texture([160, 120, 240, 255]);
    let tangents = file.floats(&[[1.0, 0.0, 0.0, 1.0]; 3]);
    file.primitive()["attributes"]["TANGENT"] = json!(tangents);
    let indices = file.view(&[2, 0]);
    let values: Vec<u8> = [0.0f32, 0.0, 6.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let values = file.view(&values);
    let list = file.root["accessors"].as_array_mut().unwrap();
    list.push(json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}}}));
    let positions = list.len() - 1;
    let normals = file.floats(&[[0.0, 2.0, 0.0]; 3]);
    let along = file.floats(&[[-1.0, 1.0, 0.0]; 3]);
    file.primitive()["targets"] = json!([{"POSITION": positions}, {"NORMAL": normals, "TANGENT": along}]);
    file.root["meshes"][0]["weights"] = json!([0.5, 0.5]);
    let scene = scene_of(&file.bytes());
    let vertices = &scene.primitives[0].vertices;
    assert_eq!([0, 1, 2].map(|at| vertices[at].position[2]), [0.0, 0.0, 3.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    check_within("normal", &vertices[0].normal, &[0.0, half, half], 1e-6);
    check_within("tangent", &vertices[0].tangent, &[half, half, 0.0, 1.0], 1e-6);
}

#[test]
fn weights_beyond_the_targets_and_targets_beyond_the_weights_change_nothing() {
    let mut file = File::triangle();
    let deltas = file.floats(&[[0.0, 0.0, 8.0]; 3]);
    file.primitive()["targets"] = json!([{"POSITION": deltas}, {"POSITION": deltas}]);
    file.root["nodes"] =
        json!([{"mesh": 0, "weights": [0.5]}, {"mesh": 0, "weights": [0, 0.25, 9]}, {"mesh": 0}]);
    file.root["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let scene = scene_of(&file.bytes());
    let z = |draw: usize| scene.primitives[scene.draws[draw].primitive].vertices[1].position[2];
    assert_eq!([z(0), z(1), z(2)], [4.0, 2.0, 0.0]);
}
