//! The sample scene: six balls, a material each, on two rows of pedestals.

use serde_json::{Value, json};

use crate::ball::{core, ground, shells, stand};
use crate::profile::Surface;

/// A ball of the scene.
struct Ball {
    name: &'static str,
    place: [f64; 3],
}

/// Height of the back row's pedestals.
const BACK_ROW: f64 = 1.75;

/// In the order of the materials in [`materials`].
const BALLS: [Ball; 6] = [
    Ball { name: "brushed gold", place: [-2.75, 0.0, 1.3] },
    Ball { name: "car paint", place: [0.0, 0.0, 1.9] },
    Ball { name: "velvet", place: [2.75, 0.0, 1.3] },
    Ball { name: "glossy plastic", place: [-2.55, BACK_ROW, -1.5] },
    Ball { name: "tiles", place: [0.0, BACK_ROW, -1.9] },
    Ball { name: "flat colour", place: [2.55, BACK_ROW, -1.5] },
];

/// The .gltf text and its .bin. Textures are `textures/tiles_*.png` beside it.
pub(crate) fn material_balls() -> (String, Vec<u8>) {
    let mut file = File::default();
    let [upper, lower] = shells().map(|surface| file.surface(&surface));
    let core = file.surface(&core());
    let (low, high) = (file.surface(&stand(0.09)), file.surface(&stand(BACK_ROW)));
    let ground = file.surface(&ground(6.2));
    let (neutral, floor) = (BALLS.len(), BALLS.len() + 1);
    let part = |surface: &Value, material: usize| {
        let mut part = surface.clone();
        part["material"] = json!(material);
        part
    };
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for (material, ball) in BALLS.iter().enumerate() {
        let stand = if ball.place[1] > 0.0 { &high } else { &low };
        let primitives =
            [part(&upper, material), part(&lower, material), part(&core, neutral), part(stand, neutral)];
        meshes.push(json!({"name": ball.name, "primitives": primitives}));
        nodes.push(json!({"name": ball.name, "mesh": material, "translation": ball.place}));
    }
    meshes.push(json!({"name": "ground", "primitives": [part(&ground, floor)]}));
    nodes.push(json!({"name": "ground", "mesh": meshes.len() - 1}));
    nodes.push(camera_node());
    let scene_nodes: Vec<usize> = (0..nodes.len()).collect();
    let root = json!({
        "asset": {"version": "2.0", "generator": "kiln init"},
        "extensionsUsed": ["KHR_materials_clearcoat", "KHR_materials_sheen", "KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"name": "material balls", "nodes": scene_nodes}],
        "nodes": nodes,
        "meshes": meshes,
        "cameras": [camera()],
        "materials": materials(),
        "textures": [{"sampler": 0, "source": 0}, {"sampler": 0, "source": 1}, {"sampler": 0, "source": 2}],
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}],
        "images": TEXTURES.map(|name| json!({"uri": format!("textures/{name}")})),
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"uri": "material_balls.bin", "byteLength": file.bin.len()}],
    });
    (format!("{root:#}\n"), file.bin)
}

/// Names of the images, in the order of the scene's textures.
pub(crate) const TEXTURES: [&str; 3] =
    ["tiles_base_color.png", "tiles_normal.png", "tiles_occlusion_roughness_metallic.png"];

fn materials() -> Value {
    json!([
        {"name": "brushed_gold", "pbrMetallicRoughness":
            {"baseColorFactor": [1.0, 0.76, 0.33, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.25}},
        {"name": "car_paint", "pbrMetallicRoughness":
            {"baseColorFactor": [0.30, 0.008, 0.012, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.5},
         "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.03}}},
        {"name": "velvet", "pbrMetallicRoughness":
            {"baseColorFactor": [0.035, 0.012, 0.085, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
         "extensions": {"KHR_materials_sheen":
            {"sheenColorFactor": [0.42, 0.30, 0.72], "sheenRoughnessFactor": 0.38}}},
        {"name": "glossy_plastic", "pbrMetallicRoughness":
            {"baseColorFactor": [0.015, 0.19, 0.33, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.12}},
        {"name": "tiles", "pbrMetallicRoughness":
            {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 2}},
         "normalTexture": {"index": 1}, "occlusionTexture": {"index": 2}},
        {"name": "flat_colour", "pbrMetallicRoughness":
            {"baseColorFactor": [0.90, 0.36, 0.07, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
         "extensions": {"KHR_materials_unlit": {}}},
        {"name": "neutral_stand", "pbrMetallicRoughness":
            {"baseColorFactor": [0.09, 0.09, 0.095, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.55}},
        {"name": "ground", "pbrMetallicRoughness":
            {"baseColorFactor": [0.40, 0.375, 0.345, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}},
    ])
}

fn camera() -> Value {
    json!({"type": "perspective", "perspective": {"aspectRatio": 16.0 / 9.0, "yfov": 0.46, "znear": 0.1, "zfar": 100.0}})
}

/// Looks down a little at the middle of the two rows, from in front (+Z).
fn camera_node() -> Value {
    let (target, distance, down) = ([0.0, 1.85, 0.0], 13.8, crate::profile::radians(13.0));
    let (sin, cos) = (libm::sin(down), libm::cos(down));
    let place = [target[0], target[1] + distance * sin, target[2] + distance * cos];
    json!({
        "name": "main", "camera": 0,
        "translation": place,
        "rotation": [-libm::sin(down / 2.0), 0.0, 0.0, libm::cos(down / 2.0)],
    })
}

/// The file's tables as they grow.
#[derive(Default)]
struct File {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    /// Adds a surface and returns a primitive without a material.
    fn surface(&mut self, surface: &Surface) -> Value {
        let position = self.floats(&surface.positions, 34962);
        let (min, max) = bounds(&surface.positions);
        self.accessors[position]["min"] = json!(min);
        self.accessors[position]["max"] = json!(max);
        let normal = self.floats(&surface.normals, 34962);
        let mut attributes = json!({"POSITION": position, "NORMAL": normal});
        if !surface.uvs.is_empty() {
            attributes["TEXCOORD_0"] = json!(self.floats(&surface.uvs, 34962));
        }
        let bytes: Vec<u8> = surface.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, 34963);
        let indices = self.accessor(view, 5123, surface.indices.len(), "SCALAR");
        json!({"attributes": attributes, "indices": indices})
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], target: u32) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        self.accessor(view, 5126, values.len(), &format!("VEC{N}"))
    }

    fn view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bin.len(), bytes.len());
        self.bin.extend_from_slice(bytes);
        self.views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": length, "target": target}));
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, component_type: u32, count: usize, kind: &str) -> usize {
        self.accessors
            .push(json!({"bufferView": view, "componentType": component_type, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
}

fn bounds(positions: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    let fold = |start: f32, pick: fn(f32, f32) -> f32| {
        positions.iter().fold([start; 3], |bound, at| std::array::from_fn(|axis| pick(bound[axis], at[axis])))
    };
    (fold(f32::INFINITY, f32::min), fold(f32::NEG_INFINITY, f32::max))
}
