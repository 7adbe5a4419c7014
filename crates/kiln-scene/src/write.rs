//! Writes an imported scene as one normalised GLB.
//!
//! One buffer; each primitive a mesh of its own (`write_geometry`); images in buffer views; each draw, camera and light
//! a top node with its world matrix, or the child of a node that moves (`write_motion`). Matrices may shear, which a
//! tool that insists on translation, rotation and scale will remark.

use std::collections::{BTreeMap, BTreeSet};

use glam::Mat4;

use crate::container::join;
use crate::deform::{Influence, MorphDelta};
use crate::import::Imported;
use crate::schema::{Accessor, Asset, Buffer, BufferView, Image, LightIndex, Lights, Node, Root};
use crate::{Draw, Item, Material, Scene, Vertex, schema};

/// Marks files whose `asset.extras.notes` come from here.
pub(crate) const GENERATOR: &str = "kiln";

pub(crate) const FLOAT: u32 = 5126;

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
    let placed = writer.nodes(imported);
    writer.animations(&imported.scene.animations, &placed);
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
    let geometry = geometry.map(|it| {
        let deltas = it.targets.len() * it.vertices.len() * size_of::<MorphDelta>();
        let influences = it.influences.len() * size_of::<Influence>();
        it.vertices.len() * size_of::<Vertex>() + it.indices.len() * 4 + 8 + deltas + influences
    });
    FRONT
        + geometry.sum::<usize>()
        + imported.pictures.iter().map(|(_, bytes)| bytes.len() + 4).sum::<usize>()
}

pub(crate) struct Writer {
    pub root: Root,
    pub bin: Vec<u8>,
}

impl Writer {
    pub fn view(&mut self, bytes: &[u8], byte_stride: Option<u64>, target: Option<u32>) -> usize {
        self.view_of(byte_stride, target, |bin| bin.extend_from_slice(bytes))
    }

    /// A view of what `append` appends, so that large data needs no buffer of its own.
    pub fn view_of(
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

    /// Writes what stands still, then what moves.
    fn nodes(&mut self, imported: &Imported) -> Placed {
        let scene = &imported.scene;
        let draws: BTreeMap<Item, Node> =
            all_draws(scene).map(|(item, draw)| (item, self.draw_node(scene, draw))).collect();
        let make = |item: Item, matrix: Mat4| {
            let world = node(None, matrix).matrix;
            match item {
                Item::Draw(_) | Item::Hidden(_) => Node { matrix: world, ..draws[&item].clone() },
                Item::Camera(at) => {
                    Node { camera: Some(at), ..node(Some(scene.cameras[at].name.clone()), matrix) }
                }
                Item::Light(at) => {
                    let mut node = node(None, matrix);
                    node.extensions.light = Some(LightIndex { light: at });
                    node
                }
            }
        };
        let carried: BTreeSet<Item> = scene.carried.iter().map(|carried| carried.item).collect();
        let draws = scene.draws.iter().enumerate().map(|(at, draw)| (Item::Draw(at), draw.world));
        let cameras = scene.cameras.iter().enumerate().map(|(at, camera)| (Item::Camera(at), camera.world));
        let lights = imported.lights.iter().enumerate().map(|(at, (_, world))| (Item::Light(at), *world));
        let mut items = BTreeMap::new();
        let still = draws.chain(cameras).chain(lights).filter(|(item, _)| !carried.contains(item));
        for (item, world) in still {
            items.insert(item, self.root.nodes.len());
            self.root.nodes.push(make(item, world));
        }
        let first = self.hierarchy(scene, &make, &mut items);
        self.skins(&scene.skins, first);
        self.root.cameras.clone_from(&imported.cameras);
        let lights = Lights { lights: imported.lights.iter().map(|(light, _)| light.clone()).collect() };
        self.root.extensions.lights = (!lights.lights.is_empty()).then_some(lights);
        let tops = scene.nodes.iter().enumerate().filter(|(_, node)| node.parent.is_none());
        let nodes = (0..first).chain(tops.map(|(at, _)| first + at)).collect();
        self.root.scenes.push(schema::SceneNodes { nodes });
        self.root.scene = Some(0);
        let morphing = all_draws(scene).filter(|(_, draw)| draw.morph.is_some());
        Placed { first, morphs: morphing.map(|(item, _)| items[&item]).collect() }
    }
}

/// Numbers of nodes in the pack.
pub(crate) struct Placed {
    /// First of the scene's.
    pub first: usize,
    /// Of the draw that each of the scene's weights is for.
    pub morphs: Vec<usize>,
}

fn all_draws(scene: &Scene) -> impl Iterator<Item = (Item, &Draw)> {
    let shown = scene.draws.iter().enumerate().map(|(at, draw)| (Item::Draw(at), draw));
    shown.chain(scene.hidden.iter().enumerate().map(|(at, draw)| (Item::Hidden(at), draw)))
}

pub(crate) fn node(name: Option<String>, world: Mat4) -> Node {
    let matrix = (world != Mat4::IDENTITY).then(|| world.to_cols_array());
    Node { name, matrix, ..Node::default() }
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
    add(root.nodes.iter().any(|it| it.extensions.instancing.is_some()), "EXT_mesh_gpu_instancing");
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
