//! Texel formats that can hold radiance, whatever number a container has for them.
//!
//! Source: Khronos Data Format Specification 1.3, chapters 10 (shared exponent, packed floats) and 20 (BPTC); sRGB as in
//! IEC 61966-2-1.

use crate::texel::bc6h::{self, BLOCK_BYTES, BLOCK_SIZE};
use crate::texel::{r11g11b10, rgb9e5};
use crate::{Cancel, Cancelled, colour::srgb_to_linear};
use half::f16;

/// How texels are stored, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TexelFormat {
    /// Binary16 channels.
    Half { channels: usize },
    /// Binary32 channels.
    Float { channels: usize },
    /// 8-bit channels, 0 to 1; `is_bgr`: blue stands first.
    Unorm8 { channels: usize, is_bgr: bool, is_srgb: bool },
    /// 11, 11 and 10 bits without sign, red in the lowest.
    B10G11R11,
    /// Nine bits a channel and a common exponent, red in the lowest.
    Rgb9E5,
    /// 4 × 4 blocks of 16 bytes.
    Bc6h { is_signed: bool },
}

impl TexelFormat {
    /// Whether texels come in blocks.
    pub(super) fn is_block(self) -> bool {
        matches!(self, TexelFormat::Bc6h { .. })
    }

    /// Bytes of a texel; of a block where they come in blocks.
    pub(super) fn texel_bytes(self) -> usize {
        match self {
            TexelFormat::Half { channels } => 2 * channels,
            TexelFormat::Float { channels } => 4 * channels,
            TexelFormat::Unorm8 { channels, .. } => channels,
            TexelFormat::B10G11R11 | TexelFormat::Rgb9E5 => 4,
            TexelFormat::Bc6h { .. } => BLOCK_BYTES,
        }
    }

    /// Bytes of one image whose rows are padded to a multiple of `row_alignment`; `None` where the product overflows.
    pub(super) fn image_bytes(self, width: usize, height: usize, row_alignment: usize) -> Option<usize> {
        let (columns, rows) = if self.is_block() {
            (width.div_ceil(BLOCK_SIZE), height.div_ceil(BLOCK_SIZE))
        } else {
            (width, height)
        };
        let row = columns.checked_mul(self.texel_bytes())?.checked_next_multiple_of(row_alignment)?;
        row.checked_mul(rows)
    }

    /// What to say about a file in this format.
    pub(super) fn note(self) -> Option<String> {
        match self {
            TexelFormat::Unorm8 { is_srgb, .. } => {
                let meaning = if is_srgb { "decoded as sRGB" } else { "taken as linear, as the format says" };
                Some(format!(
                    "8-bit channels hold values from 0 to 1, {meaning}: lights are clipped, so lighting from it \
                     will be too dark"
                ))
            }
            TexelFormat::Half { channels } | TexelFormat::Float { channels } if channels < 3 => {
                let missing = if channels == 1 { "green and blue are" } else { "blue is" };
                Some(format!("{missing} absent and read as 0"))
            }
            _ => None,
        }
    }

    /// Appends a row's texels.
    pub(super) fn decode_row(self, bytes: &[u8], rgb: &mut Vec<f32>) {
        let texels = bytes.chunks_exact(self.texel_bytes());
        match self {
            TexelFormat::Half { channels } => rgb.extend(texels.flat_map(|texel| {
                let value = |c: usize| f16::from_le_bytes([texel[2 * c], texel[2 * c + 1]]).to_f32();
                first_three(channels, value)
            })),
            TexelFormat::Float { channels } => rgb.extend(texels.flat_map(|texel| {
                let value = |c: usize| {
                    f32::from_le_bytes([texel[4 * c], texel[4 * c + 1], texel[4 * c + 2], texel[4 * c + 3]])
                };
                first_three(channels, value)
            })),
            TexelFormat::Unorm8 { channels, is_bgr, is_srgb } => {
                let table: [f32; 256] = std::array::from_fn(|value| {
                    let value = value as f64 / 255.0;
                    (if is_srgb { srgb_to_linear(value) } else { value }) as f32
                });
                rgb.extend(texels.flat_map(|texel| {
                    let value = |c: usize| table[usize::from(texel[c])];
                    let [r, g, b] = first_three(channels, value);
                    if is_bgr { [b, g, r] } else { [r, g, b] }
                }));
            }
            TexelFormat::B10G11R11 => {
                rgb.extend(bytes.as_chunks().0.iter().flat_map(|&texel| r11g11b10::decode(texel)));
            }
            TexelFormat::Rgb9E5 => {
                rgb.extend(bytes.as_chunks().0.iter().flat_map(|&texel| rgb9e5::decode(texel)));
            }
            TexelFormat::Bc6h { .. } => {}
        }
    }

    /// Appends an image of blocks; those over the edge are cropped.
    pub(super) fn decode_blocks(
        self,
        bytes: &[u8],
        width: usize,
        height: usize,
        rgb: &mut Vec<f32>,
        cancel: Cancel,
    ) -> Result<(), Cancelled> {
        let is_signed = self == TexelFormat::Bc6h { is_signed: true };
        let start = rgb.len();
        rgb.resize(start + width * height * 3, 0.0);
        let blocks_per_row = width.div_ceil(BLOCK_SIZE);
        for (row, blocks) in bytes.chunks_exact(blocks_per_row * BLOCK_BYTES).enumerate() {
            cancel.check()?;
            for (column, &block) in blocks.as_chunks::<BLOCK_BYTES>().0.iter().enumerate() {
                let texels = bc6h::decode_block(block, is_signed);
                let (x, y) = (column * BLOCK_SIZE, row * BLOCK_SIZE);
                let length = 3 * (width - x).min(BLOCK_SIZE);
                for (line, values) in texels.chunks_exact(BLOCK_SIZE).take(height - y).enumerate() {
                    let to = start + ((y + line) * width + x) * 3;
                    rgb[to..to + length].copy_from_slice(&values.as_flattened()[..length]);
                }
            }
        }
        Ok(())
    }
}

fn first_three(channels: usize, value: impl Fn(usize) -> f32) -> [f32; 3] {
    [0, 1, 2].map(|channel| if channel < channels { value(channel) } else { 0.0 })
}
