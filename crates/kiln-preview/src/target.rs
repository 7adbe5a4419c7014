//! What the targets of a revision say about themselves.

use std::collections::BTreeSet;

use kiln_diagnostic::Diagnostic;
use kiln_image::ktx2;
use kiln_link::Target;
use kiln_scene::EffectOverrides;
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// `meta` of an `env/NAME/…` target.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct CubeMeta {
    pub size: u32,
    pub levels: u32,
    pub format: TexelFormat,
    /// Radiance is texel · 2^scale_log2.
    #[serde(default)]
    pub scale_log2: i32,
    /// Set where only the levels from this one on, as far as there are parts, are read.
    pub first_level: Option<u32>,
}

/// `meta` of `lut/ggx`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct LutMeta {
    pub size: u32,
    pub format: TexelFormat,
}

/// `meta` of a `scene/NAME` target.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct SceneMeta {
    #[serde(default)]
    pub env: Option<String>,
    pub shader: String,
    #[serde(default)]
    pub notes: Vec<String>,
}

/// `meta` of a `shader/NAME/VARIANT` target.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct ShaderMeta {
    pub role: Role,
    /// Which of its own textures hold sRGB-encoded colour.
    #[serde(default)]
    pub srgb_textures: Vec<String>,
}

impl ShaderMeta {
    /// Whether `target` is a shader with this role.
    pub fn is_of_role(target: &Target, role: Role) -> bool {
        target.kind == "shader" && ShaderMeta::deserialize(&target.meta).is_ok_and(|meta| meta.role == role)
    }
}

/// `meta` of the `project` target.
#[derive(Clone, Debug, Default, Deserialize)]
pub(crate) struct ProjectMeta {
    #[serde(default)]
    pub name: String,
    #[serde(default)]
    pub scenes: Vec<String>,
    #[serde(default)]
    pub envs: Vec<String>,
    /// Targets that are absent because nothing reads them.
    #[serde(default)]
    pub unread: BTreeSet<String>,
    /// What scenes are drawn with besides, and without.
    #[serde(default)]
    pub effects: EffectOverrides,
}

/// What a shader is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Role {
    Material,
    Background,
    Tonemap,
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Role::Material => "material",
            Role::Background => "background",
            Role::Tonemap => "tonemap",
        })
    }
}

/// Texels as they travel: little-endian, tight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TexelFormat {
    Rgba16F,
    Rgba32F,
    Rg16F,
    Rg32F,
    Rgb9e5,
    R11g11b10F,
    Bc6h,
}

impl TexelFormat {
    /// The container's name of a format whose texels are no plain channels.
    pub fn packed(self) -> Option<ktx2::Format> {
        match self {
            TexelFormat::Rgb9e5 => Some(ktx2::Format::E5B9G9R9_UFLOAT_PACK32),
            TexelFormat::R11g11b10F => Some(ktx2::Format::B10G11R11_UFLOAT_PACK32),
            TexelFormat::Bc6h => Some(ktx2::Format::BC6H_UFLOAT_BLOCK),
            _ => None,
        }
    }

    /// The plain format that packed texels are shown in: not every device reads them.
    pub fn unpacked(self) -> Self {
        if self.packed().is_some() { TexelFormat::Rgba16F } else { self }
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> u64 {
        match self {
            TexelFormat::Rgba32F => 16,
            TexelFormat::Rgba16F | TexelFormat::Rg32F => 8,
            TexelFormat::Rg16F | TexelFormat::Rgb9e5 | TexelFormat::R11g11b10F => 4,
            TexelFormat::Bc6h => 1,
        }
    }

    /// Channels of a texel.
    pub fn channels(self) -> u32 {
        match self {
            TexelFormat::Rgba16F | TexelFormat::Rgba32F => 4,
            TexelFormat::Rg16F | TexelFormat::Rg32F => 2,
            TexelFormat::Rgb9e5 | TexelFormat::R11g11b10F | TexelFormat::Bc6h => 3,
        }
    }

    /// Whether a channel is a 32-bit float.
    pub fn is_float32(self) -> bool {
        matches!(self, TexelFormat::Rgba32F | TexelFormat::Rg32F)
    }

    /// The same channels in 16 bits.
    pub fn halved(self) -> Self {
        match self {
            TexelFormat::Rgba32F => TexelFormat::Rgba16F,
            TexelFormat::Rg32F => TexelFormat::Rg16F,
            same => same,
        }
    }

    /// wgpu's name.
    pub fn wgpu(self) -> wgpu::TextureFormat {
        match self {
            // Packed texels are unpacked before they are uploaded.
            TexelFormat::Rgba16F | TexelFormat::Rgb9e5 | TexelFormat::R11g11b10F | TexelFormat::Bc6h => {
                wgpu::TextureFormat::Rgba16Float
            }
            TexelFormat::Rgba32F => wgpu::TextureFormat::Rgba32Float,
            TexelFormat::Rg16F => wgpu::TextureFormat::Rg16Float,
            TexelFormat::Rg32F => wgpu::TextureFormat::Rg32Float,
        }
    }
}

/// Reads a target's `meta`, after its kind.
pub(crate) fn read_meta<T: DeserializeOwned>(
    name: &str,
    target: &Target,
    kind: &str,
) -> Result<T, Diagnostic> {
    if target.kind != kind {
        return Err(Diagnostic::error(format!("target `{name}` is a `{}`, not a `{kind}`", target.kind)));
    }
    T::deserialize(&target.meta).map_err(|error| {
        Diagnostic::error(format!("the description of target `{name}` is malformed: {error}"))
    })
}
