//! Skins, morph targets, instances and animations: frames beside frames of the same pose worked out on the CPU.

use glam::{Mat4, Quat, Vec3};
use image::RgbaImage;
use kiln_gpu::Gpu;
use kiln_scene::{Deformed, Draw, Influence, Posed, Scene, skinned_vertex};
use serde_json::{Value, json};

use super::corpus::{corpus, find, keep, pack};
use super::fixture::{Build, SIX_COLORS, glb, gpu};
use super::frames::STEPS_MAX;
use crate::{AnimationTime, HeadlessViewer, OrbitCamera, Selection};

const SIZE: [u32; 2] = [320, 180];

/// Share of pixels that may differ: edges, where f32 and f64 put a sample on different sides.
const EDGE_SHARE: f64 = 0.002;

fn viewer(glb: &[u8]) -> Option<HeadlessViewer> {
    Some(viewer_on(gpu()?, glb))
}

fn viewer_on(gpu: Gpu, glb: &[u8]) -> HeadlessViewer {
    viewer_in(gpu, glb, None)
}

/// With a sun of this direction, if there is one.
fn viewer_in(gpu: Gpu, glb: &[u8], sun: Option<[f64; 3]>) -> HeadlessViewer {
    let mut build = Build::new();
    build.shaders_of(glb).lut().env("sky", SIX_COLORS).scene("scene", "sky", glb.to_vec());
    if let Some(sun) = sun {
        build.sunlit_shaders_of(glb).sun("sky", sun, [3.0; 3], 0.01);
    }
    let mut viewer = HeadlessViewer::new(gpu, SIZE);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics, vec![]);
    viewer
}

fn picture(viewer: &mut HeadlessViewer, time_s: Option<f64>) -> RgbaImage {
    viewer.view.animation = time_s.map(|time_s| AnimationTime { index: 0, time_s });
    let picture = viewer.render().expect("the device reads back");
    assert_eq!(viewer.gpu().take_errors(), Vec::<String>::new());
    picture
}

/// Share of pixels that differ by more than rounding.
fn share_that_differs(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let differs = |(a, b): &(&image::Rgba<u8>, &image::Rgba<u8>)| {
        a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > STEPS_MAX)
    };
    a.pixels().zip(b.pixels()).filter(differs).count() as f64 / a.pixels().count() as f64
}

/// JSON and binary chunk of a pack.
fn chunks(glb: &[u8]) -> (Value, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("four bytes")) as usize;
    let json = 20..20 + word(12);
    let binary = json.end + 8..json.end + 8 + word(json.end);
    (serde_json::from_slice(&glb[json]).expect("a pack is JSON"), glb[binary].to_vec())
}

/// A draw's vertices in the world.
fn world_vertices(scene: &Scene, draw: &Draw, posed: &Posed, world: Mat4) -> Vec<Deformed> {
    let primitive = &scene.primitives[draw.primitive];
    let weights = draw.morph.map_or(&[][..], |morph| &posed.morphs[morph]);
    let deformed = |vertex| match draw.skin {
        Some(skin) => primitive.deformed_vertex(vertex, weights, &posed.skins[skin]),
        None => {
            let whole = Influence { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] };
            skinned_vertex(&primitive.morphed_vertex(vertex, weights), &whole, &[world])
        }
    };
    (0..primitive.vertices.len()).map(deformed).collect()
}

