//! The one way from a document to a scene; [`crate::pack`] and [`crate::load`] both go it.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DMat4, DVec3, Mat4};

use crate::accessor::{Data, fetch_buffers};
use crate::animate::{self, Motion, Renumbering, retarget};
use crate::document::Document;
use crate::geometry::{self, Budget, Deformation, Needs, Placing, Read};
use crate::hierarchy::{Hierarchy, Place, carry, hierarchy, rounded};
use crate::material_table::{MaterialTable, Settled};
use crate::pose::{Pose, joint_matrices, pose};
use crate::textures::TextureTable;
use crate::uri::References;
use crate::write::GENERATOR;
use crate::{
    Bounds, Camera, Draw, Item, Light, LightReads, Primitive, Scene, SceneError, SpecularGlossinessAs,
    VariantMaterial,
};
use crate::{conform, extensions, limits, rig, schema, shape, variants};

/// A scene, and the parts of the file that a pack needs besides.
#[derive(Debug, Default)]
pub(crate) struct Imported {
    pub scene: Scene,
    /// Pruned, with indices into `textures`; same order as the scene's.
    pub materials: Vec<schema::Material>,
    pub reads: Vec<LightReads>,
    pub textures: Vec<schema::Texture>,
    pub samplers: Vec<schema::Sampler>,
    /// MIME type and bytes.
    pub pictures: Vec<(&'static str, Vec<u8>)>,
    /// Same order as the scene's.
    pub cameras: Vec<schema::Camera>,
    pub lights: Vec<(schema::Light, Mat4)>,
    pub warnings: Vec<SceneError>,
    /// Where the file is not as glTF 2.0 wants it.
    pub faults: Vec<SceneError>,
}

/// Imports a document.
///
/// # Errors
/// All that is wrong at the first stage where something is wrong.
pub(crate) fn import(
    references: References<'_>,
    specular_glossiness: SpecularGlossinessAs,
    document: &Document<'_>,
) -> Result<Imported, Vec<SceneError>> {
    let root = &document.root;
    extensions::check_required(root).map_err(|error| vec![error])?;
    let References { file, allowed_folders, read } = references;
    let mut of_buffers = References { file, allowed_folders, read: &mut *read };
    let buffers = fetch_buffers(&mut of_buffers, root, document.bin)?;
    let data = Data { root, buffers };
    let motion = animate::read(&data);
    let pose = pose(root, &motion.blinking()).map_err(|error| vec![error])?;
    // A pack of this crate is as it should be, but for matrices that shear as its source does.
    let is_pack = remembered_notes(root).is_some();
    let mut faults = if is_pack { Vec::new() } else { conform::check(&document.json, &data) };
    // What is left out because of a fault is said there, and once.
    faults.retain(|fault| motion.warnings.iter().all(|warning| warning.pointer != fault.pointer));
    let textures = TextureTable::new(References { file, allowed_folders, read }, &data);
    let importer = Importer {
        data: &data,
        pose: &pose,
        hierarchy: hierarchy(root, &pose, &motion.nodes()),
        materials: MaterialTable::new(root, textures, motion.material_ranges(), specular_glossiness),
        motion,
        scene: Scene { variants: variants::names(root), ..Scene::default() },
        needs: Vec::new(),
        parts: BTreeMap::new(),
        mirrored: BTreeMap::new(),
        budget: Budget { steps_left: limits::POSE_STEP_COUNT_MAX },
        vertex_count: 0,
        index_count: 0,
        notes: Notes::default(),
        draws: Vec::new(),
        hidden: Vec::new(),
        cameras: Vec::new(),
        lights: Vec::new(),
    };
    let mut imported = importer.run().map_err(|error| vec![error])?;
    imported.faults = document.faults.iter().cloned().chain(faults).collect();
    Ok(imported)
}

/// Notes in the order they came up, each once.
#[derive(Debug, Default)]
struct Notes {
    list: Vec<String>,
    seen: BTreeSet<String>,
}

impl Notes {
    fn push(&mut self, note: String) {
        if self.list.len() < limits::NOTE_COUNT_MAX && self.seen.insert(note.clone()) {
            self.list.push(note);
        }
    }
}

/// How a mesh stands in the scene.
struct Standing {
    place: Place,
    name: String,
    shown: bool,
}

struct Importer<'a, 'b> {
    data: &'a Data<'b>,
    pose: &'a Pose,
    hierarchy: Hierarchy,
    motion: Motion,
    materials: MaterialTable<'a, 'b>,
    scene: Scene,
    /// What the materials of each of the scene's primitives read.
    needs: Vec<Needs>,
    /// Scene primitive of a file's (mesh, primitive), where it looks the same wherever it stands.
    parts: BTreeMap<(usize, usize), Option<usize>>,
    /// Mirror image of a scene primitive.
    mirrored: BTreeMap<usize, usize>,
    budget: Budget,
    vertex_count: usize,
    index_count: usize,
    notes: Notes,
    draws: Vec<(Place, Draw)>,
    hidden: Vec<(Place, Draw)>,
    cameras: Vec<(Place, FoundCamera)>,
    lights: Vec<(Place, FoundLight)>,
}

/// A node's camera and the file's index of it.
struct FoundCamera {
    index: usize,
    camera: Camera,
    source: schema::Camera,
}

/// A node's light, the file's index of it, and where it stands.
struct FoundLight {
    index: usize,
    light: Light,
    source: schema::Light,
    world: Mat4,
}

impl Importer<'_, '_> {
    fn run(mut self) -> Result<Imported, SceneError> {
        let root = self.data.root;
        extensions::file_notes(root).into_iter().for_each(|note| self.notes.push(note));
        self.pose.note.iter().cloned().for_each(|note| self.notes.push(note));
        self.motion.notes.drain(..).for_each(|note| self.notes.push(note));
        for &node in &self.pose.shown {
            self.add_node(node)?;
        }
        for &node in &self.pose.hidden {
            self.add_hidden(node)?;
        }
        let light_ranges = self.motion.light_ranges();
        let ranges = |index| light_ranges.get(&index).map_or(&[][..], Vec::as_slice);
        self.lights.retain(|(_, found)| rig::ever_shines(&found.source, ranges(found.index)));
        let carried = &mut self.scene.carried;
        self.scene.draws = carry(self.draws, Item::Draw, carried);
        self.scene.hidden = carry(self.hidden, Item::Hidden, carried);
        let cameras = carry(self.cameras, Item::Camera, carried);
        let lights = carry(self.lights, Item::Light, carried);
        self.scene.cameras = cameras.iter().map(|it| it.camera.clone()).collect();
        self.scene.lights = lights.iter().map(|it| it.light.clone()).collect();
        order_primitives(&mut self.scene);
        self.scene.bounds = world_bounds(&self.scene);
        let Settled { materials, flat, reads, textures, samplers, pictures, notes, mut warnings, moving } =
            self.materials.settle(&mut self.scene, !lights.is_empty());
        notes.into_iter().for_each(|note| self.notes.push(note));
        warnings.extend(self.motion.warnings);
        self.scene.materials = flat;
        let renumbering = Renumbering {
            nodes: &self.hierarchy.kept,
            materials: &moving,
            cameras: copies(cameras.iter().map(|it| it.index)),
            lights: copies(lights.iter().map(|it| it.index)),
        };
        self.scene.animations = retarget(self.motion.animations, &|target| renumbering.apply(target));
        self.scene.nodes = self.hierarchy.nodes;
        // A pack says what its source lacked; places in the pack itself mean nothing to the author.
        self.scene.notes = remembered_notes(root).unwrap_or(self.notes.list);
        Ok(Imported {
            scene: self.scene,
            materials,
            reads,
            textures,
            samplers,
            pictures,
            cameras: cameras.into_iter().map(|it| it.source).collect(),
            lights: lights.into_iter().map(|it| (it.source, it.world)).collect(),
            warnings,
            faults: Vec::new(),
        })
    }

