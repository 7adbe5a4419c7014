//! A scene for each effect, and what follows from it.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::Effect;

/// Values of a scene by JSON pointer.
pub(super) type Patch = Vec<(&'static str, Value)>;

/// One effect: how a scene calls for it, and what that brings and takes.
pub(super) struct Row {
    pub effect: Effect,
    /// Those that it does nothing without.
    pub beside: Vec<Effect>,
    /// What the scene has before, which is what they need.
    pub before: Patch,
    /// What calls for the effect.
    pub with: Patch,
    /// The same with values that do nothing; `None` where there are none.
    pub idle: Option<Patch>,
    /// Actions that run besides packing and the variant's compilation.
    pub runs: &'static [&'static str],
    /// Targets that come besides the variant's.
    pub comes: &'static [&'static str],
    /// Targets that go besides the variant's.
    pub goes: &'static [&'static str],
    /// Targets with other content or facts besides the scene's.
    pub changes: &'static [&'static str],
    /// What names of the shader's interface and text begin with that belong to it.
    pub shader: &'static [&'static str],
    /// Keys and values of a pack that belong to it.
    pub pack: &'static [&'static str],
}

impl Row {
    fn new(effect: Effect, with: Patch, idle: Patch) -> Row {
        Row {
            effect,
            beside: Vec::new(),
            before: Vec::new(),
            with,
            idle: Some(idle),
            runs: &[],
            comes: &[],
            goes: &[],
            changes: &[],
            shader: &[],
            pack: &[],
        }
    }

    /// Its names in the shader and in packs.
    fn owns(self, shader: &'static [&'static str], pack: &'static [&'static str]) -> Row {
        Row { shader, pack, ..self }
    }

    fn beside(self, beside: &[Effect], before: Patch) -> Row {
        Row { beside: beside.to_vec(), before, ..self }
    }

    /// What it is drawn with before and after.
    pub fn sets(&self) -> [BTreeSet<Effect>; 2] {
        let before: BTreeSet<Effect> = self.beside.iter().copied().collect();
        let mut with = before.clone();
        with.insert(self.effect);
        [before, with]
    }
}

/// The scene of a patch: a triangle of a dielectric of roughness 1. Every accessor and texture of any row is in the file, as
/// exporters leave them, so that what a pack has is what it calls for.
pub(super) fn scene(patches: &[&Patch]) -> String {
    let extensions: Vec<String> = MATERIAL_EXTENSIONS.map(|name| format!("KHR_materials_{name}")).into();
    let textures: Vec<Value> = (0..TEXTURES.len()).map(|source| json!({ "source": source })).collect();
    let images: Vec<Value> = TEXTURES.iter().map(|(uri, _)| json!({ "uri": uri })).collect();
    let (accessors, views, bytes) = accessors();
    let mut scene = json!({
        "asset": {"version": "2.0"}, "extensionsUsed": extensions, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "thing", "mesh": 0}],
        "meshes": [{"primitives": [{"material": 0,
            "attributes": {"POSITION": POSITION, "NORMAL": NORMAL, "TEXCOORD_0": UV}}]}],
        "materials": [{"name": "thing", "pbrMetallicRoughness": {"metallicFactor": 0}}],
        "textures": textures, "images": images, "accessors": accessors, "bufferViews": views,
        "buffers": [{"uri": GEOMETRY, "byteLength": bytes.len()}],
    });
    let used = scene["extensionsUsed"].as_array_mut().unwrap();
    used.extend(["EXT_mesh_gpu_instancing", "KHR_lights_punctual"].map(Value::from));
    for (pointer, value) in patches.iter().copied().flatten() {
        set(&mut scene, pointer, value.clone());
    }
    scene.to_string()
}

fn set(root: &mut Value, pointer: &str, value: Value) {
    let mut place = root;
    for key in pointer.split('/').skip(1) {
        place = match key.parse::<usize>() {
            Ok(index) => &mut place[index],
            Err(_) => &mut place[key],
        };
    }
    *place = value;
}

