//! What `KHR_animation_pointer` may point at: names, places in the JSON, and the numbers behind them.
//!
//! The tables list what glTF's object model calls mutable and what a picture depends on.

use crate::schema::{Camera, Light, Material, Spot, TextureInfo};

/// An animated factor of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "names and meaning are glTF's own")]
pub enum MaterialProperty {
    BaseColorFactor,
    MetallicFactor,
    RoughnessFactor,
    AlphaCutoff,
    EmissiveFactor,
    NormalScale,
    OcclusionStrength,
    AnisotropyStrength,
    AnisotropyRotation,
    ClearcoatFactor,
    ClearcoatRoughnessFactor,
    ClearcoatNormalScale,
    DiffuseTransmissionFactor,
    DiffuseTransmissionColorFactor,
    Dispersion,
    EmissiveStrength,
    Ior,
    IridescenceFactor,
    IridescenceIor,
    IridescenceThicknessMinimum,
    IridescenceThicknessMaximum,
    SheenColorFactor,
    SheenRoughnessFactor,
    SpecularFactor,
    SpecularColorFactor,
    TransmissionFactor,
    ThicknessFactor,
    AttenuationDistance,
    AttenuationColor,
    TextureOffset(TextureSlot),
    /// Radians, counter-clockwise.
    TextureRotation(TextureSlot),
    TextureScale(TextureSlot),
}

/// A texture of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "names and meaning are glTF's own")]
pub enum TextureSlot {
    BaseColor,
    MetallicRoughness,
    Normal,
    Occlusion,
    Emissive,
    Anisotropy,
    Clearcoat,
    ClearcoatRoughness,
    ClearcoatNormal,
    DiffuseTransmission,
    DiffuseTransmissionColor,
    Iridescence,
    IridescenceThickness,
    SheenColor,
    SheenRoughness,
    Specular,
    SpecularColor,
    Transmission,
    Thickness,
}

/// An animated value of a camera; distances in metres, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "names and meaning are glTF's own")]
pub enum CameraProperty {
    AspectRatio,
    Yfov,
    Znear,
    Zfar,
    Xmag,
    Ymag,
    OrthographicZnear,
    OrthographicZfar,
}

/// An animated value of a punctual light; angles in radians.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "names and meaning are glTF's own")]
pub enum LightProperty {
    Color,
    Intensity,
    Range,
    InnerConeAngle,
    OuterConeAngle,
}

use CameraProperty as C;
use LightProperty as L;
use MaterialProperty as M;
use TextureSlot as T;

const FACTORS: &[(M, &str, usize)] = &[
    (M::BaseColorFactor, "pbrMetallicRoughness/baseColorFactor", 4),
    (M::MetallicFactor, "pbrMetallicRoughness/metallicFactor", 1),
    (M::RoughnessFactor, "pbrMetallicRoughness/roughnessFactor", 1),
    (M::AlphaCutoff, "alphaCutoff", 1),
    (M::EmissiveFactor, "emissiveFactor", 3),
    (M::NormalScale, "normalTexture/scale", 1),
    (M::OcclusionStrength, "occlusionTexture/strength", 1),
    (M::AnisotropyStrength, "extensions/KHR_materials_anisotropy/anisotropyStrength", 1),
    (M::AnisotropyRotation, "extensions/KHR_materials_anisotropy/anisotropyRotation", 1),
    (M::ClearcoatFactor, "extensions/KHR_materials_clearcoat/clearcoatFactor", 1),
    (M::ClearcoatRoughnessFactor, "extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor", 1),
    (M::ClearcoatNormalScale, "extensions/KHR_materials_clearcoat/clearcoatNormalTexture/scale", 1),
    (
        M::DiffuseTransmissionFactor,
        "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionFactor",
        1,
    ),
    (
        M::DiffuseTransmissionColorFactor,
        "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorFactor",
        3,
    ),
    (M::Dispersion, "extensions/KHR_materials_dispersion/dispersion", 1),
    (M::EmissiveStrength, "extensions/KHR_materials_emissive_strength/emissiveStrength", 1),
    (M::Ior, "extensions/KHR_materials_ior/ior", 1),
    (M::IridescenceFactor, "extensions/KHR_materials_iridescence/iridescenceFactor", 1),
    (M::IridescenceIor, "extensions/KHR_materials_iridescence/iridescenceIor", 1),
    (M::IridescenceThicknessMinimum, "extensions/KHR_materials_iridescence/iridescenceThicknessMinimum", 1),
    (M::IridescenceThicknessMaximum, "extensions/KHR_materials_iridescence/iridescenceThicknessMaximum", 1),
    (M::SheenColorFactor, "extensions/KHR_materials_sheen/sheenColorFactor", 3),
    (M::SheenRoughnessFactor, "extensions/KHR_materials_sheen/sheenRoughnessFactor", 1),
    (M::SpecularFactor, "extensions/KHR_materials_specular/specularFactor", 1),
    (M::SpecularColorFactor, "extensions/KHR_materials_specular/specularColorFactor", 3),
    (M::TransmissionFactor, "extensions/KHR_materials_transmission/transmissionFactor", 1),
    (M::ThicknessFactor, "extensions/KHR_materials_volume/thicknessFactor", 1),
    (M::AttenuationDistance, "extensions/KHR_materials_volume/attenuationDistance", 1),
    (M::AttenuationColor, "extensions/KHR_materials_volume/attenuationColor", 3),
];

