//! The render scene: plain data, flattened for drawing.

use std::collections::BTreeSet;

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Quat, Vec3};

use crate::Animation;
use crate::deform::{Influence, MorphTarget};
use crate::play::Sources;

/// Everything a renderer needs to draw one scene.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Distinct geometry.
    pub primitives: Vec<Primitive>,
    /// What to draw: instances of primitives.
    pub draws: Vec<Draw>,
    /// Materials; the last one is glTF's default material if anything uses it.
    pub materials: Vec<Material>,
    /// An image with the way to sample it.
    pub textures: Vec<Texture>,
    /// Decoded 8-bit images.
    pub images: Vec<Image8>,
    /// Cameras of the file, with their world transform.
    pub cameras: Vec<Camera>,
    /// Punctual lights of the file that ever shine.
    pub lights: Vec<Light>,
    /// What animations move and what skins hang on, parents first; empty where nothing moves.
    pub nodes: Vec<Node>,
    /// What hangs on those nodes. A draw, camera or light that is not here never moves. A skinned draw is here only
    /// if its node may come and go: the node decides whether it is seen, its joints where.
    pub carried: Vec<Carried>,
    /// Joints that some animation moves; those that none does are part of the vertices.
    pub skins: Vec<Skin>,
    /// Weights of morphing draws at rest, one entry for each such draw: as many as the primitive has targets.
    pub morphs: Vec<Vec<f32>>,
    /// What the rest pose does not show but an animation may: of invisible nodes and of nodes shrunk to a point or line.
    pub hidden: Vec<Draw>,
    /// What moves, and how; the draws above stand at the rest pose, [`Scene::pose`] plays.
    pub animations: Vec<Animation>,
    /// Names of `KHR_materials_variants`; [`Primitive::material`] is the default, of none of them.
    pub variants: Vec<String>,
    /// Materials of primitives in variants.
    pub variant_materials: Vec<VariantMaterial>,
    /// World bounds of all draws at rest, skinned and morphed; `None` for an empty scene.
    pub bounds: Option<Bounds>,
    /// What the file asks for and this version draws approximately or not at all, a line each.
    pub notes: Vec<String>,
    /// What [`Scene::pose`] needs of the file besides.
    pub sources: Sources,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

/// One vertex as the vertex buffer holds it; absent attributes have glTF's neutral values.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Object space.
    pub position: [f32; 3],
    /// Object space, unit length.
    pub normal: [f32; 3],
    /// Object space, unit length, w = handedness of the bitangent.
    pub tangent: [f32; 4],
    /// `TEXCOORD_0`.
    pub uv0: [f32; 2],
    /// `TEXCOORD_1`.
    pub uv1: [f32; 2],
    /// `COLOR_0`, linear; white where absent.
    pub color: [f32; 4],
}

/// A triangle list with one material.
#[derive(Clone, Debug)]
pub struct Primitive {
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Triangles, three indices each.
    pub indices: Vec<u32>,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Object-space bounds, neither skinned nor morphed.
    pub bounds: Bounds,
    /// The joints that each vertex hangs on; empty without a skin.
    pub influences: Vec<Influence>,
    /// What morph weights add to the vertices, which are unmorphed then; empty without any.
    pub targets: Vec<MorphTarget>,
}

/// A primitive placed in the world.
#[derive(Clone, Debug)]
pub struct Draw {
    /// Index into [`Scene::primitives`].
    pub primitive: usize,
    /// Object to world; the identity with a skin. Its determinant, or that of each product with an instance, is positive.
    pub world: Mat4,
    /// The node's name, for messages.
    pub name: String,
    /// Index into [`Scene::skins`]: the vertices go from skin space to the world by their joints alone.
    pub skin: Option<usize>,
    /// Index into [`Scene::morphs`], of this draw alone.
    pub morph: Option<usize>,
    /// Copies, each placed by `world · instance`; empty for one at `world`.
    pub instances: Vec<Instance>,
}

/// Place of a copy: scaled, then rotated, then moved, then by [`Draw::world`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Instance {
    /// Object units.
    pub translation: [f32; 3],
    /// Quaternion x, y, z, w, unit length.
    pub rotation: [f32; 4],
    /// Factors; a mirrored copy has negative ones.
    pub scale: [f32; 3],
}

impl Instance {
    /// The copy's place relative to the draw.
    pub fn matrix(&self) -> Mat4 {
        let translation = self.translation.into();
        Mat4::from_scale_rotation_translation(self.scale.into(), Quat::from_array(self.rotation), translation)
    }
}

/// Joints that vertices hang on.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    /// Indices into [`Scene::nodes`]; [`Influence::joints`] index this list.
    pub joints: Vec<usize>,
    /// Skin space to joint, for each joint.
    pub inverse_binds: Vec<Mat4>,
}

