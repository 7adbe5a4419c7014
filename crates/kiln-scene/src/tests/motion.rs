//! Animated files: what is read, what it makes of effects, and that packs keep it.

use serde_json::{Value, json};

use super::build::File;
use super::{pack_alone, scene_of};
use crate::{
    CameraProperty, Effect, Interpolation, Item, LightProperty, MaterialProperty, TextureSlot, Transform,
    load, pack, variant_name,
};

/// Adds an animation of one channel; `values` are elements of type `kind`.
pub(super) fn animate(file: &mut File, target: Value, mode: &str, times: &[f32], values: &[f32], kind: &str) {
    let scalars = |file: &mut File, values: &[f32], kind: &str| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let width = kind.strip_prefix("VEC").map_or(1, |width| width.parse().unwrap());
        file.accessor(&bytes, 5126, values.len() / width, kind)
    };
    let (input, output) = (scalars(file, times, "SCALAR"), scalars(file, values, kind));
    let list = file.root.as_object_mut().unwrap().entry("animations").or_insert(json!([]));
    list.as_array_mut().unwrap().push(json!({
        "channels": [{"sampler": 0, "target": target}],
        "samplers": [{"input": input, "output": output, "interpolation": mode}],
    }));
}

pub(super) fn pointer(to: &str) -> Value {
    json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}})
}

/// A material with one number animated along a line through `values`.
fn with_moving(material: Value, path: &str, values: &[f32], kind: &str) -> File {
    let mut file = File::with_material(material);
    let width = kind.strip_prefix("VEC").map_or(1, |width| width.parse().unwrap());
    let times: Vec<f32> = (0..values.len() / width).map(|at| at as f32).collect();
    animate(&mut file, pointer(&format!("/materials/0/{path}")), "LINEAR", &times, values, kind);
    file
}

/// Checks a pack and its pack, and returns the variant of its first material.
#[track_caller]
pub(super) fn variant(file: File) -> String {
    let packed = pack_alone(&file.bytes());
    let glb = packed.glb.unwrap_or_else(|| panic!("{:?}", packed.diagnostics));
    let again = pack("again.glb", &glb, &mut |_| None);
    assert!(again.glb.as_ref() == Some(&glb), "{}", super::first_difference(&again.glb.unwrap(), &glb));
    assert_eq!(again.effects, packed.effects);
    variant_name(&packed.effects[0].effects)
}

fn extension(name: &str, values: Value) -> Value {
    json!({ "pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": { format!("KHR_materials_{name}"): values } })
}

#[test]
fn animated_factors_count_with_all_they_become_and_constant_ones_do_not() {
    // Extension, property, values that call for the effect, values that do not, their type, the effect.
    type Case = (&'static str, &'static str, &'static [f32], &'static [f32], &'static str, &'static str);
    let cases: &[Case] = &[
        ("clearcoat", "clearcoatFactor", &[0.0, 1.0], &[0.0, 0.0], "SCALAR", "clearcoat"),
        ("sheen", "sheenColorFactor", &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0], &[0.0; 6], "VEC3", "sheen"),
        ("transmission", "transmissionFactor", &[0.0, 1.0], &[0.0, -1.0], "SCALAR", "transmission"),
        ("anisotropy", "anisotropyStrength", &[0.0, 1.0], &[0.0, 0.0], "SCALAR", "anisotropy"),
        ("iridescence", "iridescenceFactor", &[0.0, 1.0], &[0.0, 0.0], "SCALAR", "iridescence"),
        ("ior", "ior", &[1.5, 1.3], &[1.5, 1.5], "SCALAR", "specular"),
        ("specular", "specularFactor", &[1.0, 0.5], &[1.0, 1.0], "SCALAR", "specular"),
        (
            "diffuse_transmission",
            "diffuseTransmissionFactor",
            &[0.0, 1.0],
            &[0.0, 0.0],
            "SCALAR",
            "diffuse_transmission",
        ),
    ];
    for &(name, property, moving, constant, kind, effect) in cases {
        let path = format!("extensions/KHR_materials_{name}/{property}");
        let file = |values| with_moving(extension(name, json!({})), &path, values, kind);
        assert_eq!(variant(file(moving)), effect, "{name}");
        assert_eq!(variant(file(constant)), "base", "{name}");
    }
}

