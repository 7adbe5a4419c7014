//! Texel bytes and what encoding cost.

use half::f16;
use kiln_image::Cube;
use kiln_image::ktx2::Format;
use kiln_image::texel::{bc6h, r11g11b10, rgb9e5};
use kiln_sphere::{Bulk, Cancel, Cancelled};
use rayon::prelude::*;

/// How a texel is stored, little-endian; A = 1 where there is an alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelFormat {
    /// Binary16: 8 bytes a texel, 2e-4 of rounding, nothing above 65504.
    Rgba16Float,
    /// Binary32: 16 bytes a texel.
    Rgba32Float,
    /// Shared exponent: 4 bytes a texel, 1e-3 of the brightest channel, 0 to 65408.
    Rgb9e5Ufloat,
    /// Small floats: 4 bytes a texel, 4e-3 (blue 8e-3) of rounding, 0 to 65024 (blue 64512).
    R11g11b10Ufloat,
    /// Blocks of 4×4: 1 byte a texel, about 5e-3 on smooth maps, 0 to 65504.
    Bc6hUfloat,
}

impl TexelFormat {
    /// All of them.
    pub const ALL: [TexelFormat; 5] = [
        TexelFormat::Rgba16Float,
        TexelFormat::Rgba32Float,
        TexelFormat::Rgb9e5Ufloat,
        TexelFormat::R11g11b10Ufloat,
        TexelFormat::Bc6hUfloat,
    ];

    /// The container's name for it.
    pub fn ktx2(self) -> Format {
        match self {
            TexelFormat::Rgba16Float => Format::R16G16B16A16_SFLOAT,
            TexelFormat::Rgba32Float => Format::R32G32B32A32_SFLOAT,
            TexelFormat::Rgb9e5Ufloat => Format::E5B9G9R9_UFLOAT_PACK32,
            TexelFormat::R11g11b10Ufloat => Format::B10G11R11_UFLOAT_PACK32,
            TexelFormat::Bc6hUfloat => Format::BC6H_UFLOAT_BLOCK,
        }
    }

    /// Least and greatest value that a channel holds.
    pub fn range(self, channel: usize) -> [f64; 2] {
        let [low, high] = match self {
            TexelFormat::Rgba16Float => [-HALF_MAX, HALF_MAX],
            TexelFormat::Rgba32Float => [f32::MIN, f32::MAX],
            TexelFormat::Rgb9e5Ufloat => [0.0, rgb9e5::MAX],
            TexelFormat::R11g11b10Ufloat => [0.0, r11g11b10::MAX[channel.min(2)]],
            TexelFormat::Bc6hUfloat => [0.0, bc6h::MAX],
        };
        [f64::from(low), f64::from(high)]
    }
}

/// A level as bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedLevel {
    /// Faces in KTX2 order, rows from the top left.
    pub bytes: Vec<u8>,
    /// RMS of what encoding changed, over the texels and channels, relative to their RMS; 0 for a black level.
    pub rounding_rms: f64,
    /// Largest change of a channel in relation to |that channel's value| + mean of |value| over level and channels;
    /// 0 for a black level.
    pub rounding_max: f64,
    /// Sum of what the format cannot hold (negative values, values above its largest) in relation to the sum of
    /// |value|, over texels and channels; 0 for a black level. Part of `rounding_rms` and `rounding_max` as well.
    /// Infinite where a value is infinite.
    pub clamped_flux: f64,
}

const HALF_MAX: f32 = 65504.0;
/// Largest value written as binary16, a little below its greatest (65504) so that a sum of rounding errors in a
/// filter does not overflow. R11G11B10 and RGB9E5 reach almost as far.
const HALF_SAFE_MAX: f32 = 65000.0;

/// Smallest s ≥ 0 such that `max_value` / 2^s fits binary16 with a margin (65000); 0 for NaN, 128 steps at most.
///
/// Blue of R11G11B10 ends at 64512, 0.75 % below: what is cut off there is in [`EncodedLevel::clamped_flux`].
pub fn scale_log2(max_value: f32) -> i32 {
    let (mut scaled, mut s) = (max_value, 0);
    while scaled > HALF_SAFE_MAX && s < 128 {
        scaled *= 0.5;
        s += 1;
    }
    s
}

/// The values that an encoded level's bytes stand for; `None` if they are not that many.
pub fn decode_level(bytes: &[u8], face_size: usize, format: TexelFormat, scale_log2: i32) -> Option<Cube> {
    let format = format.ktx2();
    let values = format.decode_image(face_size, face_size, bytes)?;
    let scale = libm::exp2(f64::from(scale_log2)) as f32;
    let texels = values.chunks_exact(format.channels());
    let rgb = texels.flat_map(|texel| [texel[0], texel[1], texel[2]].map(|value| value * scale));
    Cube::new(face_size, rgb.collect()).ok()
}

