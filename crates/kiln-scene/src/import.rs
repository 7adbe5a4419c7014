//! The one way from a document to a scene; [`crate::pack`] and [`crate::load`] both go it.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat4, DVec3, Mat4};

use crate::accessor::{Data, fetch_buffers};
use crate::animate::{self, Motion, Renumbering, retarget};
use crate::document::Document;
use crate::geometry::{Budget, Needs, Placing, has_joints};
use crate::hierarchy::{Hierarchy, Place, carry, hierarchy, rounded};
use crate::import::order::{order_morphs, order_nodes, order_primitives, order_skins, world_bounds};
use crate::import::parts::{Look, Part};
use crate::material_table::{MaterialTable, Settled};
use crate::movement::{Movement, movement, rest_weights};
use crate::pose::{Binding, Pose, binding, is_singular, pose, vanishes};
use crate::textures::TextureTable;
use crate::uri::References;
use crate::write::GENERATOR;
use crate::{
    Camera, Draw, Instance, Item, Light, LightReads, Scene, SceneError, Skin, SpecularGlossinessAs, conform,
    extensions, limits, rig, schema, variants,
};

#[path = "import_order.rs"]
mod order;
#[path = "import_parts.rs"]
mod parts;

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
    let movement = movement(root, &pose, &motion);
    let importer = Importer {
        data: &data,
        pose: &pose,
        hierarchy: hierarchy(root, &pose, &motion.nodes(), &movement.joints(root, &pose)),
        movement,
        materials: MaterialTable::new(root, textures, motion.material_ranges(), specular_glossiness),
        motion,
        scene: Scene { variants: variants::names(root), ..Scene::default() },
        needs: Vec::new(),
        parts: BTreeMap::new(),
        mirrored: BTreeMap::new(),
        skins: BTreeMap::new(),
        morphs: Vec::new(),
        instances_left: limits::INSTANCE_COUNT_MAX,
        budget: Budget::new(),
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
#[derive(Clone)]
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
    movement: Movement,
    materials: MaterialTable<'a, 'b>,
    scene: Scene,
    /// What the materials of each of the scene's primitives read.
    needs: Vec<Needs>,
    /// Scene primitives by how they look, wherever they stand.
    parts: BTreeMap<Look, Option<Part>>,
    /// Mirror image of a scene primitive.
    mirrored: BTreeMap<usize, usize>,
    /// Scene skin by the file's.
    skins: BTreeMap<usize, usize>,
    /// What the draws' `morph` index.
    morphs: Vec<Morph>,
    instances_left: usize,
    budget: Budget,
    vertex_count: usize,
    index_count: usize,
    notes: Notes,
    draws: Vec<(Place, Draw)>,
    hidden: Vec<(Place, Draw)>,
    cameras: Vec<(Place, FoundCamera)>,
    lights: Vec<(Place, FoundLight)>,
}

