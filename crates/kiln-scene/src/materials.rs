//! From glTF's materials to flat ones, and what they call for.

use crate::effect::variant_name;
use crate::schema;
use crate::{AlphaMode, EffectSet, Material, TextureRef};

/// Turns a pruned schema material into what the renderer reads. `place` maps a texture of the file, with
/// its colour space, to one of the scene.
pub(crate) fn flatten(
    source: &schema::Material,
    name: String,
    effects: EffectSet,
    place: &mut dyn FnMut(&schema::TextureInfo, crate::ColorSpace) -> TextureRef,
) -> Material {
    use crate::ColorSpace::{Linear, Srgb};
    let mut at = |info: Option<&schema::TextureInfo>, space| info.map(|info| place(info, space));
    let base = &source.pbr_metallic_roughness;
    let extensions = &source.extensions;
    let clearcoat = extensions.clearcoat.clone().unwrap_or_default();
    let sheen = extensions.sheen.clone().unwrap_or_default();
    let specular = extensions.specular.clone().unwrap_or_default();
    let transmission = extensions.transmission.clone().unwrap_or_default();
    let anisotropy = extensions.anisotropy.clone().unwrap_or_default();
    let film = extensions.iridescence.clone().unwrap_or_default();
    let volume = extensions.volume.clone().unwrap_or_default();
    let diffuse = extensions.diffuse_transmission.clone().unwrap_or_default();
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |it| it.emissive_strength);
    let coat_normal = clearcoat.clearcoat_normal_texture.as_ref();
    Material {
        name,
        base_color_factor: base.base_color_factor,
        metallic_factor: base.metallic_factor,
        roughness_factor: base.roughness_factor,
        emissive_factor: source.emissive_factor.map(|value| value * strength),
        normal_scale: source.normal_texture.as_ref().map_or(1.0, |texture| texture.scale),
        occlusion_strength: source.occlusion_texture.as_ref().map_or(1.0, |texture| texture.strength),
        ior: extensions.ior.as_ref().map_or(1.5, |it| it.ior),
        specular_factor: specular.specular_factor,
        specular_color_factor: specular.specular_color_factor,
        clearcoat_factor: clearcoat.clearcoat_factor,
        clearcoat_roughness_factor: clearcoat.clearcoat_roughness_factor,
        clearcoat_normal_scale: coat_normal.map_or(1.0, |texture| texture.scale),
        sheen_color_factor: sheen.sheen_color_factor,
        sheen_roughness_factor: sheen.sheen_roughness_factor,
        transmission_factor: transmission.transmission_factor,
        anisotropy_strength: anisotropy.anisotropy_strength,
        anisotropy_rotation: anisotropy.anisotropy_rotation,
        iridescence_factor: film.iridescence_factor,
        iridescence_ior: film.iridescence_ior,
        iridescence_thickness_minimum: film.iridescence_thickness_minimum,
        iridescence_thickness_maximum: film.iridescence_thickness_maximum,
        thickness_factor: volume.thickness_factor,
        attenuation_distance: volume.attenuation_distance.unwrap_or(f32::INFINITY),
        attenuation_color: volume.attenuation_color,
        dispersion: extensions.dispersion.unwrap_or_default().dispersion,
        diffuse_transmission_factor: diffuse.diffuse_transmission_factor,
        diffuse_transmission_color_factor: diffuse.diffuse_transmission_color_factor,
        alpha_mode: alpha_mode(source),
        double_sided: source.double_sided,
        base_color_texture: at(base.base_color_texture.as_ref(), Srgb),
        metallic_roughness_texture: at(base.metallic_roughness_texture.as_ref(), Linear),
        normal_texture: at(source.normal_texture.as_ref().map(|texture| &texture.info), Linear),
        occlusion_texture: at(source.occlusion_texture.as_ref().map(|texture| &texture.info), Linear),
        emissive_texture: at(source.emissive_texture.as_ref(), Srgb),
        clearcoat_texture: at(clearcoat.clearcoat_texture.as_ref(), Linear),
        clearcoat_roughness_texture: at(clearcoat.clearcoat_roughness_texture.as_ref(), Linear),
        clearcoat_normal_texture: at(coat_normal.map(|texture| &texture.info), Linear),
        sheen_color_texture: at(sheen.sheen_color_texture.as_ref(), Srgb),
        sheen_roughness_texture: at(sheen.sheen_roughness_texture.as_ref(), Linear),
        specular_texture: at(specular.specular_texture.as_ref(), Linear),
        specular_color_texture: at(specular.specular_color_texture.as_ref(), Srgb),
        transmission_texture: at(transmission.transmission_texture.as_ref(), Linear),
        anisotropy_texture: at(anisotropy.anisotropy_texture.as_ref(), Linear),
        iridescence_texture: at(film.iridescence_texture.as_ref(), Linear),
        iridescence_thickness_texture: at(film.iridescence_thickness_texture.as_ref(), Linear),
        thickness_texture: at(volume.thickness_texture.as_ref(), Linear),
        diffuse_transmission_texture: at(diffuse.diffuse_transmission_texture.as_ref(), Linear),
        diffuse_transmission_color_texture: at(diffuse.diffuse_transmission_color_texture.as_ref(), Srgb),
        effects,
    }
}

/// `None` for a mode that glTF does not have.
pub(crate) fn parse_alpha_mode(source: &schema::Material) -> Option<AlphaMode> {
    match source.alpha_mode.as_deref() {
        None | Some("OPAQUE") => Some(AlphaMode::Opaque),
        Some("MASK") => Some(AlphaMode::Mask { cutoff: source.alpha_cutoff.unwrap_or(0.5) }),
        Some("BLEND") => Some(AlphaMode::Blend),
        Some(_) => None,
    }
}

fn alpha_mode(source: &schema::Material) -> AlphaMode {
    parse_alpha_mode(source).unwrap_or(AlphaMode::Opaque)
}

/// `KHR_texture_transform`: scale, then rotation, then offset, as two rows of an affine map.
///
/// ```text
/// u' =  cos r · sx · u + sin r · sy · v + ox
/// v' = −sin r · sx · u + cos r · sy · v + oy
/// ```
pub(crate) fn transform_rows(transform: Option<&schema::TextureTransform>) -> [[f32; 3]; 2] {
    let Some(transform) = transform else { return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    let rotation = f64::from(transform.rotation);
    let (sin, cos) = (libm::sin(rotation) as f32, libm::cos(rotation) as f32);
    let ([sx, sy], [ox, oy]) = (transform.scale, transform.offset);
    [[cos * sx, sin * sy, ox], [-sin * sx, cos * sy, oy]]
}

/// UV set of a texture; the transform's overrides the texture's own.
pub(crate) fn uv_set(info: &schema::TextureInfo) -> u32 {
    info.extensions.transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord)
}

impl Material {
    /// Name of the shader variant that draws it.
    pub fn variant_name(&self) -> String {
        variant_name(&self.effects)
    }
}