const SLOTS: &[(T, &str)] = &[
    (T::BaseColor, "pbrMetallicRoughness/baseColorTexture"),
    (T::MetallicRoughness, "pbrMetallicRoughness/metallicRoughnessTexture"),
    (T::Normal, "normalTexture"),
    (T::Occlusion, "occlusionTexture"),
    (T::Emissive, "emissiveTexture"),
    (T::Anisotropy, "extensions/KHR_materials_anisotropy/anisotropyTexture"),
    (T::Clearcoat, "extensions/KHR_materials_clearcoat/clearcoatTexture"),
    (T::ClearcoatRoughness, "extensions/KHR_materials_clearcoat/clearcoatRoughnessTexture"),
    (T::ClearcoatNormal, "extensions/KHR_materials_clearcoat/clearcoatNormalTexture"),
    (T::DiffuseTransmission, "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionTexture"),
    (
        T::DiffuseTransmissionColor,
        "extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorTexture",
    ),
    (T::Iridescence, "extensions/KHR_materials_iridescence/iridescenceTexture"),
    (T::IridescenceThickness, "extensions/KHR_materials_iridescence/iridescenceThicknessTexture"),
    (T::SheenColor, "extensions/KHR_materials_sheen/sheenColorTexture"),
    (T::SheenRoughness, "extensions/KHR_materials_sheen/sheenRoughnessTexture"),
    (T::Specular, "extensions/KHR_materials_specular/specularTexture"),
    (T::SpecularColor, "extensions/KHR_materials_specular/specularColorTexture"),
    (T::Transmission, "extensions/KHR_materials_transmission/transmissionTexture"),
    (T::Thickness, "extensions/KHR_materials_volume/thicknessTexture"),
];

const CAMERA: &[(C, &str)] = &[
    (C::AspectRatio, "perspective/aspectRatio"),
    (C::Yfov, "perspective/yfov"),
    (C::Znear, "perspective/znear"),
    (C::Zfar, "perspective/zfar"),
    (C::Xmag, "orthographic/xmag"),
    (C::Ymag, "orthographic/ymag"),
    (C::OrthographicZnear, "orthographic/znear"),
    (C::OrthographicZfar, "orthographic/zfar"),
];

const LIGHT: &[(L, &str)] = &[
    (L::Color, "color"),
    (L::Intensity, "intensity"),
    (L::Range, "range"),
    (L::InnerConeAngle, "spot/innerConeAngle"),
    (L::OuterConeAngle, "spot/outerConeAngle"),
];

const TRANSFORM: &str = "/extensions/KHR_texture_transform/";

