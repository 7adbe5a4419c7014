//! KTX 2.0 containers of uncompressed float textures: 2D or cube, with mip levels.
//!
//! Source: Khronos "KTX File Format Specification, Version 2.0" (sections 3 to 5) and "Khronos Data
//! Format Specification 1.3", chapter 5 (basic data format descriptor).

mod read;
mod write;

pub(crate) use read::{Header, key_values, level_bytes, read_header};
pub use read::{KtxError, OwnedTexture, read};
pub use write::write;

use half::f16;

/// First twelve bytes of each file.
pub const IDENTIFIER: [u8; 12] = [0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb, b'\r', b'\n', 0x1a, b'\n'];

/// Texel formats, under their Vulkan names.
#[expect(non_camel_case_types, reason = "the names people look up in the Vulkan specification")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Two binary16 channels.
    R16G16_SFLOAT,
    /// Three binary16 channels; read, but few GPUs sample it.
    R16G16B16_SFLOAT,
    /// Four binary16 channels.
    R16G16B16A16_SFLOAT,
    /// Two binary32 channels.
    R32G32_SFLOAT,
    /// Three binary32 channels; read, but few GPUs sample it.
    R32G32B32_SFLOAT,
    /// Four binary32 channels.
    R32G32B32A32_SFLOAT,
}

/// A texture to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture<'a> {
    /// Texel format.
    pub format: Format,
    /// Columns of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// 1, or 6 for a cube (then `width = height`).
    pub faces: usize,
    /// Level 0 first; cube faces concatenated in face order, rows from the top.
    pub levels: Vec<&'a [u8]>,
    /// Extra key/value pairs; values get a NUL at the end. KTXorientation (`rd`) and KTXwriter are
    /// added where they are missing.
    pub key_values: Vec<(String, String)>,
}

impl Format {
    const ALL: [Format; 6] = [
        Format::R16G16_SFLOAT,
        Format::R16G16B16_SFLOAT,
        Format::R16G16B16A16_SFLOAT,
        Format::R32G32_SFLOAT,
        Format::R32G32B32_SFLOAT,
        Format::R32G32B32A32_SFLOAT,
    ];

    /// `VkFormat`'s number.
    pub fn vk_format(self) -> u32 {
        match self {
            Format::R16G16_SFLOAT => 83,
            Format::R16G16B16_SFLOAT => 90,
            Format::R16G16B16A16_SFLOAT => 97,
            Format::R32G32_SFLOAT => 103,
            Format::R32G32B32_SFLOAT => 106,
            Format::R32G32B32A32_SFLOAT => 109,
        }
    }

    /// Inverse of [`Format::vk_format`].
    pub fn from_vk_format(number: u32) -> Option<Format> {
        Format::ALL.into_iter().find(|format| format.vk_format() == number)
    }

    /// Channels of a texel.
    pub fn channels(self) -> usize {
        match self {
            Format::R16G16_SFLOAT | Format::R32G32_SFLOAT => 2,
            Format::R16G16B16_SFLOAT | Format::R32G32B32_SFLOAT => 3,
            Format::R16G16B16A16_SFLOAT | Format::R32G32B32A32_SFLOAT => 4,
        }
    }

    /// Bytes of a channel, 2 or 4.
    pub fn channel_bytes(self) -> usize {
        match self {
            Format::R16G16_SFLOAT | Format::R16G16B16_SFLOAT | Format::R16G16B16A16_SFLOAT => 2,
            Format::R32G32_SFLOAT | Format::R32G32B32_SFLOAT | Format::R32G32B32A32_SFLOAT => 4,
        }
    }

    /// Bytes of a texel.
    pub fn texel_bytes(self) -> usize {
        self.channels() * self.channel_bytes()
    }

    /// Texels of this format from interleaved values with `source_channels` each.
    ///
    /// Surplus channels are dropped, missing colour is 0, missing alpha 1. Binary16 is rounded to
    /// nearest even, values above 65504 saturate only from 65520 on, and then to ∞: scale before.
    pub fn encode(self, values: &[f32], source_channels: usize) -> Vec<u8> {
        let texels = values.len() / source_channels.max(1);
        let mut out = Vec::with_capacity(texels * self.texel_bytes());
        for texel in values.chunks_exact(source_channels.max(1)) {
            for channel in 0..self.channels() {
                let missing = if channel == 3 { 1.0 } else { 0.0 };
                let value = texel.get(channel).copied().unwrap_or(missing);
                match self.channel_bytes() {
                    2 => out.extend_from_slice(&f16::from_f32(value).to_le_bytes()),
                    _ => out.extend_from_slice(&value.to_le_bytes()),
                }
            }
        }
        out
    }

    /// All channels of a level's bytes as numbers, [`Format::channels`] per texel.
    pub fn decode(self, bytes: &[u8]) -> Vec<f32> {
        match self.channel_bytes() {
            2 => bytes.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b).to_f32()).collect(),
            _ => bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect(),
        }
    }

    /// Where a level's data starts: a multiple of the texel size and of 4 (KTX 2.0, 3.9.7).
    fn level_alignment(self) -> usize {
        let texel = self.texel_bytes();
        if texel.is_multiple_of(4) { texel } else { texel * 2 }
    }

    /// Bytes of level `level` of a texture; `None` where the product overflows.
    pub fn level_bytes(self, width: usize, height: usize, faces: usize, level: usize) -> Option<usize> {
        let side = |length: usize| length.checked_shr(level as u32).unwrap_or(0).max(1);
        side(width).checked_mul(side(height))?.checked_mul(faces)?.checked_mul(self.texel_bytes())
    }
}
