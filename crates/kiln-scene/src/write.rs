//! Writes an imported scene as one normalised GLB.
//!
//! One buffer; each primitive a mesh of its own with interleaved floats and only the attributes it needs;
//! images in buffer views; each draw, camera and light a top node with its world matrix, or the child of a node
//! that moves (`write_motion`). Matrices may shear, which a tool that insists on translation, rotation and scale
//! will remark.

use std::collections::{BTreeMap, BTreeSet};

use glam::Mat4;

use crate::container::join;
use crate::geometry::NEUTRAL;
use crate::import::Imported;
use crate::schema::{
    Accessor, Asset, Buffer, BufferView, Image, LightIndex, Lights, Mesh, Node, Primitive, Root,
};
use crate::{Draw, Effect, Item, Material, Vertex, schema};

/// Marks files whose `asset.extras.notes` come from here.
pub(crate) const GENERATOR: &str = "kiln";

pub(crate) const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The scene's bytes. Serialising cannot fail: the types hold no maps with keys other than text, and the
/// import leaves no number that JSON cannot say.
pub(crate) fn write(imported: &Imported) -> Result<Vec<u8>, serde_json::Error> {
    let mut writer = Writer { root: Root::default(), bin: Vec::with_capacity(size_at_most(imported)) };
    let notes = &imported.scene.notes;
    writer.root.asset = Asset {
        version: "2.0".into(),
        generator: Some(GENERATOR.into()),
        extras: Some(serde_json::json!({ "notes": notes })),
    };
    let scene = &imported.scene;
    let mut materials: Vec<Vec<&Material>> =
        scene.primitives.iter().map(|primitive| vec![&scene.materials[primitive.material]]).collect();
    for variant in &scene.variant_materials {
        materials[variant.primitive].push(&scene.materials[variant.material]);
    }
    for (primitive, materials) in scene.primitives.iter().zip(&materials) {
        writer.mesh(primitive, materials);
    }
    for (mime_type, bytes) in &imported.pictures {
        let buffer_view = Some(writer.view(bytes, None, None));
        writer.root.images.push(Image { mime_type: Some((*mime_type).into()), buffer_view, uri: None });
    }
    writer.root.materials.clone_from(&imported.materials);
    writer.root.textures.clone_from(&imported.textures);
    writer.root.samplers.clone_from(&imported.samplers);
    let first_node = writer.nodes(imported);
    writer.animations(&imported.scene.animations, first_node);
    writer.variants(&imported.scene);
    writer.root.extensions_used = extensions_used(&writer.root);
    if !writer.bin.is_empty() {
        writer.root.buffers.push(Buffer { uri: None, byte_length: writer.bin.len() as u64 });
    }
    Ok(join(serde_json::to_vec(&writer.root)?, writer.bin))
}

/// A bound of the GLB's size, but for its JSON; memory that is not written to costs nothing.
fn size_at_most(imported: &Imported) -> usize {
    const FRONT: usize = 1 << 20;
    let geometry = imported.scene.primitives.iter();
    let geometry = geometry.map(|it| it.vertices.len() * size_of::<Vertex>() + it.indices.len() * 4 + 8);
    FRONT
        + geometry.sum::<usize>()
        + imported.pictures.iter().map(|(_, bytes)| bytes.len() + 4).sum::<usize>()
}

pub(crate) struct Writer {
    pub root: Root,
    bin: Vec<u8>,
}

impl Writer {
    pub fn view(&mut self, bytes: &[u8], byte_stride: Option<u64>, target: Option<u32>) -> usize {
        self.view_of(byte_stride, target, |bin| bin.extend_from_slice(bytes))
    }