impl Scene {
    /// What a draw calls for with a material, its primitive's own or one of a variant: what the material does, and what
    /// the geometry does.
    pub fn effects(&self, draw: &Draw, material: usize) -> EffectSet {
        let mut effects = self.materials[material].effects.clone();
        effects.extend(draw.effects());
        effects
    }

    /// Index into [`Scene::materials`] of what a draw looks like in a variant, its index into [`Scene::variants`];
    /// `None` and variants that do not concern it are its primitive's own.
    pub fn material_of(&self, draw: &Draw, variant: Option<usize>) -> usize {
        let is_it = |it: &&VariantMaterial| {
            it.primitive == draw.primitive && variant.is_some_and(|variant| it.variants.contains(&variant))
        };
        let other = self.variant_materials.iter().find(is_it);
        other.map_or(self.primitives[draw.primitive].material, |it| it.material)
    }
}

impl Draw {
    /// What its geometry calls for, whatever the material.
    pub fn effects(&self) -> EffectSet {
        let called_for = [
            (self.skin.is_some(), Effect::Skin),
            (self.morph.is_some(), Effect::Morph),
            (!self.instances.is_empty(), Effect::Instancing),
        ];
        called_for.into_iter().filter(|(is_called, _)| *is_called).map(|(_, effect)| effect).collect()
    }
}

/// A node that moves, a joint, or what one of those hangs on.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Index of the node that it hangs on, which comes before it.
    pub parent: Option<usize>,
    /// Its place at rest, relative to its parent.
    pub transform: Transform,
    /// Whether it and what hangs on it are drawn at rest.
    pub visible: bool,
}

/// A place relative to a parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// Scaled, then rotated, then moved; what channels set one by one.
    Parts {
        /// Metres.
        translation: [f32; 3],
        /// Quaternion x, y, z, w.
        rotation: [f32; 4],
        /// Factors.
        scale: [f32; 3],
    },
    /// No channel sets any of it.
    Matrix(Mat4),
}

/// Something that moves with a node: its world matrix is the node's times `local`, but for skinned draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Index into [`Scene::nodes`].
    pub node: usize,
    /// What hangs there.
    pub item: Item,
    /// Item to node.
    pub local: Mat4,
}

/// What a node may carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    /// Index into [`Scene::draws`].
    Draw(usize),
    /// Index into [`Scene::hidden`].
    Hidden(usize),
    /// Index into [`Scene::cameras`].
    Camera(usize),
    /// Index into [`Scene::lights`].
    Light(usize),
}

/// The material that a primitive has in some variants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VariantMaterial {
    /// Index into [`Scene::primitives`].
    pub primitive: usize,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Indices into [`Scene::variants`].
    pub variants: Vec<usize>,
}

/// One phenomenon that a material, or a draw's geometry, calls for. [`Effect::name`] is the feature the shader is
/// compiled with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Effect {
    /// Alpha below the cutoff is discarded.
    AlphaMask,
    /// Blended over what lies behind.
    AlphaBlend,
    /// Reflections stretched along a direction of the surface.
    Anisotropy,
    /// A second specular layer on top.
    Clearcoat,
    /// Light scattered to the other side.
    DiffuseTransmission,
    /// Refraction that differs between colours; never without [`Effect::Volume`].
    Dispersion,
    /// Light of its own.
    Emission,
    /// Copies of the geometry, each placed on its own: [`Draw::instances`].
    Instancing,
    /// A thin film whose colour depends on the view.
    Iridescence,
    /// Morph targets whose weights an animation changes.
    Morph,
    /// Tangent-space normal texture that is not flat.
    NormalMap,
    /// Occlusion texture.
    Occlusion,
    /// Lights of the scene's own (`KHR_lights_punctual`) shine on it.
    PunctualLights,
    /// Cloth-like retroreflection at grazing angles.
    Sheen,
    /// Joints that an animation moves.
    Skin,
    /// `KHR_materials_specular`/`ior` away from their defaults.
    Specular,
    /// The environment's extracted sun shines on it: called for by what lights a scene, never by the scene.
    Sun,
    /// Light passes through the surface.
    Transmission,
    /// Base colour alone, no lighting.
    Unlit,
    /// `COLOR_0` multiplies the base colour.
    VertexColor,
    /// An inside that light passes through, of some thickness.
    Volume,
}

/// Effects of a material or a draw, sorted: the shader variant it is drawn with.
pub type EffectSet = BTreeSet<Effect>;

/// Whether a surface hides what lies behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Fragments with alpha below the cutoff are discarded.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Blended by alpha.
    Blend,
}