/// The pose as a scene that does not move: every draw and copy a mesh in world space, with the pack's materials.
fn baked(pack: &[u8], time_s: Option<f64>) -> Vec<u8> {
    let scene = kiln_scene::load(pack).expect("what was packed loads");
    let posed = scene.pose(time_s.map(|_| 0), time_s.unwrap_or(0.0));
    let (mut document, mut binary) = chunks(pack);
    for key in ["animations", "skins", "cameras", "extensions", "extensionsUsed", "extensionsRequired"] {
        document.as_object_mut().expect("a document is an object").remove(key);
    }
    for (index, material) in &posed.materials {
        let color = json!(material.base_color_factor);
        document["materials"][index]["pbrMetallicRoughness"]["baseColorFactor"] = color;
    }
    let mut views = document["bufferViews"].as_array().cloned().unwrap_or_default();
    let (mut accessors, mut meshes) = (Vec::new(), Vec::new());
    let placed = scene.draws.iter().zip(&posed.draws).chain(scene.hidden.iter().zip(&posed.hidden));
    for (draw, at) in placed.filter(|(_, at)| at.visible) {
        let primitive = &scene.primitives[draw.primitive];
        let copies: Vec<Mat4> = draw.instances.iter().map(kiln_scene::Instance::matrix).collect();
        for copy in if copies.is_empty() { vec![Mat4::IDENTITY] } else { copies } {
            let vertices = world_vertices(&scene, draw, &posed, at.world * copy);
            let mut add = |kind: &str, width: usize, component: u32, bytes: Vec<u8>| {
                let count = bytes.len() / 4 / width;
                views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
                binary.extend(bytes);
                accessors.push(json!({ "bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind }));
                accessors.len() - 1
            };
            let three = |part: fn(&Deformed) -> glam::DVec3| -> Vec<u8> {
                bytemuck::cast_slice(&vertices.iter().map(|it| part(it).as_vec3()).collect::<Vec<Vec3>>())
                    .to_vec()
            };
            let positions = three(|vertex| vertex.position);
            let bounds: Vec<Vec3> = vertices.iter().map(|it| it.position.as_vec3()).collect();
            let normals = three(|vertex| vertex.normal);
            let coordinates: Vec<[f32; 2]> = primitive.vertices.iter().map(|vertex| vertex.uv0).collect();
            let mut attributes = json!({
                "POSITION": add("VEC3", 3, 5126, positions), "NORMAL": add("VEC3", 3, 5126, normals),
                "TEXCOORD_0": add("VEC2", 2, 5126, bytemuck::cast_slice(&coordinates).to_vec()),
            });
            if primitive.vertices.iter().any(|vertex| vertex.color != [1.0; 4]) {
                let colors: Vec<[f32; 4]> = primitive.vertices.iter().map(|vertex| vertex.color).collect();
                attributes["COLOR_0"] = json!(add("VEC4", 4, 5126, bytemuck::cast_slice(&colors).to_vec()));
            }
            let mut corners = primitive.indices.clone();
            if (at.world * copy).determinant() < 0.0 {
                corners.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
            }
            let indices = add("SCALAR", 1, 5125, bytemuck::cast_slice(&corners).to_vec());
            let at = attributes["POSITION"].as_u64().expect("an index") as usize;
            accessors[at]["min"] =
                json!(bounds.iter().copied().reduce(Vec3::min).expect("vertices").to_array());
            accessors[at]["max"] =
                json!(bounds.iter().copied().reduce(Vec3::max).expect("vertices").to_array());
            let mut mesh = json!({ "attributes": attributes, "indices": indices });
            // A pack leaves glTF's default material out.
            if primitive.material < document["materials"].as_array().map_or(0, Vec::len) {
                mesh["material"] = json!(primitive.material);
            }
            meshes.push(json!({ "primitives": [mesh] }));
        }
    }
    document["nodes"] = (0..meshes.len()).map(|mesh| json!({ "mesh": mesh })).collect();
    document["scenes"] = json!([{ "nodes": (0..meshes.len()).collect::<Vec<_>>() }]);
    document["meshes"] = json!(meshes);
    document["accessors"] = json!(accessors);
    document["bufferViews"] = json!(views);
    document["buffers"] = json!([{ "byteLength": binary.len() }]);
    packed(&(document, binary))
}

/// Frames of the pack at `times` must be those of the pose baked into vertices, and differ from each other.
fn check(name: &str, pack: &[u8], times: &[Option<f64>]) {
    let Some(mut posed) = viewer(pack) else { return };
    let bounds = kiln_scene::load(pack).expect("what was packed loads").bounds.expect("there is something");
    let camera = OrbitCamera::framing(bounds, SIZE[0] as f32 / SIZE[1] as f32);
    posed.view.camera = Some(camera);
    let mut before: Option<RgbaImage> = None;
    for &time_s in times {
        let frame = picture(&mut posed, time_s);
        keep(&frame, &format!("{name}-{}", time_s.unwrap_or(0.0)));
        let mut still = viewer(&baked(pack, time_s)).expect("there is a device");
        still.view.camera = Some(camera);
        let expected = picture(&mut still, None);
        let share = share_that_differs(&frame, &expected);
        if share > EDGE_SHARE {
            keep(&expected, &format!("{name}-{}-expected", time_s.unwrap_or(0.0)));
        }
        assert!(share <= EDGE_SHARE, "{name} at {time_s:?}: {share}");
        if let Some(before) = before {
            let share = share_that_differs(&frame, &before);
            assert!(share > 2.0 * EDGE_SHARE, "{name} at {time_s:?} is what it was before: {share}");
        }
        before = Some(frame);
    }
}

fn check_model(name: &str, times: &[Option<f64>]) {
    let Some(folder) = corpus() else { return };
    let files = [format!("{name}.gltf"), format!("{name}.glb")];
    let path = files.iter().find_map(|file| find(&folder, file)).expect("the corpus has it");
    check(name, &pack(name, &path), times);
}

#[test]
fn skinned_models_are_where_their_joints_are() {
    check_model("RiggedSimple", &[None, Some(0.5), Some(1.4)]);
    check_model("Fox", &[Some(0.3), Some(1.1), Some(2.0)]);
}

#[test]
fn morphed_models_are_the_sum_of_their_targets() {
    check_model("SimpleMorph", &[Some(1.0), Some(2.5)]);
    check_model("AnimatedMorphCube", &[None, Some(1.0), Some(2.3)]);
}

#[test]
fn copies_stand_where_their_matrices_say() {
    check_model("SimpleInstancing", &[None]);
}

/// A bar along +Y of rings of vertices, bent by two joints, thickened and shorn by two morph targets, beside copies of it that
/// are stretched and hang on a node that turns.
fn bar(material: Value) -> (Value, Vec<u8>) {
    const RINGS: usize = 25;
    const SIDES: usize = 24;
    let (mut positions, mut normals, mut joints, mut weights) = (vec![], vec![], vec![], vec![]);
    let (mut thicker, mut shorn, mut shorn_normals) = (vec![], vec![], vec![]);
    let mut indices: Vec<u32> = vec![];
    for ring in 0..RINGS {
        let height = ring as f32 / (RINGS - 1) as f32;
        for side in 0..SIDES {
            let angle = std::f32::consts::TAU * side as f32 / SIDES as f32;
            let (x, z) = (angle.sin(), angle.cos());
            positions.extend([0.2 * x, 2.0 * height, 0.2 * z]);
            normals.extend([x, 0.0, z]);
            joints.extend([0_u16, 1, 0, 0]);
            weights.extend([1.0 - height, height, 0.0, 0.0]);
            thicker.extend([0.2 * x, 0.0, 0.2 * z]);
            shorn.extend([0.5 * height, 0.0, 0.0]);
            shorn_normals.extend([0.0, -0.25 * x, 0.0]);
            if ring > 0 {
                let next = (side + 1) % SIDES;
                let [a, b] = [ring - 1, ring].map(|ring| (ring * SIDES + side) as u32);
                let [c, d] = [ring - 1, ring].map(|ring| (ring * SIDES + next) as u32);
                indices.extend([a, c, b, b, c, d]);
            }
        }
    }
    let half_turn = Quat::from_rotation_z(1.2).to_array();
    let turn = Quat::from_rotation_y(1.5).to_array();
    let rotations = [Quat::IDENTITY.to_array(), half_turn].concat();
    let turns = [Quat::IDENTITY.to_array(), turn].concat();
    let floats = |values: &[f32]| bytemuck::cast_slice::<f32, u8>(values).to_vec();
    let binds: Vec<f32> = [Mat4::IDENTITY, Mat4::from_translation(Vec3::new(0.0, -1.0, 0.0))]
        .iter()
        .flat_map(Mat4::to_cols_array)
        .collect();
    let copies = [[1.2_f32, 0.0, 0.0], [2.4, 0.3, -0.5]].concat();
    let scales = [[1.0_f32, 0.5, 2.0], [0.4, 1.0, 0.4]].concat();
    let columns: [(&str, u32, usize, Vec<u8>); 14] = [
        ("VEC3", 5126, 12, floats(&positions)),
        ("VEC3", 5126, 12, floats(&normals)),
        ("VEC4", 5123, 8, bytemuck::cast_slice(&joints).to_vec()),
        ("VEC4", 5126, 16, floats(&weights)),
        ("VEC3", 5126, 12, floats(&thicker)),
        ("VEC3", 5126, 12, floats(&shorn)),
        ("VEC3", 5126, 12, floats(&shorn_normals)),
        ("SCALAR", 5125, 4, bytemuck::cast_slice(&indices).to_vec()),
        ("MAT4", 5126, 64, floats(&binds)),
        ("SCALAR", 5126, 4, floats(&[0.0, 2.0])),
        ("VEC4", 5126, 16, floats(&rotations)),
        ("SCALAR", 5126, 4, floats(&[0.0, 0.0, 1.0, 0.7])),
        ("VEC3", 5126, 12, floats(&copies)),
        ("VEC3", 5126, 12, floats(&scales)),
    ];
    let turns = ("VEC4", 5126, 16, floats(&turns));
    let (mut binary, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    for (kind, component, size, bytes) in columns.into_iter().chain([turns]) {
        views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
        accessors.push(json!({ "bufferView": views.len() - 1, "componentType": component, "count": bytes.len() / size, "type": kind }));
        binary.extend(bytes);
    }
    accessors[0]["min"] = json!([-0.2, 0.0, -0.2]);
    accessors[0]["max"] = json!([0.2, 2.0, 0.2]);
    accessors[9]["min"] = json!([0.0]);
    accessors[9]["max"] = json!([2.0]);
    let skinned = json!({ "POSITION": 0, "NORMAL": 1, "JOINTS_0": 2, "WEIGHTS_0": 3 });
    let targets = json!([{ "POSITION": 4 }, { "POSITION": 5, "NORMAL": 6 }]);
    let copied = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 12, "SCALE": 13 } } });
    let channel = |sampler: usize, node: usize, path: &str| json!({ "sampler": sampler, "target": { "node": node, "path": path } });
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 3] }],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "nodes": [
            { "mesh": 0, "skin": 0 }, { "children": [2] }, { "translation": [0, 1, 0] },
            { "mesh": 1, "extensions": copied },
        ],
        "skins": [{ "joints": [1, 2], "inverseBindMatrices": 8 }],
        "meshes": [
            { "primitives": [{ "attributes": skinned, "indices": 7, "material": 0, "targets": targets }] },
            { "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 7, "material": 0 }] },
        ],
        "materials": [material],
        "animations": [{
            "channels": [channel(0, 2, "rotation"), channel(1, 0, "weights"), channel(2, 3, "rotation")],
            "samplers": [{ "input": 9, "output": 10 }, { "input": 9, "output": 11 }, { "input": 9, "output": 14 }],
        }],
        "buffers": [{ "byteLength": binary.len() }], "bufferViews": views, "accessors": accessors,
    });
    (document, binary)
}

