//! Plays animations: where everything is, and what it looks like, at a time.
//!
//! Start at [`Scene::pose`]; a player of many frames keeps a [`Posed`] and [updates](Posed::update) it, which takes no
//! new memory but for materials. What an animation does not move keeps the bits that it has in the scene.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3, Mat4};

use crate::material_table::texture_ref;
use crate::materials::flatten;
use crate::pose::{trs, vanishes};
use crate::prune::clamp;
use crate::rig::placed_light;
use crate::schema;
use crate::{
    Animation, Camera, CameraProperty, ColorSpace, Draw, Item, Light, LightKind, LightProperty, Material,
    MaterialProperty, Scene, Target, TextureRef, Transform,
};

/// A scene at a time of an animation.
#[derive(Clone, Debug, Default)]
pub struct Posed {
    /// As [`Scene::draws`].
    pub draws: Vec<PosedDraw>,
    /// As [`Scene::hidden`].
    pub hidden: Vec<PosedDraw>,
    /// As [`Scene::skins`]: skin space to world, for each joint.
    pub skins: Vec<Vec<Mat4>>,
    /// As [`Scene::morphs`]: a weight for each target.
    pub morphs: Vec<Vec<f32>>,
    /// As [`Scene::cameras`].
    pub cameras: Vec<Camera>,
    /// As [`Scene::lights`].
    pub lights: Vec<Light>,
    /// Materials that the animation changes, by their index in [`Scene::materials`].
    pub materials: BTreeMap<usize, Material>,
    nodes: Vec<PosedNode>,
    value: Vec<f32>,
}

/// Where a draw is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedDraw {
    /// Object to world, as [`Draw::world`]; an animation may well mirror it.
    pub world: Mat4,
    /// Whether there is anything to see: its node is shown, and not shrunk to a point or line.
    pub visible: bool,
}

#[derive(Clone, Copy, Debug)]
struct PosedNode {
    transform: Transform,
    visible: bool,
    /// Whether a channel moves it or what it hangs on.
    moves: bool,
    world: DMat4,
}

/// What a player needs of the file besides the scene.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    /// Materials that some channel changes.
    pub(crate) materials: BTreeMap<usize, schema::Material>,
    /// What the scene's textures are of the pack's.
    pub(crate) textures: Vec<(usize, ColorSpace)>,
    /// As the scene's.
    pub(crate) lights: Vec<schema::Light>,
}

impl Scene {
    /// The scene at `time_s` of an animation; at rest for `None` and for one that does not exist. Before the first key of
    /// a curve and after the last one their values hold.
    pub fn pose(&self, animation: Option<usize>, time_s: f64) -> Posed {
        let mut posed = Posed::default();
        posed.update(self, animation, time_s);
        posed
    }
}

impl Posed {
    /// Poses `scene` as [`Scene::pose`] does, in the memory that is there.
    pub fn update(&mut self, scene: &Scene, animation: Option<usize>, time_s: f64) {
        self.rest(scene);
        let animation = animation.and_then(|index| scene.animations.get(index));
        if let Some(animation) = animation {
            self.play(scene, animation, time_s);
        }
        self.place_nodes(scene);
        self.place_items(scene);
        self.place_joints(scene);
    }

    fn rest(&mut self, scene: &Scene) {
        let at_rest = |visible| move |draw: &Draw| PosedDraw { world: draw.world, visible };
        self.draws.clear();
        self.draws.extend(scene.draws.iter().map(at_rest(true)));
        self.hidden.clear();
        self.hidden.extend(scene.hidden.iter().map(at_rest(false)));
        self.morphs.clone_from(&scene.morphs);
        self.cameras.clone_from(&scene.cameras);
        self.lights.clone_from(&scene.lights);
        self.materials.clear();
        self.nodes.clear();
        self.nodes.extend(scene.nodes.iter().map(|node| PosedNode {
            transform: node.transform,
            visible: node.visible,
            moves: false,
            world: DMat4::IDENTITY,
        }));
    }

    /// Sets what the channels name.
    fn play(&mut self, scene: &Scene, animation: &Animation, time_s: f64) {
        let mut value = std::mem::take(&mut self.value);
        let mut lights: BTreeMap<usize, schema::Light> = BTreeMap::new();
        let mut materials: BTreeMap<usize, schema::Material> = BTreeMap::new();
        for channel in &animation.channels {
            let curve = &animation.curves[channel.curve];
            value.resize(curve.width, 0.0);
            curve.sample(time_s, &mut value);
            match channel.target {
                Target::Weights { morph } => self.morphs[morph].copy_from_slice(&value),
                Target::Camera { camera, property } => {
                    set_camera(&mut self.cameras[camera], property, value[0]);
                }
                Target::Light { light, property } => {
                    let source = lights.entry(light).or_insert_with(|| scene.sources.lights[light].clone());
                    set_light(source, property, &value);
                }
                Target::Material { material, property } => {
                    let source = || scene.sources.materials.get(&material).cloned().unwrap_or_default();
                    set_material(materials.entry(material).or_insert_with(source), property, &value);
                }
                Target::Translation { node }
                | Target::Rotation { node }
                | Target::Scale { node }
                | Target::Visibility { node } => set_node(&mut self.nodes[node], channel.target, &value),
            }
        }
        self.value = value;
        for (at, source) in lights {
            let light = &mut self.lights[at];
            if let Ok(Light { intensity, kind, range, .. }) = placed_light(&source, DMat4::IDENTITY) {
                (light.intensity, light.kind, light.range) = (intensity, in_order(kind), range);
            }
        }
        let changed = materials.into_iter().map(|(at, source)| (at, scene.changed_material(at, source)));
        self.materials.extend(changed);
    }

