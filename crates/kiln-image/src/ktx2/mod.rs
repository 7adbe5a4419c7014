//! KTX 2.0 containers of textures of radiance: 2D or cube, with mip levels.
//!
//! Source: Khronos "KTX File Format Specification, Version 2.0" (sections 3 to 5) and "Khronos Data
//! Format Specification 1.3", chapter 5 (basic data format descriptor).

mod descriptor;
mod read;
mod write;

pub(crate) use read::{Header, key_values, level_bytes, read_header};
pub use read::{KtxError, OwnedTexture, read};
pub use write::{write, write_zstd};

use crate::texel::{bc6h, r11g11b10, rgb9e5};
use half::f16;

/// First twelve bytes of each file.
pub const IDENTIFIER: [u8; 12] = [0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb, b'\r', b'\n', 0x1a, b'\n'];

/// Texel formats, under their Vulkan names.
#[expect(non_camel_case_types, reason = "the names people look up in the Vulkan specification")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Four 8-bit channels, linear.
    R8G8B8A8_UNORM,
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
    /// Three unsigned floats in 32 bits, see [`r11g11b10`].
    B10G11R11_UFLOAT_PACK32,
    /// Three mantissas with a shared exponent in 32 bits, see [`rgb9e5`].
    E5B9G9R9_UFLOAT_PACK32,
    /// Blocks of 4×4 unsigned half floats in 16 bytes, see [`bc6h`].
    BC6H_UFLOAT_BLOCK,
}