/// What moves the vertices of a draw.
struct Morph {
    node: usize,
    /// The file's targets.
    targets: Vec<usize>,
    /// Rest weights of those.
    weights: Vec<f32>,
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
        order_skins(&mut self.scene);
        order_nodes(&mut self.scene, &mut self.hierarchy, &self.motion.nodes());
        let morphs = order_morphs(&mut self.scene, &self.morphs);
        self.scene.sources.lights = lights.iter().map(|it| it.source.clone()).collect();
        self.scene.nodes = std::mem::take(&mut self.hierarchy.nodes);
        self.scene.bounds = world_bounds(&self.scene, &mut self.budget)?;
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
            morphs: by_node(&morphs),
        };
        self.scene.animations = retarget(self.motion.animations, &|target| renumbering.apply(target));
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
        let standing = Standing { place, name, shown };
        let parts = self.primitives(index, mesh)?;
        let instancing = node.extensions.instancing.as_ref();
        let Some(instancing) = instancing.filter(|_| node.skin.is_none()) else {
            if instancing.is_some() {
                let what = "its joints place it, so its instances are one";
                self.notes.push(format!("node `{}`: {what}", standing.name));
            }
            return (0..parts).try_for_each(|at| self.add_draw(index, (mesh, at), &standing));
        };
        let (instances, remark) = rig::instances(self.data, index, instancing, self.instances_left)?;
        self.instances_left -= instances.len();
        remark.into_iter().for_each(|remark| self.notes.push(remark));
        (0..parts).try_for_each(|at| self.add_instances(index, (mesh, at), &standing, &instances))
    }

    /// Number of primitives of a node's mesh.
    fn primitives(&self, node: usize, mesh: usize) -> Result<usize, SceneError> {
        let user = format!("/nodes/{node}/mesh");
        let count = self.data.root.meshes.len();
        let source = self.data.root.meshes.get(mesh);
        let source = source.ok_or_else(|| {
            SceneError::new(user, format!("mesh {mesh} does not exist, the file has {count}"))
        })?;
        Ok(source.primitives.len())
    }

    /// Copies that can be drawn together are one draw; those that must be sorted or are flat are draws of their own.
    fn add_instances(
        &mut self,
        node: usize,
        part: (usize, usize),
        standing: &Standing,
        instances: &[Instance],
    ) -> Result<(), SceneError> {
        let world = rounded(standing.place.world());
        let blends = self.blends(part)?;
        let placed = |at: &usize| world * rig::matrix(&instances[*at]);
        let is_solid = |at: &usize| !blends && placed(at).is_finite() && !is_singular(placed(at));
        let solid: Vec<usize> = (0..instances.len()).filter(is_solid).collect();
        let (mirrored, upright): (Vec<usize>, Vec<usize>) =
            solid.into_iter().partition(|at| placed(at).determinant() < 0.0);
        let mut alone: BTreeSet<usize> = (0..instances.len()).collect();
        for (group, is_mirrored) in [(upright, false), (mirrored, true)] {
            if group.len() > 1 {
                alone.retain(|at| group.binary_search(at).is_err());
                let group = group.into_iter().map(|at| instances[at]).collect();
                self.add_group(node, part, standing, group, is_mirrored)?;
            }
        }
        for at in alone {
            let place = standing.place.then(rig::matrix(&instances[at]));
            let name = format!("{} {at}", standing.name);
            self.add_draw(node, part, &Standing { place, name, ..*standing })?;
        }
        Ok(())
    }

    fn add_group(
        &mut self,
        node: usize,
        part: (usize, usize),
        standing: &Standing,
        mut instances: Vec<Instance>,
        is_mirrored: bool,
    ) -> Result<(), SceneError> {
        let Some(mut found) = self.part(node, part, None)? else { return Ok(()) };
        if is_mirrored {
            found.primitive = self.mirrored(found.primitive)?;
            instances.iter_mut().for_each(|instance| instance.scale[0] = -instance.scale[0]);
        }
        let draw = Draw { instances, ..self.draw(node, found, standing) };
        self.push_draw(node, standing.place, draw, standing.shown)
    }

    fn add_draw(&mut self, node: usize, part: (usize, usize), standing: &Standing) -> Result<(), SceneError> {
        if let Some(skin) = self.data.root.nodes[node].skin {
            return self.add_skinned(node, part, skin, standing);
        }
        // Decided on what the draw will hold, so that a pack decides alike.
        let mut place = standing.place;
        if !place.world().is_finite() {
            self.notes.push(format!("node `{}` is not drawn: its place is not finite", standing.name));
            return Ok(());
        }
        let world = rounded(place.world());
        let shown = standing.shown && !(place.node.is_some() && vanishes(world));
        if shown && is_singular(world) {
            let found = self.baked(node, part, Placing::Flattened(world))?;
            return self.add_still(node, found, standing);
        }
        let Some(mut found) = self.part(node, part, None)? else { return Ok(()) };
        if world.determinant() < 0.0 {
            if place.node.is_none() {
                place = Place::still(world);
            }
            found.primitive = self.mirrored(found.primitive)?;
            place = place.then(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        }
        let draw = self.draw(node, found, standing);
        self.push_draw(node, place, draw, shown)
    }

    fn add_skinned(
        &mut self,
        node: usize,
        part: (usize, usize),
        skin: usize,
        standing: &Standing,
    ) -> Result<(), SceneError> {
        let (mesh, at) = part;
        let pointer = format!("/nodes/{node}/skin");
        let binding = binding(self.data, skin, &pointer)?;
        self.budget.spend(binding.joints.len() as u64, &pointer)?;
        if binding.odd_count > 0 {
            let what = "inverse bind matrices are not finite and count as the identity";
            self.notes.push(format!("/skins/{skin}/inverseBindMatrices: {} {what}", binding.odd_count));
        }
        let jointed = has_joints(&self.data.root.meshes[mesh].primitives[at]);
        if !(jointed && self.movement.keeps_skin(node, skin)) {
            let joints = binding.matrices(&self.pose.worlds);
            let found = self.baked(node, part, Placing::Skin(&joints))?;
            return self.add_still(node, found, standing);
        }
        let Some(found) = self.part(node, part, Some(binding.joints.len()))? else { return Ok(()) };
        let skin = Some(self.skin(skin, &binding));
        let draw = Draw { skin, ..self.draw(node, found, standing) };
        let seen = standing.place.seen_with();
        let place = if self.movement.blinks(node) { seen } else { Place::still(DMat4::IDENTITY) };
        self.push_draw(node, place, draw, standing.shown)
    }

    /// The scene's number of a skin.
    fn skin(&mut self, index: usize, binding: &Binding) -> usize {
        let (skins, kept) = (&mut self.scene.skins, &self.hierarchy.kept);
        *self.skins.entry(index).or_insert_with(|| {
            skins.push(Skin {
                joints: binding.joints.iter().map(|joint| kept[joint]).collect(),
                inverse_binds: binding.inverse_binds.iter().map(DMat4::as_mat4).collect(),
            });
            skins.len() - 1
        })
    }

    /// A draw whose vertices are in world space: it stays where it is at rest.
    fn add_still(&mut self, node: usize, found: Option<Part>, standing: &Standing) -> Result<(), SceneError> {
        let Some(found) = found else { return Ok(()) };
        if !standing.shown {
            self.notes.push(format!("node `{}` is invisible at rest and is left out", standing.name));
            return Ok(());
        }
        let draw = self.draw(node, found, standing);
        self.push_draw(node, Place::still(DMat4::IDENTITY), draw, true)
    }

    /// A draw that has no place yet.
    fn draw(&mut self, node: usize, part: Part, standing: &Standing) -> Draw {
        let Part { primitive, live: targets } = part;
        let morph = (!targets.is_empty()).then(|| {
            let rest = rest_weights(self.data.root, &self.data.root.nodes[node]);
            let weights = targets.iter().map(|&at| rest.get(at).copied().unwrap_or(0.0)).collect();
            self.morphs.push(Morph { node, targets, weights });
            self.morphs.len() - 1
        });
        let name = standing.name.clone();
        Draw { primitive, world: Mat4::IDENTITY, name, skin: None, morph, instances: Vec::new() }
    }

    fn push_draw(&mut self, node: usize, place: Place, draw: Draw, shown: bool) -> Result<(), SceneError> {
        if self.draws.len() + self.hidden.len() >= limits::DRAW_COUNT_MAX {
            let limit = limits::DRAW_COUNT_MAX;
            return Err(SceneError::new(format!("/nodes/{node}"), format!("more than {limit} draws")));
        }
        let world = if draw.skin.is_some() { Mat4::IDENTITY } else { place.world().as_mat4() };
        let list = if shown { &mut self.draws } else { &mut self.hidden };
        list.push((place, Draw { world, ..draw }));
        Ok(())
    }
}

/// What a pack of this crate wrote about its source.
fn remembered_notes(root: &schema::Root) -> Option<Vec<String>> {
    let extras = root.asset.extras.as_ref().filter(|_| root.asset.generator.as_deref() == Some(GENERATOR))?;
    let notes = extras.get("notes")?.as_array()?.iter().filter_map(|note| note.as_str());
    Some(notes.take(limits::NOTE_COUNT_MAX).map(str::to_owned).collect())
}

/// Morphing draws by the file's node.
fn by_node<'a>(morphs: &[&'a Morph]) -> BTreeMap<usize, Vec<(usize, &'a [usize])>> {
    let mut found: BTreeMap<usize, Vec<(usize, &[usize])>> = BTreeMap::new();
    for (at, &Morph { node, ref targets, .. }) in morphs.iter().copied().enumerate() {
        found.entry(node).or_default().push((at, targets));
    }
    found
}

/// The scene's things by the file's that they are copies of.
fn copies(indices: impl Iterator<Item = usize>) -> BTreeMap<usize, Vec<usize>> {
    let mut copies: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    indices.enumerate().for_each(|(at, index)| copies.entry(index).or_default().push(at));
    copies
}
