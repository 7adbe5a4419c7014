//! What the scene is made of: each material with the variant that draws it, and why that variant is there.

use kiln_scene::{AlphaMode, Effect, EffectSet, Material, Scene, TextureRef, variant_name};

use crate::scene_gpu::all_draws;

/// A material as some draws show it.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedMaterial {
    /// Its name in the file, or its number.
    pub name: String,
    /// The variant of the shader, as `clearcoat+normal_map`.
    pub variant: String,
    /// How many draws show it so.
    pub draw_count: usize,
    /// Each effect of the variant, and what of the material, the mesh or the project calls for it.
    pub effects: Vec<(Effect, String)>,
}

/// Every material that is drawn in a material variant of the scene, in the scene's order. One that is drawn on several kinds of
/// geometry is there for each. `drawn_with` says which effects they are drawn with that call for some.
pub(crate) fn list(
    scene: &Scene,
    variant: Option<usize>,
    drawn_with: &dyn Fn(&EffectSet) -> EffectSet,
) -> Vec<ListedMaterial> {
    let mut found: Vec<(usize, EffectSet, usize)> = Vec::new();
    for draw in all_draws(scene) {
        let material = scene.material_of(draw, variant);
        let own = scene.effects(draw, material);
        match found.iter_mut().find(|(other, effects, _)| *other == material && *effects == own) {
            Some((.., count)) => *count += 1,
            None => found.push((material, own, 1)),
        }
    }
    found.sort_by_key(|(material, ..)| *material);
    let describe = |(index, own, draw_count): (usize, EffectSet, usize)| {
        let material = &scene.materials[index];
        let name = if material.name.is_empty() { format!("material {index}") } else { material.name.clone() };
        let effects = drawn_with(&own);
        let why = |effect: &Effect| {
            let is_own = own.contains(effect) || *effect == Effect::Sun;
            let forced = || "`force` of [effects] in kiln.toml".to_owned();
            (*effect, if is_own { reason(material, *effect) } else { forced() })
        };
        let variant = variant_name(&effects);
        ListedMaterial { name, variant, draw_count, effects: effects.iter().map(why).collect() }
    };
    found.into_iter().map(describe).collect()
}

/// What calls for an effect, in the words of glTF.
fn reason(material: &Material, effect: Effect) -> String {
    let factor = |name: &str, value: f32, texture: Option<TextureRef>| {
        let texture = if texture.is_some() { ", with a texture" } else { "" };
        format!("{name} {}{texture}", short(value))
    };
    let color = |name: &str, value: [f32; 3], texture: Option<TextureRef>| {
        let texture = if texture.is_some() { ", with a texture" } else { "" };
        format!("{name} {}{texture}", value.map(short).join(", "))
    };
    match effect {
        Effect::AlphaBlend => "alphaMode BLEND".to_owned(),
        Effect::AlphaMask => match material.alpha_mode {
            AlphaMode::Mask { cutoff } => format!("alphaMode MASK, alphaCutoff {}", short(cutoff)),
            AlphaMode::Opaque | AlphaMode::Blend => "alphaMode MASK".to_owned(),
        },
        Effect::Anisotropy => {
            factor("anisotropyStrength", material.anisotropy_strength, material.anisotropy_texture)
        }
        Effect::Clearcoat => factor("clearcoatFactor", material.clearcoat_factor, material.clearcoat_texture),
        Effect::DiffuseTransmission => factor(
            "diffuseTransmissionFactor",
            material.diffuse_transmission_factor,
            material.diffuse_transmission_texture,
        ),
        Effect::Dispersion => factor("dispersion", material.dispersion, None),
        Effect::Emission => color("emissiveFactor", material.emissive_factor, material.emissive_texture),
        Effect::Instancing => "the mesh is drawn in copies (EXT_mesh_gpu_instancing)".to_owned(),
        Effect::Iridescence => {
            factor("iridescenceFactor", material.iridescence_factor, material.iridescence_texture)
        }
        Effect::Morph => "an animation changes the mesh's morph weights".to_owned(),
        Effect::NormalMap => {
            let scale = short(material.normal_scale);
            format!("a normal texture that is not flat, scale {scale}")
        }
        Effect::Occlusion => {
            format!("an occlusion texture, strength {}", short(material.occlusion_strength))
        }
        Effect::PunctualLights => "a lamp of the scene shines (KHR_lights_punctual)".to_owned(),
        Effect::Sheen => color("sheenColorFactor", material.sheen_color_factor, material.sheen_color_texture),
        Effect::Skin => "an animation moves the mesh's joints".to_owned(),
        Effect::Sun => "the environment's sun is a light of its own (`sun = \"extract\"`)".to_owned(),
        Effect::Specular => format!(
            "ior {}, {}, {}",
            short(material.ior),
            factor("specularFactor", material.specular_factor, material.specular_texture),
            color("specularColorFactor", material.specular_color_factor, material.specular_color_texture),
        ),
        Effect::Transmission => {
            factor("transmissionFactor", material.transmission_factor, material.transmission_texture)
        }
        Effect::Unlit => "KHR_materials_unlit".to_owned(),
        Effect::VertexColor => "the mesh has COLOR_0".to_owned(),
        Effect::Volume => factor("thicknessFactor", material.thickness_factor, material.thickness_texture),
    }
}

/// A number with no more digits than it has.
fn short(value: f32) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