    /// A view of what `append` appends, so that large data needs no buffer of its own.
    fn view_of(
        &mut self,
        byte_stride: Option<u64>,
        target: Option<u32>,
        append: impl FnOnce(&mut Vec<u8>),
    ) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        append(&mut self.bin);
        let (byte_offset, byte_length) = (start as u64, (self.bin.len() - start) as u64);
        let view = BufferView { byte_offset, byte_length, byte_stride, target, ..BufferView::default() };
        self.root.buffer_views.push(view);
        self.root.buffer_views.len() - 1
    }

    pub fn accessor(&mut self, accessor: Accessor) -> usize {
        self.root.accessors.push(accessor);
        self.root.accessors.len() - 1
    }

    fn mesh(&mut self, primitive: &crate::Primitive, materials: &[&Material]) {
        let columns = columns(&primitive.vertices, materials);
        let width: usize = columns.iter().map(|column| column.width).sum();
        let view = self.view_of(Some(4 * width as u64), Some(ARRAY_BUFFER), |bin| {
            for vertex in &primitive.vertices {
                for column in &columns {
                    bin.extend_from_slice(bytemuck::cast_slice(&(column.read)(vertex)[..column.width]));
                }
            }
        });
        let mut attributes = BTreeMap::new();
        let mut byte_offset = 0;
        for column in &columns {
            let bounds = (column.name == "POSITION").then_some(primitive.bounds);
            let accessor = Accessor {
                buffer_view: Some(view),
                byte_offset,
                component_type: FLOAT,
                normalized: false,
                count: primitive.vertices.len() as u64,
                kind: format!("VEC{}", column.width),
                min: bounds.map(|bounds| bounds.min.to_array().to_vec()),
                max: bounds.map(|bounds| bounds.max.to_array().to_vec()),
                sparse: None,
            };
            byte_offset += 4 * column.width as u64;
            attributes.insert(column.name.to_owned(), self.accessor(accessor));
        }
        let indices = Some(self.indices(&primitive.indices, primitive.vertices.len()));
        let material = Some(primitive.material);
        let primitive = Primitive { attributes, indices, material, ..Primitive::default() };
        self.root.meshes.push(Mesh { primitives: vec![primitive], weights: Vec::new() });
    }

    fn indices(&mut self, indices: &[u32], vertex_count: usize) -> usize {
        // 65535 itself is reserved for primitive restart.
        let narrow = vertex_count <= usize::from(u16::MAX);
        let view = self.view_of(None, Some(ELEMENT_ARRAY_BUFFER), |bin| {
            if narrow {
                indices.iter().for_each(|&index| bin.extend_from_slice(&(index as u16).to_le_bytes()));
            } else {
                indices.iter().for_each(|index| bin.extend_from_slice(&index.to_le_bytes()));
            }
        });
        self.accessor(Accessor {
            buffer_view: Some(view),
            byte_offset: 0,
            component_type: if narrow { UNSIGNED_SHORT } else { UNSIGNED_INT },
            normalized: false,
            count: indices.len() as u64,
            kind: "SCALAR".into(),
            min: None,
            max: None,
            sparse: None,
        })
    }

    /// Writes what stands still, then what moves; returns the number of the first node that does.
    fn nodes(&mut self, imported: &Imported) -> usize {
        let scene = &imported.scene;
        let make = |item: Item, matrix: Mat4| match item {
            Item::Draw(at) => draw_node(&scene.draws[at], matrix),
            Item::Hidden(at) => draw_node(&scene.hidden[at], matrix),
            Item::Camera(at) => {
                Node { camera: Some(at), ..node(Some(scene.cameras[at].name.clone()), matrix) }
            }
            Item::Light(at) => {
                let mut node = node(None, matrix);
                node.extensions.light = Some(LightIndex { light: at });
                node
            }
        };
        let carried: BTreeSet<Item> = scene.carried.iter().map(|carried| carried.item).collect();
        let draws = scene.draws.iter().enumerate().map(|(at, draw)| (Item::Draw(at), draw.world));
        let cameras = scene.cameras.iter().enumerate().map(|(at, camera)| (Item::Camera(at), camera.world));
        let lights = imported.lights.iter().enumerate().map(|(at, (_, world))| (Item::Light(at), *world));
        let still = draws.chain(cameras).chain(lights).filter(|(item, _)| !carried.contains(item));
        self.root.nodes.extend(still.map(|(item, world)| make(item, world)));
        let first = self.hierarchy(scene, &make);
        self.root.cameras.clone_from(&imported.cameras);
        let lights = Lights { lights: imported.lights.iter().map(|(light, _)| light.clone()).collect() };
        self.root.extensions.lights = (!lights.lights.is_empty()).then_some(lights);
        let tops = scene.nodes.iter().enumerate().filter(|(_, node)| node.parent.is_none());
        let nodes = (0..first).chain(tops.map(|(at, _)| first + at)).collect();
        self.root.scenes.push(schema::SceneNodes { nodes });
        self.root.scene = Some(0);
        first
    }
}