    fn add_node(&mut self, index: usize) -> Result<(), SceneError> {
        let (root, node) = (self.data.root, &self.data.root.nodes[index]);
        let place = self.hierarchy.place(self.pose, index);
        if let Some(at) = node.camera {
            let (camera, source) = rig::camera(root, index, at, place.world())?;
            self.cameras.push((place, FoundCamera { index: at, camera, source }));
        }
        if let Some(at) = node.extensions.light {
            let (light, source) = rig::light(root, index, at.light, place.world())?;
            let world = place.world().as_mat4();
            self.lights.push((place, FoundLight { index: at.light, light, source, world }));
        }
        self.add_shape(index, true)
    }

    /// Adds the mesh of a node that is invisible at rest.
    fn add_hidden(&mut self, index: usize) -> Result<(), SceneError> {
        let node = &self.data.root.nodes[index];
        if node.extensions.light.is_some() {
            let name = node.name.clone().unwrap_or_else(|| format!("node {index}"));
            self.notes.push(format!("the light of node `{name}` is invisible at rest and is left out"));
        }
        self.add_shape(index, false)
    }

    /// Adds a node's mesh; `shown` unless the node is invisible at rest.
    fn add_shape(&mut self, index: usize, shown: bool) -> Result<(), SceneError> {
        let node = &self.data.root.nodes[index];
        let Some(mesh) = node.mesh else { return Ok(()) };
        let place = self.hierarchy.place(self.pose, index);
        let name = node.name.clone().unwrap_or_else(|| format!("node {index}"));
        match &node.extensions.instancing {
            None => self.add_mesh(index, mesh, &Standing { place, name, shown }),
            Some(instancing) => {
                for (at, local) in rig::instances(self.data, index, instancing)?.into_iter().enumerate() {
                    let (place, name) = (place.then(local), format!("{name} {at}"));
                    self.add_mesh(index, mesh, &Standing { place, name, shown })?;
                }
                Ok(())
            }
        }
    }

