//! Texel bytes.

use half::f16;
use kiln_image::Cube;
use kiln_sphere::{Bulk, Cancel, Cancelled};

/// How a texel is stored: four channels, little-endian, A = 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// Binary16: 8 bytes a texel, 2e-4 of rounding, nothing above 65504.
    Rgba16Float,
    /// Binary32: 16 bytes a texel.
    Rgba32Float,
}

/// A level as bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedLevel {
    /// Faces in KTX2 order, rows from the top left.
    pub bytes: Vec<u8>,
    /// RMS of what encoding changed, over the texels, relative to their RMS; 0 for a black level.
    pub rounding_rms: f64,
}

/// Largest value written as binary16, a little below its greatest (65504) so that a sum of rounding errors in a
/// filter does not overflow.
const HALF_SAFE_MAX: f32 = 65000.0;

/// Smallest s ≥ 0 such that `max_value` / 2^s fits binary16 with a margin (65000); 0 for NaN, 128 steps at most.
pub fn scale_log2(max_value: f32) -> i32 {
    let (mut scaled, mut s) = (max_value, 0);
    while scaled > HALF_SAFE_MAX && s < 128 {
        scaled *= 0.5;
        s += 1;
    }
    s
}

/// Encodes a level's values divided by 2^`scale_log2`.
///
/// Values outside binary16's range saturate at ±65504, never Inf; `rounding_rms` counts that. Infinite input counts
/// as out of range, NaN stays NaN.
///
/// # Errors
/// [`Cancelled`] within a row's work.
pub fn encode_level(
    cube: &Cube,
    format: TexelFormat,
    scale_log2: i32,
    cancel: Cancel,
) -> Result<EncodedLevel, Cancelled> {
    let scale = libm::exp2(-f64::from(scale_log2));
    let texel_bytes = if format == TexelFormat::Rgba16Float { 8 } else { 16 };
    let mut bytes = Bulk::new(Vec::with_capacity(cube.rgb.len() / 3 * texel_bytes));
    let (mut change2, mut size2) = (0.0, 0.0);
    for line in cube.rgb.chunks(cube.face_size.max(1) * 3) {
        cancel.check()?;
        let bytes: &mut Vec<u8> = &mut bytes;
        for texel in line.chunks_exact(3) {
            for &value in texel {
                let wanted = f64::from(value) * scale;
                let stored = push(bytes, format, wanted);
                change2 += (stored - wanted) * (stored - wanted);
                size2 += wanted * wanted;
            }
            push(bytes, format, 1.0);
        }
    }
    let rounding_rms = if size2 > 0.0 { (change2 / size2).sqrt() } else { 0.0 };
    Ok(EncodedLevel { bytes: bytes.into_inner(), rounding_rms })
}

/// Appends a channel; returns what a reader will see.
fn push(bytes: &mut Vec<u8>, format: TexelFormat, value: f64) -> f64 {
    match format {
        TexelFormat::Rgba16Float => {
            let stored = f16::from_f64(value.clamp(-65504.0, 65504.0));
            bytes.extend_from_slice(&stored.to_le_bytes());
            stored.to_f64()
        }
        TexelFormat::Rgba32Float => {
            let stored = value as f32;
            bytes.extend_from_slice(&stored.to_le_bytes());
            f64::from(stored)
        }
    }
}
