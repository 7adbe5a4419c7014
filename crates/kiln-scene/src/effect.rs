//! Names of effects and of their sets.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Effect, EffectSet};

impl Effect {
    /// Every effect, in the order of their names.
    pub const ALL: [Effect; 21] = [
        Effect::AlphaBlend,
        Effect::AlphaMask,
        Effect::Anisotropy,
        Effect::Clearcoat,
        Effect::DiffuseTransmission,
        Effect::Dispersion,
        Effect::Emission,
        Effect::Instancing,
        Effect::Iridescence,
        Effect::Morph,
        Effect::NormalMap,
        Effect::Occlusion,
        Effect::PunctualLights,
        Effect::Sheen,
        Effect::Skin,
        Effect::Specular,
        Effect::Sun,
        Effect::Transmission,
        Effect::Unlit,
        Effect::VertexColor,
        Effect::Volume,
    ];

    /// The feature that a shader is compiled with.
    pub fn name(self) -> &'static str {
        match self {
            Effect::AlphaBlend => "alpha_blend",
            Effect::AlphaMask => "alpha_mask",
            Effect::Anisotropy => "anisotropy",
            Effect::Clearcoat => "clearcoat",
            Effect::DiffuseTransmission => "diffuse_transmission",
            Effect::Dispersion => "dispersion",
            Effect::Emission => "emission",
            Effect::Instancing => "instancing",
            Effect::Iridescence => "iridescence",
            Effect::Morph => "morph",
            Effect::NormalMap => "normal_map",
            Effect::Occlusion => "occlusion",
            Effect::PunctualLights => "punctual_lights",
            Effect::Sheen => "sheen",
            Effect::Skin => "skin",
            Effect::Specular => "specular",
            Effect::Sun => "sun",
            Effect::Transmission => "transmission",
            Effect::Unlit => "unlit",
            Effect::VertexColor => "vertex_color",
            Effect::Volume => "volume",
        }
    }

    /// Whether vertices call for it, not a material.
    pub fn is_of_geometry(self) -> bool {
        matches!(self, Effect::Instancing | Effect::Morph | Effect::Skin)
    }

    /// Whether a material's values call for it, or the scene that holds it; not its vertices, and not the environment.
    pub fn is_of_material(self) -> bool {
        !self.is_of_geometry() && self != Effect::Sun
    }

    /// The effect of that [`name`](Effect::name).
    pub fn from_name(name: &str) -> Option<Effect> {
        Effect::ALL.into_iter().find(|effect| effect.name() == name)
    }
}

/// What materials have besides what their values call for, and what they may not have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EffectOverrides {
    /// Every material has these, as far as they are [materials'](Effect::is_of_material): no setting gives a mesh joints.
    pub force: EffectSet,
    /// No material has these.
    pub forbid: EffectSet,
}

impl EffectOverrides {
    /// The effects that a material is drawn with.
    pub fn apply(&self, effects: &EffectSet) -> EffectSet {
        let forced = self.force.iter().filter(|effect| effect.is_of_material());
        effects.iter().chain(forced).filter(|effect| !self.forbid.contains(effect)).copied().collect()
    }

    /// What [`apply`](Self::apply) made of a material, in the light of an environment whose sun is a light of its own.
    pub fn under_sun(&self, effects: &EffectSet) -> EffectSet {
        let is_lit = !effects.contains(&Effect::Unlit) && !self.forbid.contains(&Effect::Sun);
        effects.iter().copied().chain(is_lit.then_some(Effect::Sun)).collect()
    }
}

/// Name of the shader variant: the effects' names in alphabetical order joined by `+`, or `base` for none.
pub fn variant_name(effects: &EffectSet) -> String {
    let mut names: Vec<&str> = effects.iter().map(|effect| effect.name()).collect();
    names.sort_unstable();
    if names.is_empty() { "base".into() } else { names.join("+") }
}

impl Serialize for Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Effect {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Effect::from_name(&name).ok_or_else(|| serde::de::Error::custom(format!("unknown effect `{name}`")))
    }
}
