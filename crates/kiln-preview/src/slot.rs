//! The names of `docs/shader-interface.md`: what Kiln can bind, and where.

use kiln_scene::{Material, TextureRef};
use kiln_shader::{Binding, BindingKind};

/// A material texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Map {
    BaseColor,
    MetallicRoughness,
    Normal,
    Occlusion,
    Emissive,
    Clearcoat,
    ClearcoatRoughness,
    ClearcoatNormal,
    SheenColor,
    SheenRoughness,
    Specular,
    SpecularColor,
    Transmission,
    Anisotropy,
    Iridescence,
    IridescenceThickness,
    Thickness,
    DiffuseTransmission,
    DiffuseTransmissionColor,
}

/// What is bound where a material has no texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Neutral {
    White,
    /// The normal of the surface.
    FlatNormal,
    /// A brush of full strength along the tangent.
    AlongTangent,
}

impl Map {
    const ALL: [(Map, &'static str); 19] = [
        (Map::BaseColor, "base_color"),
        (Map::MetallicRoughness, "metallic_roughness"),
        (Map::Normal, "normal"),
        (Map::Occlusion, "occlusion"),
        (Map::Emissive, "emissive"),
        (Map::Clearcoat, "clearcoat"),
        (Map::ClearcoatRoughness, "clearcoat_roughness"),
        (Map::ClearcoatNormal, "clearcoat_normal"),
        (Map::SheenColor, "sheen_color"),
        (Map::SheenRoughness, "sheen_roughness"),
        (Map::Specular, "specular"),
        (Map::SpecularColor, "specular_color"),
        (Map::Transmission, "transmission"),
        (Map::Anisotropy, "anisotropy"),
        (Map::Iridescence, "iridescence"),
        (Map::IridescenceThickness, "iridescence_thickness"),
        (Map::Thickness, "thickness"),
        (Map::DiffuseTransmission, "diffuse_transmission"),
        (Map::DiffuseTransmissionColor, "diffuse_transmission_color"),
    ];

    /// The map named `name`, as `base_color`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, candidate)| *candidate == name).map(|(map, _)| *map)
    }

    /// The material's texture for it.
    pub fn of(self, material: &Material) -> Option<TextureRef> {
        match self {
            Map::BaseColor => material.base_color_texture,
            Map::MetallicRoughness => material.metallic_roughness_texture,
            Map::Normal => material.normal_texture,
            Map::Occlusion => material.occlusion_texture,
            Map::Emissive => material.emissive_texture,
            Map::Clearcoat => material.clearcoat_texture,
            Map::ClearcoatRoughness => material.clearcoat_roughness_texture,
            Map::ClearcoatNormal => material.clearcoat_normal_texture,
            Map::SheenColor => material.sheen_color_texture,
            Map::SheenRoughness => material.sheen_roughness_texture,
            Map::Specular => material.specular_texture,
            Map::SpecularColor => material.specular_color_texture,
            Map::Transmission => material.transmission_texture,
            Map::Anisotropy => material.anisotropy_texture,
            Map::Iridescence => material.iridescence_texture,
            Map::IridescenceThickness => material.iridescence_thickness_texture,
            Map::Thickness => material.thickness_texture,
            Map::DiffuseTransmission => material.diffuse_transmission_texture,
            Map::DiffuseTransmissionColor => material.diffuse_transmission_color_texture,
        }
    }

    /// What stands in for it: it leaves the factors as they are.
    pub fn neutral(self) -> Neutral {
        match self {
            Map::Normal | Map::ClearcoatNormal => Neutral::FlatNormal,
            Map::Anisotropy => Neutral::AlongTangent,
            _ => Neutral::White,
        }
    }
}

/// Something Kiln can bind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Slot {
    Frame,
    EnvSkybox,
    EnvIrradiance,
    EnvSpecular,
    EnvSheen,
    LutGgx,
    LutCharlie,
    HdrColor,
    SceneColor,
    EnvSampler,
    LutSampler,
    /// The scene's own.
    Lights,
    /// The environment's.
    Sun,
    SunShadow,
    SunShadowSampler,
    /// Which channel to show.
    Inspect,
    Material,
    MaterialTexture(Map),
    MaterialSampler(Map),
    Draw,
    /// Skin space to world, for each joint.
    JointMatrices,
    /// What morph weights add to each vertex.
    MorphDeltas,
    MorphWeights,
    /// Copy to draw, for each copy.
    Instances,
    /// The author's own parameters.
    Params,
    /// One of the author's own textures.
    OwnTexture,
    /// And what it is read through.
    OwnSampler,
}