impl MaterialProperty {
    /// By its place below the material.
    pub(crate) fn from_path(path: &str) -> Option<Self> {
        if let Some((slot, member)) = path.split_once(TRANSFORM) {
            let (slot, _) = *SLOTS.iter().find(|(_, known)| *known == slot)?;
            return match member {
                "offset" => Some(M::TextureOffset(slot)),
                "rotation" => Some(M::TextureRotation(slot)),
                "scale" => Some(M::TextureScale(slot)),
                _ => None,
            };
        }
        FACTORS.iter().find(|(_, known, _)| *known == path).map(|(property, ..)| *property)
    }

    /// Its place below the material.
    pub(crate) fn path(self) -> String {
        let below = |slot: T, member: &str| {
            let known = SLOTS.iter().find(|(known, _)| *known == slot);
            known.map_or(String::new(), |(_, path)| format!("{path}{TRANSFORM}{member}"))
        };
        match self {
            M::TextureOffset(slot) => below(slot, "offset"),
            M::TextureRotation(slot) => below(slot, "rotation"),
            M::TextureScale(slot) => below(slot, "scale"),
            factor => {
                let known = FACTORS.iter().find(|(known, ..)| *known == factor);
                known.map_or(String::new(), |(_, path, _)| (*path).to_owned())
            }
        }
    }

    /// Components of its value.
    pub fn width(self) -> usize {
        match self {
            M::TextureOffset(_) | M::TextureScale(_) => 2,
            factor => FACTORS.iter().find(|(known, ..)| *known == factor).map_or(1, |(_, _, width)| *width),
        }
    }

    /// The numbers, if the object that holds them exists: a pointer to anything else is none by the
    /// specification. A default that the file leaves out is put there.
    pub(crate) fn values(self, material: &mut Material) -> Option<&mut [f32]> {
        if let M::TextureOffset(slot) | M::TextureRotation(slot) | M::TextureScale(slot) = self {
            let transform = texture(slot, material)?.extensions.transform.as_mut()?;
            return match self {
                M::TextureOffset(_) => Some(&mut transform.offset),
                M::TextureRotation(_) => one(&mut transform.rotation),
                _ => Some(&mut transform.scale),
            };
        }
        let base = &mut material.pbr_metallic_roughness;
        let ext = &mut material.extensions;
        match self {
            M::BaseColorFactor => Some(&mut base.base_color_factor),
            M::MetallicFactor => one(&mut base.metallic_factor),
            M::RoughnessFactor => one(&mut base.roughness_factor),
            M::AlphaCutoff => one(material.alpha_cutoff.get_or_insert(0.5)),
            M::EmissiveFactor => Some(&mut material.emissive_factor),
            M::NormalScale => material.normal_texture.as_mut().and_then(|it| one(&mut it.scale)),
            M::OcclusionStrength => material.occlusion_texture.as_mut().and_then(|it| one(&mut it.strength)),
            M::AnisotropyStrength => ext.anisotropy.as_mut().and_then(|it| one(&mut it.anisotropy_strength)),
            M::AnisotropyRotation => ext.anisotropy.as_mut().and_then(|it| one(&mut it.anisotropy_rotation)),
            M::ClearcoatFactor => ext.clearcoat.as_mut().and_then(|it| one(&mut it.clearcoat_factor)),
            M::ClearcoatRoughnessFactor => {
                ext.clearcoat.as_mut().and_then(|it| one(&mut it.clearcoat_roughness_factor))
            }
            M::ClearcoatNormalScale => ext
                .clearcoat
                .as_mut()
                .and_then(|it| it.clearcoat_normal_texture.as_mut().and_then(|it| one(&mut it.scale))),
            M::DiffuseTransmissionFactor => {
                ext.diffuse_transmission.as_mut().and_then(|it| one(&mut it.diffuse_transmission_factor))
            }
            M::DiffuseTransmissionColorFactor => ext
                .diffuse_transmission
                .as_mut()
                .and_then(|it| three(&mut it.diffuse_transmission_color_factor)),
            M::Dispersion => ext.dispersion.as_mut().and_then(|it| one(&mut it.dispersion)),
            M::EmissiveStrength => {
                ext.emissive_strength.as_mut().and_then(|it| one(&mut it.emissive_strength))
            }
            M::Ior => ext.ior.as_mut().and_then(|it| one(&mut it.ior)),
            M::IridescenceFactor => ext.iridescence.as_mut().and_then(|it| one(&mut it.iridescence_factor)),
            M::IridescenceIor => ext.iridescence.as_mut().and_then(|it| one(&mut it.iridescence_ior)),
            M::IridescenceThicknessMinimum => {
                ext.iridescence.as_mut().and_then(|it| one(&mut it.iridescence_thickness_minimum))
            }
            M::IridescenceThicknessMaximum => {
                ext.iridescence.as_mut().and_then(|it| one(&mut it.iridescence_thickness_maximum))
            }
            M::SheenColorFactor => ext.sheen.as_mut().and_then(|it| three(&mut it.sheen_color_factor)),
            M::SheenRoughnessFactor => ext.sheen.as_mut().and_then(|it| one(&mut it.sheen_roughness_factor)),
            M::SpecularFactor => ext.specular.as_mut().and_then(|it| one(&mut it.specular_factor)),
            M::SpecularColorFactor => {
                ext.specular.as_mut().and_then(|it| three(&mut it.specular_color_factor))
            }
            M::TransmissionFactor => {
                ext.transmission.as_mut().and_then(|it| one(&mut it.transmission_factor))
            }
            M::ThicknessFactor => ext.volume.as_mut().and_then(|it| one(&mut it.thickness_factor)),
            M::AttenuationDistance => {
                ext.volume.as_mut().and_then(|it| one(it.attenuation_distance.get_or_insert(f32::MAX)))
            }
            M::AttenuationColor => ext.volume.as_mut().and_then(|it| three(&mut it.attenuation_color)),
            M::TextureOffset(_) | M::TextureRotation(_) | M::TextureScale(_) => None,
        }
    }
}