const MATERIAL_EXTENSIONS: [&str; 11] = [
    "anisotropy",
    "clearcoat",
    "diffuse_transmission",
    "dispersion",
    "iridescence",
    "sheen",
    "specular",
    "transmission",
    "unlit",
    "volume",
    "emissive_strength",
];

pub(super) const GEOMETRY: &str = "geometry.bin";

/// Files of one texel.
pub(super) const TEXTURES: [(&str, [u8; 3]); 4] = [
    ("flat.png", [128, 128, 255]),
    ("bump.png", [160, 120, 240]),
    ("white.png", [255; 3]),
    ("dark.png", [9; 3]),
];
const FLAT: usize = 0;
const BUMP: usize = 1;
const WHITE: usize = 2;
const DARK: usize = 3;

// Accessors, in the order of `accessors`.
const POSITION: usize = 0;
const NORMAL: usize = 1;
const UV: usize = 2;
const TINTED: usize = 3;
const UNTINTED: usize = 4;
const JOINTS: usize = 5;
const WEIGHTS: usize = 6;
const TWO_PLACES: usize = 7;
const ONE_PLACE: usize = 8;
const TIMES: usize = 9;
const MOVES: usize = 10;
const STAYS: usize = 11;
const GROWS: usize = 12;
const KEEPS: usize = 13;