#[test]
fn emission_alpha_and_metal_follow_their_curves() {
    let glow = |strength: f64| {
        let material =
            json!({"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}});
        variant(with_moving(material, "emissiveFactor", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.1], "VEC3"))
    };
    assert_eq!((glow(2.0), glow(0.0)), ("emission".into(), "base".into()));
    let fade = |mode: &str, alpha: f32| {
        let values = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, alpha];
        variant(with_moving(
            json!({ "alphaMode": mode }),
            "pbrMetallicRoughness/baseColorFactor",
            &values,
            "VEC4",
        ))
    };
    assert_eq!((fade("BLEND", 0.5), fade("BLEND", 1.0)), ("alpha_blend".into(), "base".into()));
    assert_eq!((fade("MASK", 0.4), fade("MASK", 0.6)), ("alpha_mask".into(), "base".into()));
    assert_eq!(fade("OPAQUE", 0.0), "base");
    let cutoff = |to| {
        variant(with_moving(
            json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75]}}),
            "alphaCutoff",
            &[0.5, to],
            "SCALAR",
        ))
    };
    assert_eq!((cutoff(0.8), cutoff(0.7)), ("alpha_mask".into(), "base".into()));
    let metal = |least: f32| {
        let glass = json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}});
        variant(with_moving(glass, "pbrMetallicRoughness/metallicFactor", &[1.0, least], "SCALAR"))
    };
    assert_eq!((metal(0.5), metal(1.0)), ("transmission".into(), "base".into()));
}

#[test]
fn normal_map_that_an_animation_turns_on_is_kept() {
    let file = |to| {
        with_moving(
            json!({"normalTexture": {"index": 0, "scale": 0}}),
            "normalTexture/scale",
            &[0.0, to],
            "SCALAR",
        )
        .texture([160, 120, 240, 255])
    };
    assert_eq!(variant(file(1.0)), "normal_map");
    assert_eq!(scene_of(&file(1.0).bytes()).images.len(), 1);
    assert_eq!(variant(file(0.0)), "base");
    assert_eq!(scene_of(&file(0.0).bytes()).images.len(), 0);
}

/// All keys are 0; between them the spline rises to 4/27 of a unit.
#[test]
fn spline_counts_where_it_leaves_its_keys() {
    let coat = |tangent: f32| {
        let mut file = File::with_material(extension("clearcoat", json!({})));
        let target = pointer("/materials/0/extensions/KHR_materials_clearcoat/clearcoatFactor");
        animate(&mut file, target, "CUBICSPLINE", &[0.0, 1.0], &[0.0, 0.0, tangent, 0.0, 0.0, 0.0], "SCALAR");
        variant(file)
    };
    assert_eq!(coat(1.0), "clearcoat");
    assert_eq!(coat(-1.0), "base", "below 0 there is no coat");
    assert_eq!(coat(0.0), "base");
}