const FIXED: [(Slot, &str); 23] = [
    (Slot::Frame, "frame"),
    (Slot::EnvSkybox, "env_skybox"),
    (Slot::EnvIrradiance, "env_irradiance"),
    (Slot::EnvSpecular, "env_specular"),
    (Slot::EnvSheen, "env_sheen"),
    (Slot::LutGgx, "lut_ggx"),
    (Slot::LutCharlie, "lut_charlie"),
    (Slot::HdrColor, "hdr_color"),
    (Slot::SceneColor, "scene_color"),
    (Slot::EnvSampler, "env_sampler"),
    (Slot::LutSampler, "lut_sampler"),
    (Slot::Lights, "lights"),
    (Slot::Sun, "sun"),
    (Slot::SunShadow, "sun_shadow"),
    (Slot::SunShadowSampler, "sun_shadow_sampler"),
    (Slot::Inspect, "inspect"),
    (Slot::Material, "material"),
    (Slot::Draw, "draw"),
    (Slot::JointMatrices, "joint_matrices"),
    (Slot::MorphDeltas, "morph_deltas"),
    (Slot::MorphWeights, "morph_weights"),
    (Slot::Instances, "instances"),
    (Slot::Params, "params"),
];

const MATRICES: &str = "read-only storage buffer of array<mat4x4f>";
const FLOATS: &str = "read-only storage buffer of array<f32>";
const DEPTH: &str = "texture_depth_2d";
const COMPARISON: &str = "sampler_comparison";

impl Slot {
    /// The slot of a shader variable's name.
    pub fn from_name(name: &str) -> Option<Self> {
        let fixed = FIXED.iter().find(|(_, candidate)| *candidate == name).map(|(slot, _)| *slot);
        let texture = || name.strip_suffix("_texture").and_then(Map::from_name).map(Slot::MaterialTexture);
        let sampler = || name.strip_suffix("_sampler").and_then(Map::from_name).map(Slot::MaterialSampler);
        fixed.or_else(texture).or_else(sampler)
    }

    /// A texture or sampler of group 3, whatever its name.
    pub fn of_own(binding: &Binding) -> Option<Self> {
        let slot = match &binding.kind {
            BindingKind::Texture { .. } => Slot::OwnTexture,
            BindingKind::Sampler { .. } => Slot::OwnSampler,
            _ => return None,
        };
        (binding.group == slot.group() && slot.accepts(&binding.kind)).then_some(slot)
    }

    /// The bind group it belongs to: 0 frame, 1 material, 2 draw, 3 the author's own.
    pub fn group(self) -> u32 {
        match self {
            Slot::Material | Slot::MaterialTexture(_) | Slot::MaterialSampler(_) => 1,
            Slot::Draw | Slot::JointMatrices | Slot::MorphDeltas | Slot::MorphWeights | Slot::Instances => 2,
            Slot::Params | Slot::OwnTexture | Slot::OwnSampler => 3,
            _ => 0,
        }
    }

    /// Whether a binding of this kind can hold it.
    pub fn accepts(self, kind: &BindingKind) -> bool {
        match (self.expects(), kind) {
            ("uniform", BindingKind::Uniform { .. }) => true,
            // The smallest size is that of one element.
            (MATRICES, BindingKind::Storage { read_only: true, size_bytes: 64 })
            | (FLOATS, BindingKind::Storage { read_only: true, size_bytes: 4 }) => true,
            ("sampler", BindingKind::Sampler { comparison }) => !comparison,
            (COMPARISON, BindingKind::Sampler { comparison }) => *comparison,
            (DEPTH, BindingKind::Texture { dimension, sample, multisampled: false }) => {
                dimension == "2d" && sample == "depth"
            }
            (expected, BindingKind::Texture { dimension, sample, multisampled: false })
                if sample == "float" =>
            {
                expected.strip_prefix("texture_").and_then(|rest| rest.strip_suffix("<f32>"))
                    == Some(dimension)
            }
            _ => false,
        }
    }

    /// Whether it is a storage buffer.
    pub fn is_stored(self) -> bool {
        matches!(self.expects(), MATRICES | FLOATS)
    }

    /// What a shader must declare it as.
    pub fn expects(self) -> &'static str {
        match self {
            Slot::Frame
            | Slot::Lights
            | Slot::Inspect
            | Slot::Sun
            | Slot::Material
            | Slot::Draw
            | Slot::Params => "uniform",
            Slot::SunShadow => DEPTH,
            Slot::SunShadowSampler => COMPARISON,
            Slot::JointMatrices | Slot::Instances => MATRICES,
            Slot::MorphDeltas | Slot::MorphWeights => FLOATS,
            Slot::EnvSkybox | Slot::EnvIrradiance | Slot::EnvSpecular | Slot::EnvSheen => "texture_cube<f32>",
            Slot::LutGgx
            | Slot::LutCharlie
            | Slot::HdrColor
            | Slot::SceneColor
            | Slot::MaterialTexture(_)
            | Slot::OwnTexture => "texture_2d<f32>",
            Slot::EnvSampler | Slot::LutSampler | Slot::MaterialSampler(_) | Slot::OwnSampler => "sampler",
        }
    }
}