/// Accessors, their buffer views, and the buffer's bytes.
pub(super) fn accessors() -> (Vec<Value>, Vec<Value>, Vec<u8>) {
    let floats: [(&str, usize, &[f32]); 14] = [
        ("VEC3", 3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        ("VEC3", 3, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
        ("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
        ("VEC3", 3, &[1.0, 0.5, 1.0, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0]),
        ("VEC3", 3, &[1.0; 9]),
        // Of type u8 below: joint 0 throughout.
        ("VEC4", 4, &[0.0; 3]),
        ("VEC4", 4, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        ("VEC3", 3, &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]),
        ("VEC3", 3, &[0.0; 3]),
        ("SCALAR", 1, &[0.0, 1.0]),
        ("VEC3", 3, &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        ("VEC3", 3, &[0.0; 6]),
        ("SCALAR", 1, &[0.0, 1.0]),
        ("SCALAR", 1, &[0.0; 2]),
    ];
    let (mut accessors, mut views, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (kind, width, values)) in floats.into_iter().enumerate() {
        let (component_type, count) = if index == JOINTS { (5121, 3) } else { (5126, values.len() / width) };
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": values.len() * 4}));
        let mut accessor =
            json!({"bufferView": index, "componentType": component_type, "count": count, "type": kind});
        if index == POSITION {
            (accessor["min"], accessor["max"]) = (json!([0, 0, 0]), json!([1, 1, 0]));
        }
        accessors.push(accessor);
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    (accessors, views, bytes)
}

/// A value of a material extension.
fn extension(pointer: &'static str, on: f64, off: f64) -> [Patch; 2] {
    [on, off].map(|value| vec![(pointer, json!(value))])
}

fn row(effect: Effect, [with, idle]: [Patch; 2]) -> Row {
    Row::new(effect, with, idle)
}

fn alpha(mode: &str, alpha: f64) -> Patch {
    let color = json!([1, 1, 1, alpha]);
    vec![
        ("/materials/0/alphaMode", json!(mode)),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", color),
    ]
}

fn textured(slot: &'static str, texture: usize) -> Patch {
    vec![(slot, json!({ "index": texture }))]
}

fn colored(accessor: usize) -> Patch {
    vec![("/meshes/0/primitives/0/attributes/COLOR_0", json!(accessor))]
}

/// A curve over one second that a node's path follows.
fn animation(node: usize, path: &str, output: usize) -> (&'static str, Value) {
    let value = json!([{"channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
        "samplers": [{"input": TIMES, "output": output}]}]);
    ("/animations", value)
}

fn skinned(output: usize) -> Patch {
    vec![
        ("/meshes/0/primitives/0/attributes/JOINTS_0", json!(JOINTS)),
        ("/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(WEIGHTS)),
        ("/skins", json!([{ "joints": [1] }])),
        ("/nodes", json!([{"name": "thing", "mesh": 0, "skin": 0}, {"name": "hip"}])),
        ("/scenes/0/nodes", json!([0, 1])),
        animation(1, "translation", output),
    ]
}

fn morphed(output: usize) -> Patch {
    let target = json!([{ "POSITION": NORMAL }]);
    vec![("/meshes/0/primitives/0/targets", target), animation(0, "weights", output)]
}

fn copied(places: usize) -> Patch {
    let attributes = json!({ "TRANSLATION": places });
    vec![("/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes", attributes)]
}

fn lamp(intensity: f64) -> Patch {
    let lights = json!([{"type": "point", "intensity": intensity}]);
    let lamp = json!({"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}});
    vec![
        ("/extensions/KHR_lights_punctual/lights", lights),
        ("/nodes", json!([{"name": "thing", "mesh": 0}, lamp])),
        ("/scenes/0/nodes", json!([0, 1])),
    ]
}

fn glass() -> Patch {
    extension("/materials/0/extensions/KHR_materials_transmission/transmissionFactor", 1.0, 0.0)[0].clone()
}

fn thick() -> Patch {
    extension("/materials/0/extensions/KHR_materials_volume/thicknessFactor", 0.5, 0.0)[0].clone()
}

/// One for each effect, in groups that share no action: what one row makes, no other of its group brings.
pub(super) fn groups() -> [Vec<Row>; 4] {
    [materials().into(), glasses().into(), layers().into(), geometries().into()]
}

/// All of them.
pub(super) fn rows() -> Vec<Row> {
    groups().into_iter().flatten().collect()
}

fn materials() -> [Row; 8] {
    let unlit = vec![("/materials/0/extensions/KHR_materials_unlit", json!({}))];
    let emissive = |value: f64| vec![("/materials/0/emissiveFactor", json!([value, value, value]))];
    let normal = "/materials/0/normalTexture";
    let occlusion = "/materials/0/occlusionTexture";
    let specular = "/materials/0/extensions/KHR_materials_specular/specularFactor";
    [
        // It is arithmetic on values that opaque materials have too.
        row(Effect::AlphaBlend, [alpha("BLEND", 0.5), alpha("BLEND", 1.0)]).owns(&[], &["BLEND"]),
        row(Effect::AlphaMask, [alpha("MASK", 0.4), alpha("MASK", 1.0)]).owns(&["alpha_cutoff"], &["MASK"]),
        row(Effect::Emission, [emissive(1.0), emissive(0.0)]).owns(&["emissive_"], &["emissiveFactor"]),
        row(Effect::NormalMap, [textured(normal, BUMP), textured(normal, FLAT)]).owns(
            &["normal_texture", "normal_scale", "normal_uv_", "tangent"],
            &["normalTexture", "TANGENT", "images", "textures"],
        ),
        row(Effect::Occlusion, [textured(occlusion, DARK), textured(occlusion, WHITE)])
            .owns(&["occlusion_texture", "occlusion_strength"], &["occlusionTexture", "images", "textures"]),
        row(Effect::Specular, extension(specular, 0.5, 1.0))
            .owns(&["specular_factor", "specular_color_"], &["KHR_materials_specular"]),
        row(Effect::VertexColor, [colored(TINTED), colored(UNTINTED)]).owns(&[], &["COLOR_0"]),
        Row {
            idle: None,
            goes: &[
                "env/room/accuracy",
                "env/room/irradiance",
                "env/room/sh",
                "env/room/specular",
                "lut/ggx",
            ],
            changes: &["project"],
            ..Row::new(Effect::Unlit, unlit, Vec::new()).owns(&[], &["KHR_materials_unlit"])
        },
    ]
}

fn glasses() -> [Row; 4] {
    let transmission = "/materials/0/extensions/KHR_materials_transmission/transmissionFactor";
    let thickness = "/materials/0/extensions/KHR_materials_volume/thicknessFactor";
    let dispersion = "/materials/0/extensions/KHR_materials_dispersion/dispersion";
    let diffuse = "/materials/0/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionFactor";
    [
        row(Effect::Transmission, extension(transmission, 1.0, 0.0))
            .owns(&["scene_color", "transmission_"], &["KHR_materials_transmission"]),
        row(Effect::Volume, extension(thickness, 0.5, 0.0))
            .beside(&[Effect::Transmission], glass())
            .owns(&["attenuation_", "thickness_"], &["KHR_materials_volume"]),
        Row {
            // Red is bent less than green, so that it is read sharper.
            runs: &["measure env/room/specular", "prefilter env/room/specular mip 2"],
            changes: &["env/room/accuracy", "env/room/specular"],
            ..row(Effect::Dispersion, extension(dispersion, 2.0, 0.0))
                .beside(&[Effect::Transmission, Effect::Volume], [glass(), thick()].concat())
                .owns(&["dispersion"], &["KHR_materials_dispersion"])
        },
        row(Effect::DiffuseTransmission, extension(diffuse, 0.5, 0.0))
            .owns(&["diffuse_transmission_"], &["KHR_materials_diffuse_transmission"]),
    ]
}

fn layers() -> [Row; 5] {
    let strength = "/materials/0/extensions/KHR_materials_anisotropy/anisotropyStrength";
    let coat = "/materials/0/extensions/KHR_materials_clearcoat/clearcoatFactor";
    let film = "/materials/0/extensions/KHR_materials_iridescence/iridescenceFactor";
    let cloth = |color: f64| {
        let values = json!({"sheenColorFactor": [color, color, color], "sheenRoughnessFactor": 0.5});
        vec![("/materials/0/extensions/KHR_materials_sheen", values)]
    };
    [
        row(Effect::Anisotropy, extension(strength, 0.5, 0.0))
            .owns(&["anisotropy_", "tangent"], &["KHR_materials_anisotropy", "TANGENT"]),
        Row {
            // Its roughness is 0, filtered up to 0.65: the levels of 0, 1/3 and 2/3 beside that of 1.
            runs: &[
                "measure env/room/specular",
                "prefilter env/room/specular mip 1",
                "prefilter env/room/specular mip 2",
            ],
            changes: &["env/room/accuracy", "env/room/specular"],
            ..row(Effect::Clearcoat, extension(coat, 1.0, 0.0))
                .owns(&["clearcoat_"], &["KHR_materials_clearcoat"])
        },
        row(Effect::Iridescence, extension(film, 1.0, 0.0))
            .owns(&["iridescence_"], &["KHR_materials_iridescence"]),
        row(Effect::PunctualLights, [lamp(1.0), lamp(0.0)])
            .owns(&["lights", "Punctual"], &["KHR_lights_punctual"]),
        Row {
            runs: &[
                "analyse env/room/sheen",
                "integrate lut/charlie",
                "measure env/room/sheen",
                "prefilter sheen env/room/sheen mip 1",
                "prefilter sheen env/room/sheen mip 2",
            ],
            comes: &["env/room/sheen", "lut/charlie"],
            changes: &["env/room/accuracy"],
            ..row(Effect::Sheen, [cloth(1.0), cloth(0.0)])
                .owns(&["sheen_", "env_sheen", "lut_charlie"], &["KHR_materials_sheen"])
        },
    ]
}

fn geometries() -> [Row; 3] {
    [
        row(Effect::Instancing, [copied(TWO_PLACES), copied(ONE_PLACE)])
            .owns(&["instance"], &["EXT_mesh_gpu_instancing"]),
        row(Effect::Morph, [morphed(GROWS), morphed(KEEPS)]).owns(&["morph"], &["targets", "animations"]),
        row(Effect::Skin, [skinned(MOVES), skinned(STAYS)])
            .owns(&["joint"], &["skins", "JOINTS_0", "WEIGHTS_0"]),
    ]
}
