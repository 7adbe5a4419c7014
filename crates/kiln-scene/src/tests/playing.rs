//! Poses: worlds, joints, weights, cameras, lights and materials at a time.

use glam::Mat4;
use serde_json::json;

use super::build::File;
use super::deforming::{morphed, skinned};
use super::motion::{animate, pointer};
use super::{check_within, scene_of};
use crate::{LightKind, Posed, Scene};

/// Skinned and morphed vertices of a draw in the world.
pub(super) fn placed(scene: &Scene, posed: &Posed, draw: usize) -> Vec<[f32; 3]> {
    let source = &scene.draws[draw];
    let primitive = &scene.primitives[source.primitive];
    let weights = source.morph.map_or(&[][..], |morph| &posed.morphs[morph]);
    let joints = source.skin.map_or(&[][..], |skin| &posed.skins[skin]);
    let world = posed.draws[draw].world.as_dmat4();
    let place = |at| world.transform_point3(primitive.deformed_vertex(at, weights, joints).position);
    (0..primitive.vertices.len()).map(|at| place(at).as_vec3().to_array()).collect()
}

fn moving_skin() -> File {
    let mut file = skinned();
    let knee = [[0.0, 0.0, 4.0], [0.0, 6.0, 4.0]].concat();
    animate(&mut file, json!({"node": 2, "path": "translation"}), "LINEAR", &[1.0, 2.0], &knee, "VEC3");
    file
}

#[test]
fn joints_move_vertices_and_their_node_does_not() {
    let scene = scene_of(&moving_skin().bytes());
    let at = |time_s| placed(&scene, &scene.pose(Some(0), time_s), 0);
    let rest = [[0.0, 10.0, 0.0], [2.0, 10.0, 4.0], [0.0, 11.0, 2.0]];
    assert_eq!((at(0.0), at(1.0)), (rest.to_vec(), rest.to_vec()), "the first key holds before its time");
    assert_eq!(at(1.5), [[0.0, 10.0, 0.0], [2.0, 13.0, 4.0], [0.0, 12.5, 2.0]]);
    assert_eq!(at(9.0), [[0.0, 10.0, 0.0], [2.0, 16.0, 4.0], [0.0, 14.0, 2.0]]);
    assert_eq!(scene.animations[0].duration_s(), 2.0);
}

#[test]
fn weights_move_vertices_in_step() {
    let mut file = morphed();
    animate(
        &mut file,
        json!({"node": 0, "path": "weights"}),
        "LINEAR",
        &[0.0, 1.0],
        &[0.5, 0.0, 0.0, 0.0, 0.0, 1.0],
        "SCALAR",
    );
    let scene = scene_of(&file.bytes());
    let posed = scene.pose(Some(0), 0.5);
    assert_eq!(posed.morphs, [[0.25, 0.5]]);
    assert_eq!(placed(&scene, &posed, 0)[1], [2.0, 0.0, 18.0]);
    assert_eq!(placed(&scene, &scene.pose(None, 0.5), 0)[1], [2.0, 0.0, 4.0]);
}

/// A still file is morphed and skinned while it is read; a moving one by the player.
#[test]
fn rest_pose_is_what_a_file_without_animations_is() {
    let mut morphing = morphed();
    let weights = [0.5, 0.0, 0.0, 0.0, 0.0, 1.0];
    let target = json!({"node": 0, "path": "weights"});
    animate(&mut morphing, target, "LINEAR", &[0.0, 1.0], &weights, "SCALAR");
    for moving in [moving_skin(), morphing] {
        let mut still = moving.clone();
        still.root.as_object_mut().unwrap().remove("animations");
        let (still, moving) = (scene_of(&still.bytes()), scene_of(&moving.bytes()));
        assert!(still.draws[0].effects().is_empty() && moving.draws[0].effects().len() == 1);
        let [still, moving] = [still, moving].map(|scene| placed(&scene, &scene.pose(None, 0.0), 0));
        assert_eq!(still, moving);
    }
}

/// The skin is part of the vertices and of what is added to them; beside it, one whose joints move later.
#[test]
fn morph_of_a_skin_that_stands_still_is_that_of_the_skin() {
    let file = |later: f32| {
        let mut file = skinned();
        let deltas = file.floats(&[[1.0, 2.0, 3.0]; 3]);
        let normals = file.floats(&[[0.5, 0.25, 0.0]; 3]);
        file.primitive()["targets"] = json!([{"POSITION": deltas, "NORMAL": normals}]);
        file.root["nodes"][1]["rotation"] = json!([0.6, 0, 0, 0.8]);
        file.root["nodes"][2]["scale"] = json!([1, 2, 3]);
        let joints = [[0.0, 0.0, 4.0], [0.0, 0.0, 4.0], [0.0, later, 4.0]].concat();
        let target = json!({"node": 2, "path": "translation"});
        animate(&mut file, target, "LINEAR", &[0.0, 1.0, 2.0], &joints, "VEC3");
        let target = json!({"node": 0, "path": "weights"});
        animate(&mut file, target, "LINEAR", &[0.0, 1.0], &[0.0, 1.0], "SCALAR");
        scene_of(&file.bytes())
    };
    let (baked, kept) = (file(0.0), file(9.0));
    assert!(baked.draws[0].skin.is_none() && kept.draws[0].skin.is_some());
    let (a, b) = (baked.pose(Some(1), 0.5), kept.pose(Some(1), 0.5));
    let ours = placed(&baked, &a, 0);
    check_within("positions", ours.as_flattened(), placed(&kept, &b, 0).as_flattened(), 1e-5);
    for at in 0..3 {
        let theirs = kept.primitives[0].deformed_vertex(at, &b.morphs[0], &b.skins[0]).normal;
        let ours = baked.primitives[0].morphed_vertex(at, &a.morphs[0]).normal;
        check_within("normals", &ours.as_vec3().to_array(), &theirs.as_vec3().to_array(), 1e-6);
    }
}