/// Encodes a level's values divided by 2^`scale_log2`.
///
/// Values outside the format's range saturate, never Inf; `clamped_flux` counts that, and the two roundings too.
/// Infinite input counts as out of range. NaN stays NaN in the float formats and becomes 0 in the others; it is left
/// out of all three numbers.
///
/// # Errors
/// [`Cancelled`] within a row's work, four rows' for BC6H.
pub fn encode_level(
    cube: &Cube,
    format: TexelFormat,
    scale_log2: i32,
    cancel: Cancel,
) -> Result<EncodedLevel, Cancelled> {
    let scale = libm::exp2(-f64::from(scale_log2));
    if format == TexelFormat::Bc6hUfloat {
        return encode_blocks(cube, scale, cancel);
    }
    let mut bytes = Bulk::new(Vec::with_capacity(cube.rgb.len() / 3 * format.ktx2().block_bytes()));
    let mut tally = Tally::new(format, mean(cube, scale, cancel)?);
    for line in cube.rgb.chunks(cube.face_size.max(1) * 3) {
        cancel.check()?;
        let bytes: &mut Vec<u8> = &mut bytes;
        for texel in line.chunks_exact(3) {
            let wanted = [texel[0], texel[1], texel[2]].map(|value| f64::from(value) * scale);
            tally.add(wanted, push(bytes, format, wanted));
        }
    }
    Ok(tally.finish(bytes.into_inner()))
}

/// Mean of |value|, what is not finite left out.
fn mean(cube: &Cube, scale: f64, cancel: Cancel) -> Result<f64, Cancelled> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for line in cube.rgb.chunks(cube.face_size.max(1) * 3) {
        cancel.check()?;
        for value in
            line.iter().map(|&value| f64::from(value.abs()) * scale).filter(|value| value.is_finite())
        {
            sum += value;
            count += 1;
        }
    }
    Ok(sum / count.max(1) as f64)
}

/// Counts changes while a level is encoded.
struct Tally {
    format: TexelFormat,
    mean: f64,
    change2: f64,
    size2: f64,
    size: f64,
    clamped: f64,
    largest: f64,
}

impl Tally {
    fn new(format: TexelFormat, mean: f64) -> Tally {
        Tally { format, mean, change2: 0.0, size2: 0.0, size: 0.0, clamped: 0.0, largest: 0.0 }
    }

    fn add(&mut self, wanted: [f64; 3], stored: [f64; 3]) {
        for (channel, (wanted, stored)) in wanted.into_iter().zip(stored).enumerate() {
            if wanted.is_nan() {
                continue;
            }
            let [low, high] = self.format.range(channel);
            self.clamped += (low - wanted).max(0.0) + (wanted - high).max(0.0);
            // An infinite value has no size to compare with: its change is counted, its size as the largest value's.
            let size = wanted.abs().min(f64::from(f32::MAX));
            let change = (wanted - stored).abs().min(f64::from(f32::MAX));
            self.change2 += change * change;
            self.size2 += size * size;
            self.size += size;
            if change > 0.0 {
                self.largest = self.largest.max(change / (size + self.mean));
            }
        }
    }

    fn finish(self, bytes: Vec<u8>) -> EncodedLevel {
        let relative = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        EncodedLevel {
            bytes,
            rounding_rms: relative(self.change2, self.size2).sqrt(),
            rounding_max: self.largest,
            clamped_flux: relative(self.clamped, self.size),
        }
    }
}

/// Appends a texel; returns what a reader will see.
fn push(bytes: &mut Vec<u8>, format: TexelFormat, value: [f64; 3]) -> [f64; 3] {
    match format {
        TexelFormat::Rgba16Float => {
            let stored = value.map(|value| {
                let [low, high] = format.range(0);
                f16::from_f64(value.clamp(low, high))
            });
            stored.into_iter().chain([f16::ONE]).for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
            stored.map(f16::to_f64)
        }
        TexelFormat::Rgba32Float => {
            let stored = value.map(|value| value as f32);
            stored.into_iter().chain([1.0]).for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
            stored.map(f64::from)
        }
        TexelFormat::Rgb9e5Ufloat => push_word(bytes, rgb9e5::encode(value), rgb9e5::decode),
        TexelFormat::R11g11b10Ufloat => push_word(bytes, r11g11b10::encode(value), r11g11b10::decode),
        TexelFormat::Bc6hUfloat => unreachable!("encoded by blocks"),
    }
}

fn push_word(bytes: &mut Vec<u8>, word: [u8; 4], decode: impl Fn([u8; 4]) -> [f32; 3]) -> [f64; 3] {
    bytes.extend_from_slice(&word);
    decode(word).map(f64::from)
}

/// BC6H: rows of blocks are independent, so they are encoded at once and counted in order.
fn encode_blocks(cube: &Cube, scale: f64, cancel: Cancel) -> Result<EncodedLevel, Cancelled> {
    let size = cube.face_size;
    let mean = mean(cube, scale, cancel)?;
    let scaled: Vec<f32> = cube.rgb.iter().map(|&value| (f64::from(value) * scale) as f32).collect();
    let scaled = Bulk::new(scaled);
    let face_values = (size * size * 3).max(1);
    let rows: Vec<&[f32]> =
        scaled.chunks(face_values).flat_map(|face| face.chunks(size * 3 * bc6h::BLOCK_SIZE)).collect();
    let encoded = rows.par_iter().map(|rows| {
        cancel.check()?;
        Ok(bc6h::encode_rows(size, rows))
    });
    let encoded = encoded.collect::<Result<Vec<_>, Cancelled>>()?;
    let mut tally = Tally::new(TexelFormat::Bc6hUfloat, mean);
    for (rows, blocks) in rows.iter().zip(&encoded) {
        cancel.check()?;
        let height = rows.len() / (size * 3);
        let stored = bc6h::decode(size, height, blocks).expect("our own blocks");
        for (wanted, stored) in rows.chunks_exact(3).zip(stored.chunks_exact(3)) {
            let texel = |values: &[f32]| [values[0], values[1], values[2]].map(f64::from);
            tally.add(texel(wanted), texel(stored));
        }
    }
    Ok(tally.finish(encoded.concat()))
}