fn packed((document, binary): &(Value, Vec<u8>)) -> Vec<u8> {
    let packed = kiln_scene::pack("made.glb", &glb(document, binary), &mut |_| None);
    packed.glb.unwrap_or_else(|| panic!("{:?}", packed.diagnostics))
}

fn steel() -> Value {
    json!({ "pbrMetallicRoughness": { "metallicFactor": 1, "roughnessFactor": 0.4 } })
}

#[test]
fn bar_that_is_morphed_skinned_and_copied_is_its_baked_self() {
    let pack = packed(&bar(steel()));
    let scene = kiln_scene::load(&pack).expect("what was packed loads");
    let effects: Vec<_> = scene.draws.iter().map(|draw| draw.effects().len()).collect();
    assert_eq!(effects, [2, 1], "one draw is skinned and morphed, the other copied");
    check("bar", &pack, &[None, Some(0.7), Some(2.0), None]);
}

#[test]
fn copies_that_are_blended_are_drawn_from_far_to_near() {
    let blended = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.5], "roughnessFactor": 0.1 },
        "alphaMode": "BLEND",
    });
    let pack = packed(&bar(blended));
    let (Some(mut copied), Some(mut apart)) = (viewer(&pack), viewer(&baked(&pack, None))) else { return };
    // From both ends of the row: in the file's order one of them has the nearer copy first.
    for yaw_rad in [1.3, -1.8] {
        let bounds = kiln_scene::load(&pack).expect("it loads").bounds.expect("there is something");
        let camera = OrbitCamera { yaw_rad, ..OrbitCamera::framing(bounds, 1.0) };
        (copied.view.camera, apart.view.camera) = (Some(camera), Some(camera));
        let (frame, expected) = (picture(&mut copied, None), picture(&mut apart, None));
        keep(&frame, &format!("blended-copies-{yaw_rad}"));
        let share = share_that_differs(&frame, &expected);
        assert!(share <= EDGE_SHARE, "from {yaw_rad}: {share}");
    }
}