impl CameraProperty {
    /// By its place below the camera.
    pub(crate) fn from_path(path: &str) -> Option<Self> {
        CAMERA.iter().find(|(_, known)| *known == path).map(|(property, _)| *property)
    }

    /// Its place below the camera.
    pub(crate) fn path(self) -> &'static str {
        CAMERA.iter().find(|(known, _)| *known == self).map_or("", |(_, path)| *path)
    }

    /// Whether the camera is of the type that has it.
    pub(crate) fn is_of(self, camera: &Camera) -> bool {
        match self {
            C::AspectRatio | C::Yfov | C::Znear | C::Zfar => camera.perspective.is_some(),
            C::Xmag | C::Ymag | C::OrthographicZnear | C::OrthographicZfar => camera.orthographic.is_some(),
        }
    }
}

impl LightProperty {
    /// By its place below the light.
    pub(crate) fn from_path(path: &str) -> Option<Self> {
        LIGHT.iter().find(|(_, known)| *known == path).map(|(property, _)| *property)
    }

    /// Its place below the light.
    pub(crate) fn path(self) -> &'static str {
        LIGHT.iter().find(|(known, _)| *known == self).map_or("", |(_, path)| *path)
    }

    /// Components of its value.
    pub fn width(self) -> usize {
        if self == L::Color { 3 } else { 1 }
    }

    /// The numbers; a default that the file leaves out is put there.
    pub(crate) fn values(self, light: &mut Light) -> &mut [f32] {
        match self {
            L::Color => &mut light.color,
            L::Intensity => std::slice::from_mut(&mut light.intensity),
            L::Range => std::slice::from_mut(light.range.get_or_insert(f32::MAX)),
            L::InnerConeAngle => std::slice::from_mut(&mut cone(light).inner_cone_angle),
            L::OuterConeAngle => std::slice::from_mut(&mut cone(light).outer_cone_angle),
        }
    }

    /// Whether the light is of the kind that has it.
    pub(crate) fn is_of(self, light: &Light) -> bool {
        !matches!(self, L::InnerConeAngle | L::OuterConeAngle) || light.spot.is_some()
    }
}

fn cone(light: &mut Light) -> &mut Spot {
    let outer_cone_angle = std::f32::consts::FRAC_PI_4;
    light.spot.get_or_insert(Spot { inner_cone_angle: 0.0, outer_cone_angle })
}

