//! Materials and their extensions.

use serde::{Deserialize, Serialize};

use super::{is_default, is_one, is_white, one, white};

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Material {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(skip_serializing_if = "is_default")]
    pub pbr_metallic_roughness: MetallicRoughness,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_texture: Option<NormalTexture>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion_texture: Option<OcclusionTexture>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_default")]
    pub emissive_factor: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_mode: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_cutoff: Option<f32>,
    #[serde(skip_serializing_if = "is_default")]
    pub double_sided: bool,
    #[serde(skip_serializing_if = "is_default")]
    pub extensions: MaterialExtensions,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct MetallicRoughness {
    #[serde(skip_serializing_if = "is_opaque_white")]
    pub base_color_factor: [f32; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_one")]
    pub metallic_factor: f32,
    #[serde(skip_serializing_if = "is_one")]
    pub roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        MetallicRoughness {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_unlit", default, skip_serializing_if = "Option::is_none")]
    pub unlit: Option<Empty>,
    #[serde(rename = "KHR_materials_clearcoat", default, skip_serializing_if = "Option::is_none")]
    pub clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_sheen", default, skip_serializing_if = "Option::is_none")]
    pub sheen: Option<Sheen>,
    #[serde(rename = "KHR_materials_transmission", default, skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_ior", default, skip_serializing_if = "Option::is_none")]
    pub ior: Option<Ior>,
    #[serde(rename = "KHR_materials_specular", default, skip_serializing_if = "Option::is_none")]
    pub specular: Option<Specular>,
    #[serde(rename = "KHR_materials_emissive_strength", default, skip_serializing_if = "Option::is_none")]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness", default, skip_serializing)]
    pub specular_glossiness: Option<SpecularGlossiness>,
    #[serde(rename = "KHR_materials_anisotropy", default, skip_serializing_if = "Option::is_none")]
    pub anisotropy: Option<Anisotropy>,
    #[serde(rename = "KHR_materials_iridescence", default, skip_serializing_if = "Option::is_none")]
    pub iridescence: Option<Iridescence>,
    #[serde(rename = "KHR_materials_volume", default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<Volume>,
    #[serde(rename = "KHR_materials_dispersion", default, skip_serializing_if = "Option::is_none")]
    pub dispersion: Option<Dispersion>,
    #[serde(rename = "KHR_materials_diffuse_transmission", default, skip_serializing_if = "Option::is_none")]
    pub diffuse_transmission: Option<DiffuseTransmission>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct Empty {}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Clearcoat {
    pub clearcoat_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_default")]
    pub clearcoat_roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_roughness_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_normal_texture: Option<NormalTexture>,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Sheen {
    pub sheen_color_factor: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheen_color_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_default")]
    pub sheen_roughness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sheen_roughness_texture: Option<TextureInfo>,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Transmission {
    pub transmission_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission_texture: Option<TextureInfo>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub(crate) struct Ior {
    pub ior: f32,
}

impl Default for Ior {
    fn default() -> Self {
        Ior { ior: 1.5 }
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Specular {
    #[serde(skip_serializing_if = "is_one")]
    pub specular_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_white")]
    pub specular_color_factor: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        Specular {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: white(),
            specular_color_texture: None,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct EmissiveStrength {
    #[serde(default = "one")]
    pub emissive_strength: f32,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct SpecularGlossiness {
    pub diffuse_factor: [f32; 4],
    pub diffuse_texture: Option<TextureInfo>,
    pub specular_factor: [f32; 3],
    pub glossiness_factor: f32,
    pub specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        SpecularGlossiness {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: white(),
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Anisotropy {
    pub anisotropy_strength: f32,
    #[serde(skip_serializing_if = "is_default")]
    pub anisotropy_rotation: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anisotropy_texture: Option<TextureInfo>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Iridescence {
    pub iridescence_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iridescence_texture: Option<TextureInfo>,
    pub iridescence_ior: f32,
    pub iridescence_thickness_minimum: f32,
    pub iridescence_thickness_maximum: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iridescence_thickness_texture: Option<TextureInfo>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Iridescence {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Volume {
    pub thickness_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_texture: Option<TextureInfo>,
    /// `None` is glTF's default: infinitely far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attenuation_distance: Option<f32>,
    #[serde(skip_serializing_if = "is_white")]
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Volume {
            thickness_factor: 0.0,
            thickness_texture: None,
            attenuation_distance: None,
            attenuation_color: white(),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Dispersion {
    pub dispersion: f32,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct DiffuseTransmission {
    pub diffuse_transmission_factor: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse_transmission_texture: Option<TextureInfo>,
    #[serde(skip_serializing_if = "is_white")]
    pub diffuse_transmission_color_factor: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffuse_transmission_color_texture: Option<TextureInfo>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        DiffuseTransmission {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: white(),
            diffuse_transmission_color_texture: None,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct TextureInfo {
    pub index: usize,
    #[serde(default, skip_serializing_if = "is_default")]
    pub tex_coord: u32,
    #[serde(default, skip_serializing_if = "is_default")]
    pub extensions: TextureInfoExtensions,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct NormalTexture {
    #[serde(flatten)]
    pub info: TextureInfo,
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f32,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct OcclusionTexture {
    #[serde(flatten)]
    pub info: TextureInfo,
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub strength: f32,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform", default, skip_serializing_if = "Option::is_none")]
    pub transform: Option<TextureTransform>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct TextureTransform {
    pub offset: [f32; 2],
    pub rotation: f32,
    pub scale: [f32; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tex_coord: Option<u32>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        TextureTransform { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

fn is_opaque_white(value: &[f32; 4]) -> bool {
    *value == [1.0; 4]
}