#[test]
fn shadows_of_what_is_morphed_skinned_and_copied_are_those_of_its_baked_self() {
    /// Bounds of what moves are wider than those of its pose, so the map's texels, and shadows' edges with them, are others.
    const SHADOW_EDGE_SHARE: f64 = 0.01;
    let Some(gpu) = gpu() else { return };
    let sun = Some([-0.75, 0.5, 0.43]);
    let pack = packed(&bar(json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0 } })));
    let bounds = kiln_scene::load(&pack).expect("what was packed loads").bounds.expect("there is something");
    let camera = Some(OrbitCamera::framing(bounds, SIZE[0] as f32 / SIZE[1] as f32));
    let mut posed = viewer_in(gpu.clone(), &pack, sun);
    posed.view.camera = camera;
    for time_s in [None, Some(0.7), Some(2.0)] {
        let frame = picture(&mut posed, time_s);
        keep(&frame, &format!("bar-in-the-sun-{}", time_s.unwrap_or(0.0)));
        let mut still = viewer_in(gpu.clone(), &baked(&pack, time_s), sun);
        still.view.camera = camera;
        let share = share_that_differs(&frame, &picture(&mut still, None));
        assert!(share <= SHADOW_EDGE_SHARE, "at {time_s:?}: {share}");
        if time_s.is_some() {
            // The other shadow, on what stands where it is now.
            let mut rest = viewer_in(gpu.clone(), &baked(&pack, time_s), Some([-0.5, 0.75, 0.43]));
            rest.view.camera = camera;
            let share = share_that_differs(&frame, &picture(&mut rest, None));
            assert!(share > 2.0 * SHADOW_EDGE_SHARE, "the check sees another sun: {share}");
        }
    }
}

