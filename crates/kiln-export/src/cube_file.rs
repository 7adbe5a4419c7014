//! Chains of cubes as container files, with what to say about them.

use crate::conventions::{CubeFacts, LevelError};
use crate::{BakedEnvironment, Cancel, Cancelled, ExportFile};
use kiln_bake::{EncodedLevel, TexelFormat, encode_level};
use kiln_image::cube_layout::{Mirror, mirror};
use kiln_image::{Cube, ktx1, ktx2};

/// Zstandard level of KTX2 files: higher ones take ten times as long for 2 % on such maps.
const ZSTD_LEVEL: i32 = 9;

/// How an engine wants cubes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CubeStyle {
    pub(crate) format: TexelFormat,
    /// The engine mirrors directions before it looks them up; so is the cube.
    pub(crate) mirror: Option<Mirror>,
    pub(crate) container: Container,
    /// Values are divided by two to this power.
    pub(crate) scale_log2: i32,
}

/// File format of a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Container {
    Ktx2,
    Ktx2Zstd,
    /// KTX 1 with the packed or half floats that Filament reads.
    Ktx1Filament,
}

/// Smallest s ≥ 0 such that all of an environment's values over 2^s fit `format`, a hundredth below its end.
pub(crate) fn scale_for(environment: &BakedEnvironment, format: TexelFormat) -> i32 {
    if format == TexelFormat::Rgba32Float {
        return 0;
    }
    let limit = (0..3).map(|channel| format.range(channel)[1]).fold(f64::INFINITY, f64::min) * 0.99;
    let (mut value, mut s) = (f64::from(environment.max_value()), 0);
    while value > limit {
        value *= 0.5;
        s += 1;
    }
    s
}

/// A chain as a file and its facts. `key_values` go into the container.
pub(crate) fn cube_file<'a>(
    path: String,
    levels: impl Iterator<Item = &'a Cube>,
    style: CubeStyle,
    key_values: Vec<(String, String)>,
    cancel: Cancel,
) -> Result<(ExportFile, CubeFacts), Cancelled> {
    let mut encoded: Vec<EncodedLevel> = Vec::new();
    let mut face_size = 0;
    for level in levels {
        cancel.check()?;
        face_size = face_size.max(level.face_size);
        let turned = style.mirror.map(|which| mirror(level, which));
        encoded.push(encode_level(turned.as_ref().unwrap_or(level), style.format, style.scale_log2, cancel)?);
    }
    let bytes = {
        let levels: Vec<&[u8]> = encoded.iter().map(|level| level.bytes.as_slice()).collect();
        match style.container {
            Container::Ktx1Filament => {
                let format = match style.format {
                    TexelFormat::R11g11b10Ufloat => ktx1::Format::R11fG11fB10fFilament,
                    _ => ktx1::Format::Rgba16f,
                };
                ktx1::write_cube(&ktx1::Cube { format, face_size, levels, key_values })
            }
            Container::Ktx2 | Container::Ktx2Zstd => {
                let format = style.format.ktx2();
                let (width, height) = (face_size, face_size);
                let texture = ktx2::Texture { format, width, height, faces: 6, levels, key_values };
                match style.container {
                    Container::Ktx2Zstd => ktx2::write_zstd(&texture, ZSTD_LEVEL, cancel)?,
                    _ => ktx2::write(&texture),
                }
            }
        }
    };
    let facts = CubeFacts {
        face_size,
        format: style.format,
        container: style.container,
        mirror: style.mirror,
        errors: encoded
            .iter()
            .map(|level| LevelError {
                rounding_rms: level.rounding_rms,
                rounding_max: level.rounding_max,
                clamped_flux: level.clamped_flux,
            })
            .collect(),
    };
    Ok((ExportFile { path, bytes }, facts))
}