#[test]
fn roughness_interval_covers_the_animation() {
    let ggx = |path: &str, values: &[f32]| {
        let material = json!({"pbrMetallicRoughness": {"roughnessFactor": 0.5},
            "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.5}}});
        pack_alone(&with_moving(material, path, values, "SCALAR").bytes()).effects[0].reads.ggx.unwrap()
    };
    super::check_within("base", &ggx("pbrMetallicRoughness/roughnessFactor", &[0.2, 1.5]), &[0.2, 1.0], 1e-6);
    let coat = "extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor";
    super::check_within("coat", &ggx(coat, &[0.1, 0.7]), &[0.1, 0.7], 1e-6);
    super::check_within("rest counts", &ggx(coat, &[0.6, 0.6]), &[0.5, 0.6], 1e-6);
}

/// An arm that turns, with a mesh, a mirrored mesh below an unnamed node, a camera and a light on it.
fn arm() -> File {
    let mut file = File::triangle();
    file.root["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]);
    file.root["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]}});
    file.root["nodes"] = json!([
        {"mesh": 0, "name": "still", "translation": [9, 0, 0]},
        {"name": "base", "children": [3, 2], "translation": [0.1, 0.2, 0.3]},
        {"name": "arm", "mesh": 0, "rotation": [0.1, 0.2, 0.3, 0.927_362], "children": [4, 5]},
        {"name": "beside", "mesh": 0},
        {"scale": [-1.1, 1, 1], "children": [6]},
        {"camera": 0, "name": "eye", "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"mesh": 0, "name": "mirror", "translation": [0.7, 0, 0.1]},
    ]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = [[0.0, 0.0, 0.0, 1.0], [0.0, half, 0.0, half]].concat();
    animate(&mut file, json!({"node": 2, "path": "rotation"}), "LINEAR", &[0.0, 1.5], &turn, "VEC4");
    file
}

#[test]
fn pack_keeps_nodes_that_move_and_what_they_carry() {
    assert_eq!(variant(arm()), "punctual_lights");
    let scene = scene_of(&arm().bytes());
    let names: Vec<(&str, Option<usize>)> =
        scene.nodes.iter().map(|node| (node.name.as_str(), node.parent)).collect();
    assert_eq!(names, [("base", None), ("arm", Some(0))]);
    let draws: Vec<&str> = scene.draws.iter().map(|draw| draw.name.as_str()).collect();
    assert_eq!(draws, ["still", "beside", "arm", "mirror"]);
    let carried: Vec<(usize, Item)> = scene.carried.iter().map(|it| (it.node, it.item)).collect();
    assert_eq!(carried, [(1, Item::Draw(2)), (1, Item::Draw(3)), (1, Item::Camera(0)), (1, Item::Light(0))]);
    let animation = &scene.animations[0];
    assert_eq!(animation.channels[0].target, crate::Target::Rotation { node: 1 });
    let mut value = [0.0; 4];
    animation.curves[0].sample(0.5, &mut value);
    super::check_within("30° about y", &value, &[0.0, 0.258_819_05, 0.0, 0.965_925_8], 1e-6);
    assert_eq!(scene.notes, Vec::<String>::new());
}

/// Posing the kept nodes puts every draw where the rest pose has it.
#[test]
fn kept_nodes_at_rest_are_the_rest_pose() {
    let scene = scene_of(&arm().bytes());
    let mut worlds: Vec<glam::Mat4> = Vec::new();
    for node in &scene.nodes {
        let Transform::Parts { translation, rotation, scale } = node.transform else {
            panic!("no matrix here")
        };
        let rotation = glam::Quat::from_array(rotation).normalize();
        let local = glam::Mat4::from_scale_rotation_translation(scale.into(), rotation, translation.into());
        worlds.push(node.parent.map_or(glam::Mat4::IDENTITY, |parent| worlds[parent]) * local);
    }
    for carried in &scene.carried {
        if let Item::Draw(draw) = carried.item {
            let world = worlds[carried.node] * carried.local;
            super::check_within(
                "world",
                &world.to_cols_array(),
                &scene.draws[draw].world.to_cols_array(),
                1e-6,
            );
        }
    }
    let mirror = &scene.draws[3];
    assert!(mirror.world.determinant() > 0.0 && mirror.primitive != scene.draws[2].primitive);
}

#[test]
fn still_scene_keeps_no_nodes() {
    let scene = scene_of(&File::triangle().bytes());
    assert_eq!((scene.nodes.len(), scene.carried.len(), scene.animations.len()), (0, 0, 0));
}

#[test]
fn cameras_lights_transforms_and_weights_are_targets_too() {
    use crate::Target;
    let mut file = arm();
    file.root["materials"] = json!([{"name": "unused"}, {"pbrMetallicRoughness": {"baseColorTexture":
        {"index": 0, "extensions": {"KHR_texture_transform": {}}}}}]);
    file.primitive()["material"] = json!(1);
    let deltas = file.floats(&[[0.0, 0.0, 1.0]; 3]);
    file.primitive()["targets"] = json!([{"POSITION": deltas}, {"POSITION": deltas}]);
    let mut file = file.texture([9, 9, 9, 255]);
    animate(&mut file, pointer("/cameras/0/perspective/yfov"), "STEP", &[0.0, 1.0], &[0.5, 0.6], "SCALAR");
    animate(
        &mut file,
        pointer("/extensions/KHR_lights_punctual/lights/0/color"),
        "LINEAR",
        &[0.0],
        &[1.0; 3],
        "VEC3",
    );
    let path = "/materials/1/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset";
    animate(&mut file, pointer(path), "LINEAR", &[0.0], &[0.5; 2], "VEC2");
    let weights: Vec<f32> = (0..12).map(|it| it as f32).collect();
    animate(&mut file, json!({"node": 6, "path": "weights"}), "CUBICSPLINE", &[0.0, 1.0], &weights, "SCALAR");
    let scene = scene_of(&file.bytes_of());
    let targets: Vec<Target> =
        scene.animations.iter().map(|animation| animation.channels[0].target).collect();
    let offset = MaterialProperty::TextureOffset(TextureSlot::BaseColor);
    assert_eq!(
        targets[1..],
        [
            Target::Camera { camera: 0, property: CameraProperty::Yfov },
            Target::Light { light: 0, property: LightProperty::Color },
            Target::Material { material: 0, property: offset },
            Target::Weights { morph: 0 },
        ]
    );
    let curve = &scene.animations[4].curves[0];
    assert_eq!((curve.interpolation, curve.width, &curve.values), (Interpolation::CubicSpline, 2, &weights));
    let mirror = scene.draws.iter().find(|draw| draw.morph == Some(0)).unwrap();
    assert_eq!((mirror.name.as_str(), &scene.morphs), ("mirror", &vec![vec![0.0, 0.0]]));
    variant(file);
}

#[test]
fn channel_of_a_material_that_nothing_uses_or_of_a_value_without_effect_is_dropped() {
    let mut file = with_moving(
        extension("sheen", json!({})),
        "extensions/KHR_materials_sheen/sheenRoughnessFactor",
        &[0.0, 1.0],
        "SCALAR",
    );
    file.root["materials"].as_array_mut().unwrap().push(json!({}));
    animate(&mut file, pointer("/materials/1/emissiveFactor"), "LINEAR", &[0.0], &[1.0; 3], "VEC3");
    let scene = scene_of(&file.bytes());
    assert_eq!(scene.animations.len(), 0);
    assert!(!scene.materials[0].effects.contains(&Effect::Sheen));
}

/// A node that blinks, invisible at rest, with a material of its own.
#[test]
fn what_an_animation_shows_counts_though_the_rest_pose_hides_it() {
    let mut file = File::with_material(json!({"emissiveFactor": [1, 0, 0]}));
    file.root["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    assert_eq!(pack_alone(&file.bytes_of()).effects.len(), 0, "nothing shows it");
    let (input, output) =
        (file.accessor(&0f32.to_le_bytes(), 5126, 1, "SCALAR"), file.accessor(&[1], 5121, 1, "SCALAR"));
    let target = pointer("/nodes/0/extensions/KHR_node_visibility/visible");
    file.root["animations"] = json!([{"channels": [{"sampler": 0, "target": target}],
        "samplers": [{"input": input, "output": output, "interpolation": "STEP"}]}]);
    let scene = scene_of(&file.bytes_of());
    assert_eq!((scene.draws.len(), scene.hidden.len(), scene.nodes[0].visible), (0, 1, false));
    assert_eq!(variant(file), "emission");
}

#[test]
fn node_shrunk_to_a_point_is_kept_where_it_can_grow() {
    let mut file = File::triangle();
    file.root["nodes"][0]["scale"] = json!([0, 0, 0]);
    animate(
        &mut file,
        json!({"node": 0, "path": "scale"}),
        "LINEAR",
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        "VEC3",
    );
    let scene = scene_of(&file.bytes_of());
    assert_eq!((scene.draws.len(), scene.hidden.len()), (0, 1));
    variant(file);
}

/// The message about a broken animation; the file itself is drawn.
#[track_caller]
fn check_left_out(file: File, wanted: &[&str]) {
    let packed = pack_alone(&file.bytes());
    let scene = load(&packed.glb.unwrap_or_else(|| panic!("{:?}", packed.diagnostics))).unwrap();
    assert_eq!(scene.animations.len(), 0);
    let message = packed.diagnostics[0].to_string();
    for wanted in wanted {
        assert!(message.contains(wanted), "{wanted:?} is not in:\n{message}");
    }
    assert!(message.contains("the animation is left out"), "{message}");
    // Findings do not say it a second time.
    let place = packed.diagnostics[0].message.split_inclusive(": ").next().unwrap_or_default();
    let again = packed.diagnostics[1..].iter().filter(|it| it.message.starts_with(place));
    assert_eq!(again.count(), 0, "{:?}", packed.diagnostics);
}

#[test]
fn broken_animations_are_left_out_with_a_place() {
    let moved = |times: &[f32], values: &[f32], kind: &str| {
        let mut file = File::triangle();
        animate(&mut file, json!({"node": 0, "path": "translation"}), "LINEAR", times, values, kind);
        file
    };
    assert_eq!(scene_of(&moved(&[0.0, 1.0], &[0.0; 6], "VEC3").bytes()).animations.len(), 1, "the sound one");
    check_left_out(
        moved(&[1.0, 1.0], &[0.0; 6], "VEC3"),
        &["/animations/0/samplers/0/input", "accessor 3: time 1 s (number 1) does not come after 1 s"],
    );
    check_left_out(
        moved(&[-1.0, 1.0], &[0.0; 6], "VEC3"),
        &["/samplers/0/input", "accessor 3: times must be finite"],
    );
    check_left_out(moved(&[0.0, f32::NAN], &[0.0; 6], "VEC3"), &["/samplers/0/input", "finite"]);
    check_left_out(
        moved(&[0.0, 1.0], &[0.0; 3], "VEC3"),
        &["/animations/0/channels/0/sampler", "1 values, 2 are needed"],
    );
    check_left_out(
        moved(&[0.0], &[f32::INFINITY, 0.0, 0.0], "VEC3"),
        &["/channels/0/sampler", "accessor 4: number 0 is not finite"],
    );
    check_left_out(
        moved(&[0.0], &[0.0; 4], "VEC4"),
        &["/channels/0/sampler", "accessor 4: the values must be VEC3"],
    );
    let broken = |path: &[&str], value: Value| {
        let mut file = moved(&[0.0, 1.0], &[0.0; 6], "VEC3");
        let mut at = &mut file.root["animations"][0];
        for name in path {
            at = match name.parse::<usize>() {
                Ok(index) => &mut at[index],
                Err(_) => &mut at[*name],
            };
        }
        *at = value;
        file
    };
    let place = "/animations/0/channels/0";
    check_left_out(broken(&["channels", "0", "sampler"], json!(7)), &[place, "sampler 7 does not exist"]);
    check_left_out(broken(&["channels", "0", "target", "node"], json!(7)), &[place, "node 7 does not exist"]);
    check_left_out(broken(&["channels", "0", "target", "path"], json!("colour")), &[place, "/target/path"]);
    check_left_out(
        broken(&["channels", "0", "target", "path"], json!("weights")),
        &[place, "no morph targets"],
    );
    check_left_out(
        broken(&["channels", "0", "target"], pointer("/materials/4/alphaCutoff")),
        &[place, "does not exist"],
    );
    check_left_out(
        broken(&["samplers", "0", "interpolation"], json!("BOUNCE")),
        &["/samplers/0/interpolation"],
    );
    check_left_out(broken(&["samplers", "0", "input"], json!(99)), &["/samplers/0/input", "accessor 99"]);
    let twice = json!([{"sampler": 0, "target": {"node": 0, "path": "translation"}}, {"sampler": 0, "target": {"node": 0, "path": "translation"}}]);
    check_left_out(broken(&["channels"], twice), &["/channels/0/target", "channel 1 moves the same"]);
    let mut matrix = moved(&[0.0], &[0.0; 3], "VEC3");
    matrix.root["nodes"][0]["matrix"] = json!(glam::Mat4::IDENTITY.to_cols_array());
    check_left_out(matrix, &["node 0 has a matrix"]);
}

#[test]
fn curves_that_claim_more_than_the_limit_are_refused_before_they_are_read() {
    let mut file = File::triangle();
    animate(&mut file, json!({"node": 0, "path": "translation"}), "LINEAR", &[0.0], &[0.0; 3], "VEC3");
    for accessor in [3, 4] {
        file.root["accessors"][accessor]["count"] = json!(4_000_000_000u64);
    }
    check_left_out(file, &["/animations/0/samplers/0", "exceed"]);
}

#[test]
fn pointer_to_what_no_picture_depends_on_is_noted() {
    let mut file = File::triangle();
    animate(&mut file, pointer("/extensions/KHR_audio/gain"), "LINEAR", &[0.0], &[1.0], "SCALAR");
    let packed = pack_alone(&file.bytes());
    assert!(
        packed
            .diagnostics
            .iter()
            .any(|it| it.message.contains("`/extensions/KHR_audio/gain` is not animated"))
    );
}