    fn place_nodes(&mut self, scene: &Scene) {
        for (at, source) in scene.nodes.iter().enumerate() {
            let local = local_matrix(&self.nodes[at].transform);
            let above = source.parent.map(|parent| self.nodes[parent]);
            let node = &mut self.nodes[at];
            node.world = above.map_or(local, |above| above.world * local);
            node.moves |= above.is_some_and(|above| above.moves);
            node.visible &= above.is_none_or(|above| above.visible);
        }
    }

    fn place_items(&mut self, scene: &Scene) {
        for carried in &scene.carried {
            let node = self.nodes[carried.node];
            let world = node.moves.then(|| node.world * carried.local.as_dmat4());
            match carried.item {
                Item::Draw(at) => place_draw(&mut self.draws[at], &scene.draws[at], world, node.visible),
                Item::Hidden(at) => place_draw(&mut self.hidden[at], &scene.hidden[at], world, node.visible),
                Item::Camera(at) => {
                    self.cameras[at].world = world.map_or(self.cameras[at].world, |world| world.as_mat4());
                }
                Item::Light(at) => {
                    let light = &mut self.lights[at];
                    let placed = world.and_then(|world| placed_light(&scene.sources.lights[at], world).ok());
                    if let Some(Light { position, direction, .. }) = placed {
                        (light.position, light.direction) = (position, direction);
                    }
                }
            }
        }
    }

    fn place_joints(&mut self, scene: &Scene) {
        self.skins.resize_with(scene.skins.len(), Vec::new);
        for (matrices, skin) in self.skins.iter_mut().zip(&scene.skins) {
            let joints = skin.joints.iter().zip(&skin.inverse_binds);
            let to_world = joints.map(|(&joint, bind)| (self.nodes[joint].world * bind.as_dmat4()).as_mat4());
            matrices.clear();
            matrices.extend(to_world);
        }
    }
}

impl Scene {
    /// A material of the scene with other numbers.
    fn changed_material(&self, index: usize, mut source: schema::Material) -> Material {
        clamp(&mut source);
        let Material { name, effects, .. } = self.materials[index].clone();
        let textures = &self.sources.textures;
        flatten(&source, name, effects, &mut |info, space| {
            let texture = textures.iter().position(|known| *known == (info.index, space));
            TextureRef { texture: texture.unwrap_or(0), ..texture_ref(info) }
        })
    }
}

/// `world` is where its node moved it.
fn place_draw(posed: &mut PosedDraw, draw: &Draw, world: Option<DMat4>, visible: bool) {
    if draw.skin.is_some() {
        posed.visible = visible;
        return;
    }
    let world = world.unwrap_or_else(|| draw.world.as_dmat4());
    posed.visible = visible && !vanishes(world);
    posed.world = world.as_mat4();
}

fn local_matrix(transform: &Transform) -> DMat4 {
    let wide = |values: [f32; 3]| DVec3::from_array(values.map(f64::from));
    match *transform {
        Transform::Parts { translation, rotation, scale } => trs(wide(translation), rotation, wide(scale)),
        Transform::Matrix(matrix) => matrix.as_dmat4(),
    }
}

fn set_node(node: &mut PosedNode, target: Target, value: &[f32]) {
    if let Target::Visibility { .. } = target {
        node.visible = value[0] != 0.0;
        return;
    }
    node.moves = true;
    // A node with a matrix has no channels: the import refuses them.
    let Transform::Parts { translation, rotation, scale } = &mut node.transform else { return };
    match target {
        Target::Translation { .. } => translation.copy_from_slice(value),
        Target::Rotation { .. } => rotation.copy_from_slice(value),
        _ => scale.copy_from_slice(value),
    }
}

/// Sets what a [`Camera`] has; the aspect ratio is the window's.
fn set_camera(camera: &mut Camera, property: CameraProperty, value: f32) {
    use CameraProperty as C;
    match property {
        C::Yfov => camera.yfov_rad = Some(value),
        C::Znear | C::OrthographicZnear => camera.znear = value,
        C::Zfar | C::OrthographicZfar => camera.zfar = Some(value),
        C::Ymag => camera.ymag = Some(value),
        C::AspectRatio | C::Xmag => {}
    }
}

fn set_light(light: &mut schema::Light, property: LightProperty, value: &[f32]) {
    let places = property.values(light).iter_mut().zip(value);
    places.for_each(|(place, value)| *place = value.max(0.0));
}

fn set_material(material: &mut schema::Material, property: MaterialProperty, value: &[f32]) {
    let places = property.values(material).into_iter().flatten().zip(value);
    places.for_each(|(place, value)| *place = *value);
}

/// Splines may let the inner cone leave the outer one.
fn in_order(kind: LightKind) -> LightKind {
    match kind {
        LightKind::Spot { inner_cone_rad, outer_cone_rad } => {
            LightKind::Spot { inner_cone_rad: inner_cone_rad.min(outer_cone_rad), outer_cone_rad }
        }
        other => other,
    }
}
