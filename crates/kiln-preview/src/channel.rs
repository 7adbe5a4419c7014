//! What can be shown of a pixel in place of its radiance: `docs/shader-interface.md`, "Debug channels".

use std::fmt;
use std::str::FromStr;

use kiln_scene::Effect;

/// A value of the material or a part of its light. The order is that of `shaders/lib/inspect.wgsl`, which begins with 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Base colour with its texture and vertex colours.
    BaseColor,
    /// Alpha of the base colour.
    Alpha,
    /// Perceptual roughness as the material has it, before normals widen it.
    Roughness,
    /// How much of a metal it is.
    Metalness,
    /// Normal of the mesh, towards the eye.
    GeometricNormal,
    /// Normal with its map.
    ShadingNormal,
    /// Tangent of the mesh.
    Tangent,
    /// First texture coordinates.
    Uv0,
    /// Second texture coordinates.
    Uv1,
    /// Ambient occlusion.
    Occlusion,
    /// Reflectance at normal incidence.
    F0,
    /// Level that the base colour's texture is read at.
    Mip,
    /// Which variant of the shader draws it.
    Variant,
    /// What it emits.
    Emission,
    /// The diffuse lobe.
    Diffuse,
    /// The specular lobe of the base, several bounces included.
    Specular,
    /// The clearcoat's lobe.
    Clearcoat,
    /// The sheen's lobe.
    Sheen,
    /// What comes through.
    Transmission,
    /// The share of the scene's own lights and of the sun.
    Punctual,
}

/// What shaders know faults of radiance by: `faults` of `shaders/lib/inspect.wgsl`.
pub(crate) const FAULTS_CODE: u32 = 0;

/// How the values of a channel become a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Linear values in [0, 1], sRGB-encoded, as textures hold them.
    Color,
    /// Values in [0, 1] as they are: 0.5 is 128.
    Data,
    /// Components of unit vectors, [-1, 1] to [0, 1].
    Direction,
    /// Red and green are the fractions of u and v.
    Uv,
    /// A colour for each level, mixed between.
    Level,
    /// Radiance: exposed and tone-mapped like the picture.
    Radiance,
}

impl Channel {
    /// All there are.
    pub const ALL: [Channel; 20] = [
        Channel::BaseColor,
        Channel::Alpha,
        Channel::Roughness,
        Channel::Metalness,
        Channel::GeometricNormal,
        Channel::ShadingNormal,
        Channel::Tangent,
        Channel::Uv0,
        Channel::Uv1,
        Channel::Occlusion,
        Channel::F0,
        Channel::Mip,
        Channel::Variant,
        Channel::Emission,
        Channel::Diffuse,
        Channel::Specular,
        Channel::Clearcoat,
        Channel::Sheen,
        Channel::Transmission,
        Channel::Punctual,
    ];

    /// Its name in commands, as `base-color`.
    pub fn name(self) -> &'static str {
        match self {
            Channel::BaseColor => "base-color",
            Channel::Alpha => "alpha",
            Channel::Roughness => "roughness",
            Channel::Metalness => "metalness",
            Channel::GeometricNormal => "geometric-normal",
            Channel::ShadingNormal => "shading-normal",
            Channel::Tangent => "tangent",
            Channel::Uv0 => "uv0",
            Channel::Uv1 => "uv1",
            Channel::Occlusion => "occlusion",
            Channel::F0 => "f0",
            Channel::Mip => "mip",
            Channel::Variant => "variant",
            Channel::Emission => "emission",
            Channel::Diffuse => "diffuse",
            Channel::Specular => "specular",
            Channel::Clearcoat => "clearcoat",
            Channel::Sheen => "sheen",
            Channel::Transmission => "transmission",
            Channel::Punctual => "punctual",
        }
    }

    /// Its name in the window.
    pub fn label(self) -> &'static str {
        match self {
            Channel::BaseColor => "base colour",
            Channel::GeometricNormal => "geometric normal",
            Channel::ShadingNormal => "shading normal",
            Channel::Uv0 => "UV 0",
            Channel::Uv1 => "UV 1",
            Channel::F0 => "reflectance (F0)",
            Channel::Mip => "mip in use",
            Channel::Variant => "variant in use",
            Channel::Diffuse => "diffuse light",
            Channel::Specular => "specular light",
            Channel::Clearcoat => "clearcoat light",
            Channel::Sheen => "sheen light",
            Channel::Transmission => "transmitted light",
            Channel::Punctual => "light of lamps and sun",
            other => other.name(),
        }
    }

    /// How its values are shown.
    pub fn encoding(self) -> Encoding {
        match self {
            Channel::BaseColor | Channel::F0 | Channel::Variant => Encoding::Color,
            Channel::Alpha | Channel::Roughness | Channel::Metalness | Channel::Occlusion => Encoding::Data,
            Channel::GeometricNormal | Channel::ShadingNormal | Channel::Tangent => Encoding::Direction,
            Channel::Uv0 | Channel::Uv1 => Encoding::Uv,
            Channel::Mip => Encoding::Level,
            _ => Encoding::Radiance,
        }
    }

    /// Whether its values are radiance, which exposure and tone mapping turn into a picture.
    pub fn is_radiance(self) -> bool {
        self.encoding() == Encoding::Radiance
    }

    /// The effects of which a variant needs one to have it; none where every variant has.
    pub(crate) fn needs(self) -> &'static [Effect] {
        match self {
            Channel::Occlusion => &[Effect::Occlusion],
            Channel::Tangent => &[Effect::NormalMap, Effect::Clearcoat, Effect::Anisotropy],
            Channel::Emission => &[Effect::Emission],
            Channel::Clearcoat => &[Effect::Clearcoat],
            Channel::Sheen => &[Effect::Sheen],
            Channel::Transmission => &[Effect::Transmission, Effect::DiffuseTransmission],
            Channel::Punctual => &[Effect::PunctualLights, Effect::Sun],
            _ => &[],
        }
    }

    /// What shaders know it by.
    pub(crate) fn code(self) -> u32 {
        self as u32 + 1
    }

    /// How many of its components carry something.
    pub fn component_count(self) -> usize {
        match self.encoding() {
            Encoding::Data | Encoding::Level => 1,
            Encoding::Uv => 2,
            _ => 3,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Channel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Channel::ALL.into_iter().find(|channel| channel.name() == text);
        let known = || Channel::ALL.map(Channel::name).join(", ");
        found.ok_or_else(|| format!("there is no channel `{text}`; there are: {}", known()))
    }
}

/// Colours to tell variants apart, linear: equal steps of hue, in an order that keeps neighbours apart.
pub(crate) fn variant_color(index: usize) -> [f32; 3] {
    // The golden ratio's turn never comes near a hue that it had before.
    let hue = (index as f32 * 0.618_034).fract() * 6.0;
    let shade = if (index / 8).is_multiple_of(2) { 0.8 } else { 0.35 };
    let channel = |shift: f32| {
        let distance = ((hue + shift).rem_euclid(6.0) - 3.0).abs();
        0.03 + (shade - 0.03) * (distance - 1.0).clamp(0.0, 1.0)
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// The colour of a level, sRGB-encoded in [0, 1]; those between are mixed. `inspect_display.wgsl` has the same.
pub(crate) const LEVEL_COLORS: [[f32; 3]; 8] = [
    [0.85, 0.25, 0.25],
    [0.90, 0.55, 0.20],
    [0.90, 0.85, 0.30],
    [0.45, 0.80, 0.35],
    [0.25, 0.75, 0.75],
    [0.30, 0.50, 0.90],
    [0.50, 0.35, 0.85],
    [0.80, 0.40, 0.75],
];