#[test]
fn pose_at_rest_has_the_bits_of_the_scene() {
    let mut file = File::triangle();
    file.root["nodes"] = json!([{"mesh": 0, "translation": [0.1, 0.2, 0.3], "rotation": [0.1, 0.2, 0.3, 0.9],
        "scale": [1.1, 1.2, 1.3]}]);
    let turn = [0.0, 0.0, 0.0, 1.0];
    animate(&mut file, json!({"node": 0, "path": "rotation"}), "LINEAR", &[0.0], &turn, "VEC4");
    let scene = scene_of(&file.bytes());
    assert_eq!(scene.pose(None, 3.0).draws[0].world, scene.draws[0].world);
    assert_eq!(scene.pose(Some(7), 3.0).draws[0].world, scene.draws[0].world, "there is no such animation");
    let scaled = Mat4::from_scale([1.1, 1.2, 1.3].into()).to_cols_array();
    check_within(
        "turned",
        &scene.pose(Some(0), 0.0).draws[0].world.to_cols_array()[..12],
        &scaled[..12],
        1e-6,
    );
}

#[test]
fn reused_pose_is_the_same_as_a_new_one() {
    let scene = scene_of(&moving_skin().bytes());
    let mut posed = Posed::default();
    for time_s in [0.3, 1.7, 1.2] {
        posed.update(&scene, Some(0), time_s);
        let fresh = scene.pose(Some(0), time_s);
        assert_eq!((&posed.skins, &posed.draws), (&fresh.skins, &fresh.draws));
    }
    posed.update(&scene, None, 0.0);
    assert_eq!(posed.skins, scene.pose(None, 0.0).skins, "nothing of the animation is left");
}

#[test]
fn cameras_lights_and_materials_follow_their_channels() {
    let mut file = File::with_material(json!({
        "emissiveFactor": [0, 0, 0],
        "pbrMetallicRoughness": {"baseColorTexture":
            {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}},
    }))
    .texture([9, 9, 9, 255]);
    file.root["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]);
    file.root["extensions"] = json!({"KHR_lights_punctual": {"lights":
        [{"type": "spot", "intensity": 2, "spot": {"outerConeAngle": 0.5}}]}});
    file.root["nodes"] =
        json!([{"mesh": 0}, {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let light = "/extensions/KHR_lights_punctual/lights/0";
    let base = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform";
    let channels = [
        (pointer("/cameras/0/perspective/yfov"), vec![0.4f32], "SCALAR"),
        (pointer(&format!("{light}/color")), vec![1.0, 0.5, 0.0], "VEC3"),
        (pointer(&format!("{light}/spot/outerConeAngle")), vec![0.9], "SCALAR"),
        (pointer("/materials/0/emissiveFactor"), vec![0.1, 0.2, 0.3], "VEC3"),
        (pointer(&format!("{base}/offset")), vec![0.5, 0.25], "VEC2"),
        (json!({"node": 1, "path": "translation"}), vec![1.0, 2.0, 3.0], "VEC3"),
    ];
    for (target, values, kind) in channels {
        animate(&mut file, target, "LINEAR", &[0.0], &values, kind);
    }
    let samplers: Vec<_> =
        file.root["animations"].as_array().unwrap().iter().map(|it| it["samplers"][0].clone()).collect();
    let channels: Vec<_> = file.root["animations"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
        .map(|(at, it)| json!({"sampler": at, "target": it["channels"][0]["target"]}))
        .collect();
    file.root["animations"] = json!([{"channels": channels, "samplers": samplers}]);
    let scene = scene_of(&file.bytes());
    let posed = scene.pose(Some(0), 0.0);
    assert_eq!(posed.cameras[0].yfov_rad, Some(0.4));
    assert_eq!(posed.cameras[0].world.w_axis.truncate().to_array(), [1.0, 2.0, 3.0]);
    let light = &posed.lights[0];
    assert_eq!((light.intensity, light.position.to_array()), ([2.0, 1.0, 0.0], [1.0, 2.0, 3.0]));
    assert_eq!(light.kind, LightKind::Spot { inner_cone_rad: 0.0, outer_cone_rad: 0.9 });
    let material = &posed.materials[&0];
    check_within("strength counts", &material.emissive_factor, &[0.3, 0.6, 0.9], 1e-6);
    let texture = material.base_color_texture.unwrap();
    assert_eq!(texture.transform, [[2.0, 0.0, 0.5], [0.0, 2.0, 0.25]]);
    assert_eq!(texture.texture, scene.materials[0].base_color_texture.unwrap().texture);
    assert_eq!(material.effects, scene.materials[0].effects);
    let rest = scene.pose(None, 0.0);
    assert!(rest.materials.is_empty() && rest.lights == scene.lights && rest.cameras == scene.cameras);
}
