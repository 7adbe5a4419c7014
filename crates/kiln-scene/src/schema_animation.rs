//! Animations, and the extensions that only they or `KHR_materials_variants` need.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::is_default;

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct Animation {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(default)]
    pub channels: Vec<AnimationChannel>,
    #[serde(default)]
    pub samplers: Vec<AnimationSampler>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct AnimationChannel {
    pub sampler: usize,
    pub target: ChannelTarget,
}

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct ChannelTarget {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
    pub path: String,
    #[serde(default, skip_serializing_if = "is_default")]
    pub extensions: TargetExtensions,
}

#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct TargetExtensions {
    #[serde(rename = "KHR_animation_pointer", default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<Pointer>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Pointer {
    pub pointer: String,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct AnimationSampler {
    pub input: usize,
    pub output: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<String>,
}

/// `KHR_materials_variants` of the file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub(crate) struct Variants {
    pub variants: Vec<Variant>,
}

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Variant {
    pub name: String,
}

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct PrimitiveExtensions {
    #[serde(rename = "KHR_materials_variants", default, skip_serializing_if = "Option::is_none")]
    pub variants: Option<VariantMappings>,
    #[serde(flatten, skip_serializing)]
    pub others: BTreeMap<String, serde::de::IgnoredAny>,
}

#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct VariantMappings {
    #[serde(default)]
    pub mappings: Vec<VariantMapping>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct VariantMapping {
    pub material: usize,
    pub variants: Vec<usize>,
}

/// Where a texture has its image besides `source`.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp", default, skip_serializing)]
    pub webp: Option<TextureSource>,
    #[serde(flatten, skip_serializing)]
    pub others: BTreeMap<String, serde::de::IgnoredAny>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct TextureSource {
    pub source: usize,
}