/// Adds an accessor; its index.
fn add_accessor(
    (document, binary): &mut (Value, Vec<u8>),
    kind: &str,
    count: usize,
    values: &[f32],
) -> usize {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    let view = json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() });
    binary.extend_from_slice(bytes);
    document["buffers"][0]["byteLength"] = json!(binary.len());
    let views = document["bufferViews"].as_array_mut().expect("a list");
    views.push(view);
    let accessor =
        json!({ "bufferView": views.len() - 1, "componentType": 5126, "count": count, "type": kind });
    let accessors = document["accessors"].as_array_mut().expect("a list");
    accessors.push(accessor);
    accessors.len() - 1
}

#[test]
fn what_appears_is_mirrored_and_changes_colour_is_its_baked_self() {
    let mut made = bar(steel());
    let mirrored = add_accessor(&mut made, "VEC3", 2, &[1.0, 1.0, 1.0, -1.0, 1.0, 1.0]);
    let colors = add_accessor(&mut made, "VEC4", 2, &[1.0, 1.0, 1.0, 1.0, 0.2, 0.8, 0.1, 1.0]);
    let appears = add_accessor(&mut made, "SCALAR", 1, &[f32::from_le_bytes([0, 1, 0, 0])]);
    let document = &mut made.0;
    document["accessors"][appears]["componentType"] = json!(5121);
    document["accessors"][appears]["count"] = json!(2);
    document["nodes"][0]["extensions"] = json!({ "KHR_node_visibility": { "visible": false } });
    let used = document["extensionsUsed"].as_array_mut().expect("a list");
    used.extend([json!("KHR_node_visibility"), json!("KHR_animation_pointer")]);
    let pointer = |sampler: usize, pointer: &str| {
        let extensions = json!({ "KHR_animation_pointer": { "pointer": pointer } });
        json!({ "sampler": sampler, "target": { "path": "pointer", "extensions": extensions } })
    };
    let animation = &mut document["animations"][0];
    animation["channels"].as_array_mut().expect("a list").extend([
        json!({ "sampler": 3, "target": { "node": 3, "path": "scale" } }),
        pointer(4, "/materials/0/pbrMetallicRoughness/baseColorFactor"),
        pointer(5, "/nodes/0/extensions/KHR_node_visibility/visible"),
    ]);
    animation["samplers"].as_array_mut().expect("a list").extend([
        json!({ "input": 9, "output": mirrored }),
        json!({ "input": 9, "output": colors }),
        json!({ "input": 9, "output": appears, "interpolation": "STEP" }),
    ]);
    let pack = packed(&made);
    assert_eq!(kiln_scene::load(&pack).expect("what was packed loads").hidden.len(), 1);
    check("turned", &pack, &[None, Some(0.7), Some(2.0), None]);
}