/// A glTF material with its extensions' values; absent ones have the specification's defaults.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "names and meaning are glTF's own")]
pub struct Material {
    pub name: String,
    pub base_color_factor: [f32; 4],
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    /// Includes `KHR_materials_emissive_strength`.
    pub emissive_factor: [f32; 3],
    pub normal_scale: f32,
    pub occlusion_strength: f32,
    pub ior: f32,
    pub specular_factor: f32,
    pub specular_color_factor: [f32; 3],
    pub clearcoat_factor: f32,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_normal_scale: f32,
    pub sheen_color_factor: [f32; 3],
    pub sheen_roughness_factor: f32,
    pub transmission_factor: f32,
    pub anisotropy_strength: f32,
    /// Radians, counter-clockwise from the tangent.
    pub anisotropy_rotation: f32,
    pub iridescence_factor: f32,
    pub iridescence_ior: f32,
    /// Nanometres, where the thickness texture is 0.
    pub iridescence_thickness_minimum: f32,
    /// Nanometres, where the thickness texture is 1 or absent.
    pub iridescence_thickness_maximum: f32,
    /// Units of the object, not of the world.
    pub thickness_factor: f32,
    /// World units; infinite where nothing is absorbed.
    pub attenuation_distance: f32,
    pub attenuation_color: [f32; 3],
    /// 20 over the Abbe number.
    pub dispersion: f32,
    pub diffuse_transmission_factor: f32,
    pub diffuse_transmission_color_factor: [f32; 3],
    pub alpha_mode: AlphaMode,
    pub double_sided: bool,
    pub base_color_texture: Option<TextureRef>,
    pub metallic_roughness_texture: Option<TextureRef>,
    pub normal_texture: Option<TextureRef>,
    pub occlusion_texture: Option<TextureRef>,
    pub emissive_texture: Option<TextureRef>,
    pub clearcoat_texture: Option<TextureRef>,
    pub clearcoat_roughness_texture: Option<TextureRef>,
    pub clearcoat_normal_texture: Option<TextureRef>,
    pub sheen_color_texture: Option<TextureRef>,
    pub sheen_roughness_texture: Option<TextureRef>,
    pub specular_texture: Option<TextureRef>,
    pub specular_color_texture: Option<TextureRef>,
    pub transmission_texture: Option<TextureRef>,
    pub anisotropy_texture: Option<TextureRef>,
    pub iridescence_texture: Option<TextureRef>,
    pub iridescence_thickness_texture: Option<TextureRef>,
    pub thickness_texture: Option<TextureRef>,
    pub diffuse_transmission_texture: Option<TextureRef>,
    pub diffuse_transmission_color_texture: Option<TextureRef>,
    /// Decided from values, not from names: an extension without effect is not here.
    pub effects: EffectSet,
}

/// Where a material reads a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: usize,
    /// 0 or 1.
    pub uv_set: u32,
    /// `KHR_texture_transform` as two rows of an affine map: u' = r0 · (u, v, 1), v' = r1 · (u, v, 1).
    pub transform: [[f32; 3]; 2],
}

/// How an image's bytes encode values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// Colours: sRGB transfer function on RGB, linear alpha.
    Srgb,
    /// Data: normals, roughness, occlusion …
    Linear,
}

/// An image with the way to sample it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: usize,
    /// How the bytes encode values.
    pub color_space: ColorSpace,
    /// Wrapping and filtering.
    pub sampler: Sampler,
}

/// What happens outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "names are glTF's own")]
pub enum Wrap {
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

/// Wrapping and filtering, as the file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Bilinear when magnified, else nearest.
    pub mag_linear: bool,
    /// Bilinear when minified, else nearest.
    pub min_linear: bool,
    /// How levels are used: `None` = the base level alone, `Some(true)` = trilinear, `Some(false)` = nearest level.
    pub mip_linear: Option<bool>,
}

/// A decoded RGBA image, 8 bits a channel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image8 {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height · 4` bytes.
    pub rgba: Vec<u8>,
}

/// A perspective or orthographic camera of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its node's or its own name.
    pub name: String,
    /// Camera to world; it looks along its −Z.
    pub world: Mat4,
    /// Vertical field of view in radians; `None` for orthographic cameras.
    pub yfov_rad: Option<f32>,
    /// Near plane.
    pub znear: f32,
    /// Far plane; `None` = infinite.
    pub zfar: Option<f32>,
    /// Half of the height that an orthographic camera sees; `None` for perspective cameras.
    pub ymag: Option<f32>,
}

/// A light of `KHR_lights_punctual`, in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Colour times intensity, in candela (point, spot) or lux (directional).
    pub intensity: [f32; 3],
    /// World position.
    pub position: Vec3,
    /// Direction in which it shines, unit length.
    pub direction: Vec3,
    /// Which kind.
    pub kind: LightKind,
    /// Distance beyond which it has no effect.
    pub range: Option<f32>,
}

/// Kinds of punctual lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// From infinitely far.
    Directional,
    /// In all directions.
    Point,
    /// In a cone.
    Spot {
        /// Full intensity inside, radians from the axis.
        inner_cone_rad: f32,
        /// Nothing outside.
        outer_cone_rad: f32,
    },
}