/// How a format lays out what it stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    /// Channels of equal size, one after the other.
    Channels { count: usize, bytes: usize },
    /// Three channels in one 32-bit word.
    Word,
    /// Blocks of 4×4 texels in 16 bytes.
    Block,
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
    /// All of them.
    pub const ALL: [Format; 10] = [
        Format::R8G8B8A8_UNORM,
        Format::R16G16_SFLOAT,
        Format::R16G16B16_SFLOAT,
        Format::R16G16B16A16_SFLOAT,
        Format::R32G32_SFLOAT,
        Format::R32G32B32_SFLOAT,
        Format::R32G32B32A32_SFLOAT,
        Format::B10G11R11_UFLOAT_PACK32,
        Format::E5B9G9R9_UFLOAT_PACK32,
        Format::BC6H_UFLOAT_BLOCK,
    ];

    /// `VkFormat`'s number.
    pub fn vk_format(self) -> u32 {
        match self {
            Format::R8G8B8A8_UNORM => 37,
            Format::R16G16_SFLOAT => 83,
            Format::R16G16B16_SFLOAT => 90,
            Format::R16G16B16A16_SFLOAT => 97,
            Format::R32G32_SFLOAT => 103,
            Format::R32G32B32_SFLOAT => 106,
            Format::R32G32B32A32_SFLOAT => 109,
            Format::B10G11R11_UFLOAT_PACK32 => 122,
            Format::E5B9G9R9_UFLOAT_PACK32 => 123,
            Format::BC6H_UFLOAT_BLOCK => 143,
        }
    }

    /// Inverse of [`Format::vk_format`].
    pub fn from_vk_format(number: u32) -> Option<Format> {
        Format::ALL.into_iter().find(|format| format.vk_format() == number)
    }

    fn packing(self) -> Packing {
        let (count, bytes) = match self {
            Format::R8G8B8A8_UNORM => (4, 1),
            Format::R16G16_SFLOAT => (2, 2),
            Format::R16G16B16_SFLOAT => (3, 2),
            Format::R16G16B16A16_SFLOAT => (4, 2),
            Format::R32G32_SFLOAT => (2, 4),
            Format::R32G32B32_SFLOAT => (3, 4),
            Format::R32G32B32A32_SFLOAT => (4, 4),
            Format::B10G11R11_UFLOAT_PACK32 | Format::E5B9G9R9_UFLOAT_PACK32 => return Packing::Word,
            Format::BC6H_UFLOAT_BLOCK => return Packing::Block,
        };
        Packing::Channels { count, bytes }
    }

    /// Channels of a texel.
    pub fn channels(self) -> usize {
        match self.packing() {
            Packing::Channels { count, .. } => count,
            Packing::Word | Packing::Block => 3,
        }
    }

    /// KTX's `typeSize`: bytes of what a machine of the other byte order would swap. A channel's size, 4 for packed
    /// words, 1 for blocks.
    pub fn type_size(self) -> usize {
        match self.packing() {
            Packing::Channels { bytes, .. } => bytes,
            Packing::Word => 4,
            Packing::Block => 1,
        }
    }

    /// Texels along the edge of a block: 4 for block formats, else 1.
    pub fn block_size(self) -> usize {
        if self.packing() == Packing::Block { bc6h::BLOCK_SIZE } else { 1 }
    }

    /// Bytes of a block, which is a texel unless [`Format::block_size`] is 4.
    pub fn block_bytes(self) -> usize {
        match self.packing() {
            Packing::Channels { count, bytes } => count * bytes,
            Packing::Word => 4,
            Packing::Block => bc6h::BLOCK_BYTES,
        }
    }

    /// Texels of this format from interleaved values with `source_channels` each.
    ///
    /// Surplus channels are dropped, missing colour is 0, missing alpha 1. Binary16 is rounded to nearest even, values
    /// above 65504 saturate only from 65520 on, and then to ∞: scale before. 8-bit values are clamped to 0 … 1. What
    /// packed words hold is said in [`crate::texel`].
    ///
    /// # Panics
    /// For a block format: use [`bc6h::encode`].
    pub fn encode(self, values: &[f32], source_channels: usize) -> Vec<u8> {
        let source_channels = source_channels.max(1);
        let mut out = Vec::with_capacity(values.len() / source_channels * self.block_bytes());
        for texel in values.chunks_exact(source_channels) {
            let channel = |index: usize| {
                let missing = if index == 3 { 1.0 } else { 0.0 };
                texel.get(index).copied().unwrap_or(missing)
            };
            let rgb = || [channel(0), channel(1), channel(2)].map(f64::from);
            match (self, self.packing()) {
                (Format::E5B9G9R9_UFLOAT_PACK32, _) => out.extend_from_slice(&rgb9e5::encode(rgb())),
                (Format::B10G11R11_UFLOAT_PACK32, _) => out.extend_from_slice(&r11g11b10::encode(rgb())),
                (_, Packing::Channels { count, bytes: 1 }) => {
                    out.extend((0..count).map(|index| (channel(index).clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
                }
                (_, Packing::Channels { count, bytes: 2 }) => {
                    out.extend((0..count).flat_map(|index| f16::from_f32(channel(index)).to_le_bytes()));
                }
                (_, Packing::Channels { count, .. }) => {
                    out.extend((0..count).flat_map(|index| channel(index).to_le_bytes()));
                }
                (_, Packing::Word | Packing::Block) => panic!("{self:?} is no format of single texels"),
            }
        }
        out
    }

    /// All channels of a level's bytes as numbers, [`Format::channels`] per texel, all faces of `width` × `height`
    /// one after the other; `None` where the bytes do not fit.
    pub fn decode_image(self, width: usize, height: usize, bytes: &[u8]) -> Option<Vec<f32>> {
        let face_bytes = self.level_bytes(width, height, 1, 0).filter(|&face| face > 0)?;
        if !bytes.len().is_multiple_of(face_bytes) {
            return None;
        }
        match self.packing() {
            Packing::Block => {
                let faces = bytes.chunks_exact(face_bytes).map(|face| bc6h::decode(width, height, face));
                Some(faces.collect::<Option<Vec<_>>>()?.concat())
            }
            _ => Some(self.decode(bytes)),
        }
    }

    /// All channels of texels as numbers, [`Format::channels`] per texel.
    ///
    /// # Panics
    /// For a block format: use [`Format::decode_image`].
    pub fn decode(self, bytes: &[u8]) -> Vec<f32> {
        let words = || bytes.as_chunks::<4>().0.iter().copied();
        match (self, self.packing()) {
            (Format::E5B9G9R9_UFLOAT_PACK32, _) => words().flat_map(rgb9e5::decode).collect(),
            (Format::B10G11R11_UFLOAT_PACK32, _) => words().flat_map(r11g11b10::decode).collect(),
            (_, Packing::Channels { bytes: 1, .. }) => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
            (_, Packing::Channels { bytes: 2, .. }) => {
                bytes.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b).to_f32()).collect()
            }
            (_, Packing::Channels { .. }) => words().map(f32::from_le_bytes).collect(),
            (_, Packing::Word | Packing::Block) => panic!("{self:?} is no format of single texels"),
        }
    }

    /// Where a level's data starts without supercompression: a multiple of the block's bytes and of 4 (KTX 2.0, 3.9.7).
    fn level_alignment(self) -> usize {
        let block = self.block_bytes();
        if block.is_multiple_of(4) { block } else { block * 2 }
    }

    /// Bytes of level `level` of a texture; `None` where the product overflows.
    pub fn level_bytes(self, width: usize, height: usize, faces: usize, level: usize) -> Option<usize> {
        let side =
            |length: usize| length.checked_shr(level as u32).unwrap_or(0).max(1).div_ceil(self.block_size());
        side(width).checked_mul(side(height))?.checked_mul(faces)?.checked_mul(self.block_bytes())
    }
}