#[test]
fn frames_of_an_animation_allocate_nothing_on_the_device() {
    if gpu().is_none() {
        return;
    }
    // A device of its own: the other tests allocate on theirs.
    let mut viewer = viewer_on(Gpu::headless().expect("there is one"), &packed(&bar(steel())));
    viewer.resize([32, 18]);
    let allocated = |viewer: &mut HeadlessViewer, frames: std::ops::Range<u32>| {
        for frame in frames {
            viewer.view.animation = Some(AnimationTime { index: 0, time_s: f64::from(frame) * 2e-3 });
            viewer.draw().expect("the device draws");
        }
        let report = viewer.gpu().device.generate_allocator_report()?;
        Some((report.allocations.len(), report.total_allocated_bytes))
    };
    let early = allocated(&mut viewer, 0..10);
    assert_eq!(allocated(&mut viewer, 10..1000), early);
}

#[test]
fn material_variant_changes_materials_and_an_unknown_one_is_said() {
    let mut made = bar(steel());
    let red =
        json!({ "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] }, "emissiveFactor": [0.5, 0, 0] });
    made.0["materials"].as_array_mut().expect("a list").push(red);
    made.0["extensionsUsed"].as_array_mut().expect("a list").push(json!("KHR_materials_variants"));
    made.0["extensions"] =
        json!({ "KHR_materials_variants": { "variants": [{ "name": "cold" }, { "name": "hot" }] } });
    let mapping = json!({ "KHR_materials_variants": { "mappings": [{ "material": 1, "variants": [1] }] } });
    made.0["meshes"][0]["primitives"][0]["extensions"] = mapping;
    let Some(mut viewer) = viewer(&packed(&made)) else { return };
    let first = picture(&mut viewer, None);
    let select = |viewer: &mut HeadlessViewer, variant: &str| {
        viewer.select(Selection { variant: Some(variant.to_owned()), ..Selection::default() })
    };
    let report = select(&mut viewer, "hot");
    assert_eq!((report.diagnostics, report.shown.variant.as_deref()), (vec![], Some("hot")));
    assert_eq!(report.variants, ["cold", "hot"]);
    assert!(share_that_differs(&first, &picture(&mut viewer, None)) > 0.02);
    let report = select(&mut viewer, "no such");
    assert_eq!(report.shown.variant, None);
    let is_said = |note: &String| note.contains("`no such`") && note.contains("cold, hot");
    assert!(report.notes.iter().any(is_said), "{:?}", report.notes);
    assert_eq!(share_that_differs(&first, &picture(&mut viewer, None)), 0.0);
}

#[test]
fn shader_that_knows_nothing_of_joints_is_named() {
    let Some(gpu) = gpu() else { return };
    let mut build = Build::new();
    build.shaders(&[&[]]).lut().env("sky", SIX_COLORS).scene("bar", "sky", packed(&bar(steel())));
    let report = HeadlessViewer::new(gpu, SIZE).apply(&build.revision());
    for feature in ["skin", "morph", "instancing"] {
        let is_said = |note: &String| note.starts_with(&format!("`{feature}` of 1 draws is not drawn"));
        assert!(report.notes.iter().any(is_said), "{feature}: {:?}", report.notes);
    }
}

#[test]
fn shader_that_reads_joints_draws_a_mesh_without_any_as_it_is() {
    let (Some(gpu), material) = (gpu(), json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.5 } })) else {
        return;
    };
    let mut build = Build::ball(material);
    let mut viewer = HeadlessViewer::new(gpu, SIZE);
    viewer.apply(&build.revision());
    let plain = picture(&mut viewer, None);
    build.shaders(&[&["instancing", "morph", "skin"]]);
    let deforming = build.table.targets["shader/pbr/instancing+morph+skin"].clone();
    build.table.targets.insert("shader/pbr/base".to_owned(), deforming);
    let report = viewer.apply(&build.revision());
    assert_eq!(report.diagnostics, vec![]);
    assert_eq!(report.made, ["shader/pbr/base"]);
    assert!(share_that_differs(&plain, &picture(&mut viewer, None)) <= EDGE_SHARE);
}

