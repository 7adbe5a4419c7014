//! File sets of a baked environment, in the conventions of the engines that read them.
//!
//! Start at [`Preset::wish`], which says what to bake for an engine, then hand the maps to [`package`]: values in, files
//! as bytes out. Beside an engine's files stands `conventions.json`: orientation, handedness, π, roughness law, units,
//! scale, formats and what encoding cost.
//!
//! Every preset keeps world directions: what Kiln shows towards −Z, the engine shows towards −Z of its right-handed
//! world with +Y up, whatever turns its own tools give a panorama. Maps arrive as unrounded `f32`, so nothing is rounded
//! twice.
//!
//! Conventions of the maps that come in: those of `kiln-bake`. Not here: baking, files and folders.

mod bevy;
mod conventions;
mod cube_file;
mod environment;
mod filament;
mod khronos;
mod preset;
mod raw;
pub mod sh;
#[cfg(test)]
mod tests;
mod three;

pub use environment::{BakedEnvironment, DfgTable};
pub use kiln_sphere::{Cancel, Cancelled};
pub use preset::{FACE_SIZE_DEFAULT, Preset, UnknownPreset, Wish};

use kiln_bake::TexelFormat;
use thiserror::Error;

/// One file of a set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportFile {
    /// Name within the set's folder; no folders in it.
    pub path: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Why an environment cannot be written for an engine.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ExportError {
    /// A name that is no file name.
    #[error("`{0}` cannot begin file names: use letters, digits, `-`, `_` and `.`, not first")]
    Name(String),
    /// A map that the engine needs and that was not baked.
    #[error("{preset} needs the {map}, which was not baked: bake what `Preset::wish` asks for")]
    Missing {
        /// The preset's name.
        preset: &'static str,
        /// Which map.
        map: &'static str,
    },
    /// A level of another size than its place in the chain asks for, or with values that do not fill it.
    #[error("level {level} of the {map} has faces of {actual} texels where {expected} are needed")]
    Level {
        /// Which map.
        map: &'static str,
        /// Level, 0 the largest.
        level: usize,
        /// Texels along an edge that its place asks for.
        expected: usize,
        /// Texels along its edge; 0 where its values do not fill it.
        actual: usize,
    },
    /// A level baked for another roughness than the engine reads there.
    #[error("level {level} of the {map} has roughness {actual}, {preset} reads {expected} there ({law} law)")]
    Roughness {
        /// The preset's name.
        preset: &'static str,
        /// Which map.
        map: &'static str,
        /// Level, 0 the largest.
        level: usize,
        /// Roughness the engine's law gives.
        expected: f64,
        /// Roughness baked.
        actual: f64,
        /// The law's name.
        law: &'static str,
    },
    /// A texel format that the engine does not read.
    #[error("{preset} does not take {format}; it takes {}", formats_of(preset))]
    Format {
        /// The preset.
        preset: Preset,
        /// The format's name.
        format: &'static str,
    },
    /// A table whose entries do not fill its size.
    #[error("a BRDF table of size {size} needs {} entries, {actual} were given", size * size)]
    Table {
        /// Entries along a side.
        size: usize,
        /// Entries given.
        actual: usize,
    },
    /// Too few harmonics, or a number of them that is no square.
    #[error(
        "{needed} spherical-harmonic coefficients are needed (more make a square number), {actual} were given"
    )]
    Harmonics {
        /// Coefficients needed.
        needed: usize,
        /// Coefficients given.
        actual: usize,
    },
    /// The files are not wanted any more.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

fn formats_of(preset: &Preset) -> String {
    let names: Vec<&str> = preset.formats().iter().map(|&format| conventions::format_name(format)).collect();
    if names.is_empty() { "none, it reads .hdr and .exr".to_owned() } else { names.join(", ") }
}

/// The engine's files in its usual texel format, see [`package_as`].
///
/// # Errors
/// As [`package_as`].
pub fn package(
    preset: Preset,
    environment: &BakedEnvironment,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    package_as(preset, environment, None, cancel)
}

/// The engine's files, `conventions.json` last; cubes in `format`, or in the first of [`Preset::formats`]. Equal environments give equal bytes.
///
/// # Errors
/// [`ExportError`] where `environment` is not what [`Preset::wish`] asks for; [`ExportError::Cancelled`] within a row's
/// work or the compression of one level.
pub fn package_as(
    preset: Preset,
    environment: &BakedEnvironment,
    format: Option<TexelFormat>,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    environment.check(preset)?;
    if let Some(format) = format.filter(|format| !preset.formats().contains(format)) {
        return Err(ExportError::Format { preset, format: conventions::format_name(format) });
    }
    let usual = preset.formats().first().copied().unwrap_or(TexelFormat::Rgba32Float);
    let format = format.unwrap_or(usual);
    match preset {
        Preset::Bevy => bevy::package(environment, format, cancel),
        Preset::Three => three::package(environment, cancel),
        Preset::Filament => filament::package(environment, format, cancel),
        Preset::Khronos => khronos::package(environment, format, cancel),
        Preset::Raw => raw::package(environment, format, cancel),
    }
}