fn draw_node(draw: &Draw, matrix: Mat4) -> Node {
    Node { mesh: Some(draw.primitive), ..node(Some(draw.name.clone()), matrix) }
}

pub(crate) fn node(name: Option<String>, world: Mat4) -> Node {
    let matrix = (world != Mat4::IDENTITY).then(|| world.to_cols_array());
    Node { name, matrix, ..Node::default() }
}

struct Column {
    name: &'static str,
    width: usize,
    read: fn(&Vertex) -> [f32; 4],
}

/// Attributes that one of the materials reads or that differ from the neutral value. Absent normals and tangents
/// would be made up by whoever reads the pack, so they are written even where they are neutral.
fn columns(vertices: &[Vertex], materials: &[&Material]) -> Vec<Column> {
    let lit = materials.iter().any(|material| !material.effects.contains(&Effect::Unlit));
    let mapped = materials.iter().any(|material| {
        material.normal_texture.is_some()
            || material.clearcoat_normal_texture.is_some()
            || material.effects.contains(&Effect::Anisotropy)
    });
    let all = [
        (true, Column { name: "POSITION", width: 3, read: |v| pad(v.position) }),
        (lit, Column { name: "NORMAL", width: 3, read: |v| pad(v.normal) }),
        (mapped, Column { name: "TANGENT", width: 4, read: |v| v.tangent }),
        (false, Column { name: "TEXCOORD_0", width: 2, read: |v| pad(v.uv0) }),
        (false, Column { name: "TEXCOORD_1", width: 2, read: |v| pad(v.uv1) }),
        (false, Column { name: "COLOR_0", width: 4, read: |v| v.color }),
    ];
    let differs = |column: &Column| {
        let neutral = (column.read)(&NEUTRAL);
        vertices.iter().any(|vertex| (column.read)(vertex) != neutral)
    };
    all.into_iter().filter(|(needed, column)| *needed || differs(column)).map(|(_, column)| column).collect()
}

fn pad<const N: usize>(values: [f32; N]) -> [f32; 4] {
    let mut padded = [0.0; 4];
    padded[..N].copy_from_slice(&values);
    padded
}

/// Sorted names of the extensions that the written tables use.
fn extensions_used(root: &Root) -> Vec<String> {
    let mut used: Vec<&str> = Vec::new();
    let mut add = |is_used: bool, name| {
        if is_used {
            used.push(name);
        }
    };
    let any =
        |test: fn(&schema::MaterialExtensions) -> bool| root.materials.iter().any(|it| test(&it.extensions));
    let mut channels = root.animations.iter().flat_map(|animation| &animation.channels);
    add(channels.any(|channel| channel.target.extensions.pointer.is_some()), "KHR_animation_pointer");
    add(root.extensions.lights.is_some(), "KHR_lights_punctual");
    add(any(|it| it.anisotropy.is_some()), "KHR_materials_anisotropy");
    add(any(|it| it.clearcoat.is_some()), "KHR_materials_clearcoat");
    add(any(|it| it.diffuse_transmission.is_some()), "KHR_materials_diffuse_transmission");
    add(any(|it| it.dispersion.is_some()), "KHR_materials_dispersion");
    add(any(|it| it.emissive_strength.is_some()), "KHR_materials_emissive_strength");
    add(any(|it| it.ior.is_some()), "KHR_materials_ior");
    add(any(|it| it.iridescence.is_some()), "KHR_materials_iridescence");
    add(any(|it| it.sheen.is_some()), "KHR_materials_sheen");
    add(any(|it| it.specular.is_some()), "KHR_materials_specular");
    add(any(|it| it.transmission.is_some()), "KHR_materials_transmission");
    add(any(|it| it.unlit.is_some()), "KHR_materials_unlit");
    add(root.extensions.variants.is_some(), "KHR_materials_variants");
    add(any(|it| it.volume.is_some()), "KHR_materials_volume");
    add(root.nodes.iter().any(|it| it.extensions.visibility.is_some()), "KHR_node_visibility");
    let mut transformed = false;
    for material in &root.materials {
        crate::prune::retain_textures(&mut material.clone(), &mut |info, _| {
            transformed |= info.extensions.transform.is_some();
            true
        });
    }
    add(transformed, "KHR_texture_transform");
    used.into_iter().map(str::to_owned).collect()
}