#[test]
fn storage_buffer_of_something_else_is_refused_by_name() {
    let Some(gpu) = gpu() else { return };
    let text = "
        @group(2) @binding(1) var<storage, read> joint_matrices: array<vec4f>;
        @vertex fn vs_main(@location(0) position: vec3f, @location(1) joints: vec4u) -> @builtin(position) vec4f {
            return vec4f(position, 1.0) + joint_matrices[joints.x];
        }
        @fragment fn fs_main() -> @location(0) vec4f { return vec4f(1.0); }";
    let mut build = Build::ball(json!({}));
    build.shader_text("pbr", "material", text);
    let report = HeadlessViewer::new(gpu, SIZE).apply(&build.revision());
    let messages: Vec<&str> = report.diagnostics.iter().map(|it| it.message.as_str()).collect();
    let expected = "`shader/pbr/base` declares `joint_matrices` as something else than a read-only storage buffer of array<mat4x4f>";
    assert!(messages.contains(&expected), "{messages:?}");
}

#[test]
fn camera_of_the_file_moves_with_its_node() {
    let mut made = bar(steel());
    let document = &mut made.0;
    document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }]);
    document["nodes"][3]["children"] = json!([4]);
    let nodes = document["nodes"].as_array_mut().expect("a list");
    nodes.push(json!({ "camera": 0, "translation": [0.5, 1, 8], "name": "dolly" }));
    let pack = packed(&made);
    let scene = kiln_scene::load(&pack).expect("what was packed loads");
    assert_eq!(OrbitCamera::names(&scene), ["dolly"]);
    let Some(mut viewer) = viewer(&pack) else { return };
    let moved = picture(&mut viewer, Some(2.0));
    let (cameras, aspect) = (scene.pose(Some(0), 2.0).cameras, SIZE[0] as f32 / SIZE[1] as f32);
    viewer.view.camera = Some(OrbitCamera::for_scene(scene.bounds, &cameras, 0, aspect));
    assert_eq!(share_that_differs(&moved, &picture(&mut viewer, Some(2.0))), 0.0);
    viewer.view.camera = Some(OrbitCamera::for_scene(scene.bounds, &scene.cameras, 0, aspect));
    assert!(share_that_differs(&moved, &picture(&mut viewer, Some(2.0))) > 0.05);
}
