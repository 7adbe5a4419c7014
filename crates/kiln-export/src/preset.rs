//! The engines and what each wants baked.

use kiln_bake::{RoughnessLaw, TexelFormat};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Faces of the specular map unless somebody asks for another size.
pub const FACE_SIZE_DEFAULT: usize = 256;

/// Whose conventions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preset {
    /// Bevy's `EnvironmentMapLight` and `Skybox`.
    Bevy,
    /// three.js: panoramas for `PMREMGenerator`, `CubeTexture`, `LightProbe`.
    Three,
    /// Filament's `IndirectLight` and `Skybox`, as `cmgen` writes them.
    Filament,
    /// Khronos' glTF-Sample-Renderer and whatever else reads the files of glTF-IBL-Sampler.
    Khronos,
    /// Everything, unrounded, in Kiln's own conventions.
    Raw,
}

/// No preset has this name.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{0}` is no engine preset; there are bevy, three, filament, khronos and raw")]
pub struct UnknownPreset(
    /// The name.
    pub String,
);

/// What to bake for an engine. Sizes are texels along a face's edge.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// Roughness of the levels of the specular and the sheen chain.
    pub law: RoughnessLaw,
    /// Level 0 of the skybox; its chain goes down to 1.
    pub skybox_face: usize,
    /// Level 0 of the specular chain (GGX); level 0 has roughness 0 and is the skybox itself.
    pub specular_face: usize,
    /// Levels of the specular and the sheen chain; 0 where the engine filters for itself.
    pub specular_levels: usize,
    /// Whether a Charlie chain of the same sizes and law is wanted.
    pub sheen: bool,
    /// Size of the irradiance map (E/π); `None` where the engine takes harmonics.
    pub irradiance_face: Option<usize>,
    /// Highest degree of the radiance harmonics; `None` where none are written.
    pub sh_order: Option<usize>,
    /// Size of the GGX table (scale, bias); `None` where the engine has its own.
    pub dfg_size: Option<usize>,
}

impl Preset {
    /// All of them.
    pub const ALL: [Preset; 5] =
        [Preset::Bevy, Preset::Three, Preset::Filament, Preset::Khronos, Preset::Raw];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Bevy => "bevy",
            Preset::Three => "three",
            Preset::Filament => "filament",
            Preset::Khronos => "khronos",
            Preset::Raw => "raw",
        }
    }

    /// Texel formats of cubes that the engine reads, the usual one first; none where it takes `.hdr` and `.exr`.
    ///
    /// Bevy samples whatever wgpu filters (BC6H needs `TEXTURE_COMPRESSION_BC`, binary32 `FLOAT32_FILTERABLE`);
    /// Filament's KTX 1 reader takes packed and half floats alike; Khronos' renderer asks WebGL for half and full floats.
    pub fn formats(self) -> &'static [TexelFormat] {
        use TexelFormat::{Bc6hUfloat, R11g11b10Ufloat, Rgb9e5Ufloat, Rgba16Float, Rgba32Float};
        match self {
            Preset::Bevy => &[Rgb9e5Ufloat, Rgba16Float, Bc6hUfloat, Rgba32Float],
            Preset::Three => &[],
            Preset::Filament => &[R11g11b10Ufloat, Rgba16Float],
            Preset::Khronos => &[Rgba16Float, Rgba32Float],
            Preset::Raw => &[Rgba32Float, Rgba16Float, Rgb9e5Ufloat, R11g11b10Ufloat, Bc6hUfloat],
        }
    }

    /// The engine's law from mip to roughness.
    pub fn law(self) -> RoughnessLaw {
        if self == Preset::Filament { RoughnessLaw::Filament } else { RoughnessLaw::Linear }
    }

    /// What to bake, for a specular map with faces of `face_size`.
    ///
    /// Every engine here finds the last level by counting, so a chain need not go down to one texel; the rough end would
    /// only be coarse. Filament's and Khronos' tools end at 16 texels (`cmgen.cpp`, `IBL_DEFAULT_MIN_LOD_SIZE`;
    /// `ibl_sampler.js`, `lowestMipLevel = 4`) and so does Bevy's chain here. Kiln's own goes down to 1.
    pub fn wish(self, face_size: usize) -> Wish {
        let smallest_face = if self == Preset::Raw { 1 } else { 16 };
        let levels = |face: usize| {
            1 + face.checked_div(smallest_face).map_or(0, |ratio| ratio.max(1).ilog2() as usize)
        };
        Wish {
            law: self.law(),
            skybox_face: face_size,
            specular_face: face_size,
            specular_levels: if self == Preset::Three { 0 } else { levels(face_size) },
            sheen: matches!(self, Preset::Khronos | Preset::Raw),
            irradiance_face: (!matches!(self, Preset::Three | Preset::Filament)).then_some(64),
            sh_order: match self {
                Preset::Three | Preset::Filament => Some(2),
                Preset::Raw => Some(8),
                Preset::Bevy | Preset::Khronos => None,
            },
            dfg_size: matches!(self, Preset::Khronos | Preset::Raw).then_some(128),
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Preset, UnknownPreset> {
        let found = Preset::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| UnknownPreset(name.to_owned()))
    }
}