    fn add_mesh(&mut self, node: usize, mesh: usize, standing: &Standing) -> Result<(), SceneError> {
        let user = format!("/nodes/{node}/mesh");
        let count = self.data.root.meshes.len();
        let source = self.data.root.meshes.get(mesh);
        let source = source.ok_or_else(|| {
            SceneError::new(user, format!("mesh {mesh} does not exist, the file has {count}"))
        })?;
        if !standing.place.world().is_finite() {
            self.notes.push(format!("node `{}` is not drawn: its place is not finite", standing.name));
            return Ok(());
        }
        for at in 0..source.primitives.len() {
            if self.draws.len() + self.hidden.len() >= limits::DRAW_COUNT_MAX {
                let limit = limits::DRAW_COUNT_MAX;
                return Err(SceneError::new(format!("/nodes/{node}"), format!("more than {limit} draws")));
            }
            self.add_draw(node, (mesh, at), standing)?;
        }
        Ok(())
    }

    fn add_draw(&mut self, node: usize, part: (usize, usize), standing: &Standing) -> Result<(), SceneError> {
        // Decided on what the draw will hold, so that a pack decides alike.
        let mut place = standing.place;
        let world = rounded(place.world());
        if place.node.is_none() {
            place.local = world;
        }
        let shown = standing.shown && !(place.node.is_some() && vanishes(world));
        let skin = self.data.root.nodes[node].skin;
        let weights = self.data.root.nodes[node].weights.is_some();
        let bake = skin.is_none() && shown && is_singular(world);
        if skin.is_some() || bake {
            return self.add_baked(node, part, skin, world, standing);
        }
        let shared = if weights { None } else { self.parts.get(&part).copied() };
        let primitive = match shared {
            Some(primitive) => primitive,
            None => self.read_primitive(node, part, Placing::Instance)?,
        };
        if !weights {
            self.parts.insert(part, primitive);
        }
        let Some(mut primitive) = primitive else { return Ok(()) };
        if world.determinant() < 0.0 {
            primitive = self.mirrored(primitive)?;
            place = place.then(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        }
        let draw = Draw { primitive, world: place.world().as_mat4(), name: standing.name.clone() };
        let list = if shown { &mut self.draws } else { &mut self.hidden };
        list.push((place, draw));
        Ok(())
    }

    /// A draw whose vertices are in world space: it stays where it is at rest.
    fn add_baked(
        &mut self,
        node: usize,
        part: (usize, usize),
        skin: Option<usize>,
        world: DMat4,
        standing: &Standing,
    ) -> Result<(), SceneError> {
        if !standing.shown {
            self.notes.push(format!("node `{}` is invisible at rest and is left out", standing.name));
            return Ok(());
        }
        let joints = match skin {
            Some(skin) => joint_matrices(self.data, &self.pose.worlds, skin, &format!("/nodes/{node}/skin"))?,
            None => Vec::new(),
        };
        let placing = if skin.is_some() { Placing::Skin(&joints) } else { Placing::Flattened(world) };
        if let Some(primitive) = self.read_primitive(node, part, placing)? {
            let draw = Draw { primitive, world: Mat4::IDENTITY, name: standing.name.clone() };
            self.draws.push((Place::still(DMat4::IDENTITY), draw));
        }
        Ok(())
    }

    fn mirrored(&mut self, primitive: usize) -> Result<usize, SceneError> {
        if let Some(&known) = self.mirrored.get(&primitive) {
            return Ok(known);
        }
        let source = &self.scene.primitives[primitive];
        let material = source.material;
        let needs = self.needs[primitive];
        let (vertices, indices) =
            shape::mirrored(&source.vertices, &source.indices, needs.tangents.is_some());
        let index = self.push_primitive(vertices, indices, material, needs, "")?;
        let variants = self.scene.variant_materials.iter().filter(|it| it.primitive == primitive);
        let variants: Vec<_> =
            variants.map(|it| VariantMaterial { primitive: index, ..it.clone() }).collect();
        self.scene.variant_materials.extend(variants);
        self.mirrored.insert(primitive, index);
        Ok(index)
    }

    fn read_primitive(
        &mut self,
        node: usize,
        (mesh, at): (usize, usize),
        placing: Placing<'_>,
    ) -> Result<Option<usize>, SceneError> {
        let source = &self.data.root.meshes[mesh];
        let primitive = &source.primitives[at];
        let pointer = format!("/meshes/{mesh}/primitives/{at}");
        let slot = self.materials.slot(primitive.material, &pointer)?;
        let mut needs = self.materials.needs(slot);
        let mut variant_materials = Vec::new();
        let mappings = variants::mappings(primitive, self.scene.variants.len(), &pointer)?;
        for (at, mapping) in mappings.iter().enumerate() {
            let material = self.materials.slot(Some(mapping.material), &variants::place(&pointer, at))?;
            needs = needs.or(self.materials.needs(material));
            let variants = mapping.variants.clone();
            variant_materials.push(VariantMaterial { primitive: 0, material, variants });
        }
        let weights = self.data.root.nodes[node].weights.as_ref().unwrap_or(&source.weights);
        let deformation = Deformation { weights, placing };
        match geometry::read(self.data, primitive, &pointer, needs, deformation, &mut self.budget)? {
            Read::Nothing(why) => {
                self.notes.push(format!("{pointer} is not drawn: {why}"));
                Ok(None)
            }
            Read::Geometry(geometry) => {
                self.note_missing_uvs(primitive, needs, &pointer);
                self.note_restart(primitive, &geometry.indices, &pointer);
                let (geometry, remarks) = shape::finish(geometry, needs);
                remarks.into_iter().for_each(|remark| self.notes.push(format!("{pointer}{remark}")));
                if geometry.indices.is_empty() {
                    return Ok(None);
                }
                let (vertices, indices) = (geometry.vertices, geometry.indices);
                let index = self.push_primitive(vertices, indices, slot, needs, &pointer)?;
                let variants =
                    variant_materials.into_iter().map(|it| VariantMaterial { primitive: index, ..it });
                self.scene.variant_materials.extend(variants);
                Ok(Some(index))
            }
        }
    }

    fn note_missing_uvs(&mut self, primitive: &schema::Primitive, needs: Needs, pointer: &str) {
        for set in 0..2 {
            let name = format!("TEXCOORD_{set}");
            if needs.uv[set] && !primitive.attributes.contains_key(&name) {
                self.notes.push(format!("{pointer}: its material's textures want {name}, which it lacks"));
            }
        }
    }

    /// The largest value of its type in an index means a new strip to a GPU, which glTF does not have.
    fn note_restart(&mut self, primitive: &schema::Primitive, indices: &[u32], pointer: &str) {
        let accessor = primitive.indices.and_then(|index| self.data.root.accessors.get(index));
        let largest = match accessor.map(|accessor| accessor.component_type) {
            Some(5121) => u32::from(u8::MAX),
            Some(5123) => u32::from(u16::MAX),
            _ => return,
        };
        if indices.contains(&largest) {
            self.notes.push(format!("{pointer}/indices: {largest} is reserved; it was read as a vertex"));
        }
    }

    fn push_primitive(
        &mut self,
        vertices: Vec<crate::Vertex>,
        indices: Vec<u32>,
        material: usize,
        needs: Needs,
        pointer: &str,
    ) -> Result<usize, SceneError> {
        self.vertex_count += vertices.len();
        self.index_count += indices.len();
        for (what, count, limit) in [
            ("vertices", self.vertex_count, limits::VERTEX_COUNT_MAX),
            ("indices", self.index_count, limits::INDEX_COUNT_MAX),
        ] {
            if count > limit {
                return Err(SceneError::new(
                    pointer,
                    format!("{count} {what} so far exceed the limit of {limit}"),
                ));
            }
        }
        let bounds = shape::bounds(&vertices);
        self.needs.push(needs);
        self.scene.primitives.push(Primitive { vertices, indices, material, bounds });
        Ok(self.scene.primitives.len() - 1)
    }
}

/// What a pack of this crate wrote about its source.
fn remembered_notes(root: &schema::Root) -> Option<Vec<String>> {
    let extras = root.asset.extras.as_ref().filter(|_| root.asset.generator.as_deref() == Some(GENERATOR))?;
    let notes = extras.get("notes")?.as_array()?.iter().filter_map(|note| note.as_str());
    Some(notes.take(limits::NOTE_COUNT_MAX).map(str::to_owned).collect())
}

/// The scene's things by the file's that they are copies of.
fn copies(indices: impl Iterator<Item = usize>) -> BTreeMap<usize, Vec<usize>> {
    let mut copies: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    indices.enumerate().for_each(|(at, index)| copies.entry(index).or_default().push(at));
    copies
}

/// Shrunk to a line or a point: there is nothing to draw, but an animation may well let it grow.
fn vanishes(world: DMat4) -> bool {
    let linear = DMat3::from_mat4(world);
    let mut lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    lengths.sort_by(f64::total_cmp);
    lengths[1] <= 1e-12 * lengths[2]
}

/// Flat as far as single precision can say, whatever the scale.
fn is_singular(world: DMat4) -> bool {
    let linear = DMat3::from_mat4(world);
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    let (shortest, longest) =
        (lengths.into_iter().fold(f64::INFINITY, f64::min), lengths.into_iter().fold(0.0, f64::max));
    let skew = linear.determinant().abs() / lengths.into_iter().product::<f64>();
    !(shortest > 1e-12 * longest && skew > 1e-6)
}

/// Keeps the primitives that are drawn, in the order in which they are: one that was only ever mirrored goes.
fn order_primitives(scene: &mut Scene) {
    let mut renumbered = BTreeMap::new();
    for draw in scene.draws.iter_mut().chain(&mut scene.hidden) {
        let next = renumbered.len();
        draw.primitive = *renumbered.entry(draw.primitive).or_insert(next);
    }
    let mut kept: Vec<(usize, Primitive)> = std::mem::take(&mut scene.primitives)
        .into_iter()
        .enumerate()
        .filter_map(|(old, primitive)| renumbered.get(&old).map(|&new| (new, primitive)))
        .collect();
    kept.sort_by_key(|(new, _)| *new);
    scene.primitives = kept.into_iter().map(|(_, primitive)| primitive).collect();
    scene.variant_materials.retain_mut(|it| match renumbered.get(&it.primitive) {
        Some(&primitive) => {
            it.primitive = primitive;
            true
        }
        None => false,
    });
    scene.variant_materials.sort_by_key(|it| it.primitive);
}

fn world_bounds(scene: &Scene) -> Option<Bounds> {
    let boxes =
        scene.draws.iter().map(|draw| transformed(scene.primitives[draw.primitive].bounds, draw.world));
    boxes.reduce(|a, b| Bounds { min: a.min.min(b.min), max: a.max.max(b.max) })
}

/// Box around a transformed box (J. Arvo, "Transforming Axis-Aligned Bounding Boxes", Graphics Gems, 1990).
fn transformed(bounds: Bounds, world: Mat4) -> Bounds {
    let world = world.as_dmat4();
    let origin = world.w_axis.truncate();
    let (mut min, mut max) = (origin, origin);
    for (axis, (low, high)) in [world.x_axis, world.y_axis, world.z_axis]
        .into_iter()
        .zip(bounds.min.to_array().into_iter().zip(bounds.max.to_array()))
    {
        let (a, b) = (axis.truncate() * f64::from(low), axis.truncate() * f64::from(high));
        min += a.min(b);
        max += a.max(b);
    }
    Bounds { min: min.as_vec3(), max: max.as_vec3() }
}