fn one(value: &mut f32) -> Option<&mut [f32]> {
    Some(std::slice::from_mut(value))
}

fn three(value: &mut [f32; 3]) -> Option<&mut [f32]> {
    Some(value)
}

fn texture(slot: T, material: &mut Material) -> Option<&mut TextureInfo> {
    let base = &mut material.pbr_metallic_roughness;
    let ext = &mut material.extensions;
    match slot {
        T::BaseColor => base.base_color_texture.as_mut(),
        T::MetallicRoughness => base.metallic_roughness_texture.as_mut(),
        T::Normal => material.normal_texture.as_mut().map(|it| &mut it.info),
        T::Occlusion => material.occlusion_texture.as_mut().map(|it| &mut it.info),
        T::Emissive => material.emissive_texture.as_mut(),
        T::Anisotropy => ext.anisotropy.as_mut().and_then(|it| it.anisotropy_texture.as_mut()),
        T::Clearcoat => ext.clearcoat.as_mut().and_then(|it| it.clearcoat_texture.as_mut()),
        T::ClearcoatRoughness => {
            ext.clearcoat.as_mut().and_then(|it| it.clearcoat_roughness_texture.as_mut())
        }
        T::ClearcoatNormal => {
            ext.clearcoat.as_mut().and_then(|it| it.clearcoat_normal_texture.as_mut()).map(|it| &mut it.info)
        }
        T::DiffuseTransmission => {
            ext.diffuse_transmission.as_mut().and_then(|it| it.diffuse_transmission_texture.as_mut())
        }
        T::DiffuseTransmissionColor => {
            ext.diffuse_transmission.as_mut().and_then(|it| it.diffuse_transmission_color_texture.as_mut())
        }
        T::Iridescence => ext.iridescence.as_mut().and_then(|it| it.iridescence_texture.as_mut()),
        T::IridescenceThickness => {
            ext.iridescence.as_mut().and_then(|it| it.iridescence_thickness_texture.as_mut())
        }
        T::SheenColor => ext.sheen.as_mut().and_then(|it| it.sheen_color_texture.as_mut()),
        T::SheenRoughness => ext.sheen.as_mut().and_then(|it| it.sheen_roughness_texture.as_mut()),
        T::Specular => ext.specular.as_mut().and_then(|it| it.specular_texture.as_mut()),
        T::SpecularColor => ext.specular.as_mut().and_then(|it| it.specular_color_texture.as_mut()),
        T::Transmission => ext.transmission.as_mut().and_then(|it| it.transmission_texture.as_mut()),
        T::Thickness => ext.volume.as_mut().and_then(|it| it.thickness_texture.as_mut()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_property_is_found_at_its_own_place_and_no_other() {
        for &(property, path, width) in FACTORS {
            assert_eq!(
                (MaterialProperty::from_path(path), property.path()),
                (Some(property), path.to_owned())
            );
            assert_eq!(property.width(), width);
        }
        for &(slot, _) in SLOTS {
            for property in [M::TextureOffset(slot), M::TextureRotation(slot), M::TextureScale(slot)] {
                assert_eq!(MaterialProperty::from_path(&property.path()), Some(property));
            }
        }
        for &(property, path) in CAMERA {
            assert_eq!((CameraProperty::from_path(path), property.path()), (Some(property), path));
        }
        for &(property, path) in LIGHT {
            assert_eq!((LightProperty::from_path(path), property.path()), (Some(property), path));
        }
        for path in
            ["", "doubleSided", "normalTexture", "normalTexture/extensions/KHR_texture_transform/texCoord"]
        {
            assert_eq!(MaterialProperty::from_path(path), None, "{path}");
        }
    }

    #[test]
    fn factor_of_an_extension_exists_where_the_extension_does() {
        let mut material = Material::default();
        assert_eq!(M::ClearcoatFactor.values(&mut material), None);
        material.extensions.clearcoat = Some(crate::schema::Clearcoat::default());
        M::ClearcoatFactor.values(&mut material).unwrap()[0] = 0.5;
        assert_eq!(material.extensions.clearcoat.unwrap().clearcoat_factor, 0.5);
    }
}
