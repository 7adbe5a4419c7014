//! The writer: plain or with Zstandard.

use super::descriptor::data_format_descriptor;
use super::{IDENTIFIER, Texture};
use crate::{Cancel, Cancelled};

/// Header up to the level index: identifier, nine words, four words and two double words of the index.
pub(super) const HEADER_BYTES: usize = 80;
/// One level index entry.
pub(super) const LEVEL_ENTRY_BYTES: usize = 24;

/// Writes a container without supercompression; the smallest level stands first, as the format wants.
///
/// Equal textures give equal bytes: nothing but [`Texture`] enters.
///
/// # Panics
/// Where a level's bytes do not fit the sizes, faces are neither 1 nor 6, or there is no level.
pub fn write(texture: &Texture) -> Vec<u8> {
    check(texture);
    assemble(texture, Supercompression::None, &texture.levels)
}

/// Writes a container whose levels are compressed with Zstandard, each on its own, at `compression` 1 to 22.
///
/// The compressor is one library of a fixed version without threads: equal textures give equal bytes.
///
/// # Errors
/// [`Cancelled`] within a level's work, which is some 10 ns a byte at `compression` 3 and 100 times that at 19.
///
/// # Panics
/// As [`write()`]; where memory runs out.
pub fn write_zstd(texture: &Texture, compression: i32, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    check(texture);
    let mut levels = Vec::with_capacity(texture.levels.len());
    for level in &texture.levels {
        cancel.check()?;
        levels.push(zstd::bulk::compress(level, compression).expect("compressing to memory succeeds"));
    }
    let levels: Vec<&[u8]> = levels.iter().map(Vec::as_slice).collect();
    Ok(assemble(texture, Supercompression::Zstandard, &levels))
}

/// KTX 2.0's `supercompressionScheme`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Supercompression {
    None = 0,
    Zstandard = 2,
}

/// Joins header, index, descriptor, pairs and the levels as `stored`.
fn assemble(texture: &Texture, scheme: Supercompression, stored: &[&[u8]]) -> Vec<u8> {
    let descriptor = data_format_descriptor(texture.format, scheme);
    let key_values = key_value_data(&texture.key_values);
    let descriptor_start = HEADER_BYTES + stored.len() * LEVEL_ENTRY_BYTES;
    let key_values_start = descriptor_start + descriptor.len();
    let levels_start = key_values_start + key_values.len();
    // Compressed data has no alignment (KTX 2.0, 3.9.7).
    let alignment = if scheme == Supercompression::None { texture.format.level_alignment() } else { 1 };
    let offsets = level_offsets(stored, levels_start, alignment);

    let mut out = Vec::with_capacity(offsets[0] + stored[0].len());
    out.extend_from_slice(&IDENTIFIER);
    let word = |value: usize| u32::try_from(value).expect("a size below 4 GiB").to_le_bytes();
    let header = [
        texture.format.vk_format() as usize,
        texture.format.type_size(),
        texture.width,
        texture.height,
        0, // depth: no 3D texture
        0, // layers: no array
        texture.faces,
        stored.len(),
        scheme as usize,
        descriptor_start,
        descriptor.len(),
        key_values_start,
        key_values.len(),
    ];
    header.into_iter().for_each(|value| out.extend_from_slice(&word(value)));
    out.extend_from_slice(&[0; 16]); // no global data of the supercompression
    for ((offset, stored), level) in offsets.iter().zip(stored).zip(&texture.levels) {
        for value in [*offset, stored.len(), level.len()] {
            out.extend_from_slice(&(value as u64).to_le_bytes());
        }
    }
    out.extend_from_slice(&descriptor);
    out.extend_from_slice(&key_values);
    for (offset, level) in offsets.iter().zip(stored).rev() {
        out.resize(*offset, 0);
        out.extend_from_slice(level);
    }
    out
}

fn check(texture: &Texture) {
    let Texture { format, width, height, faces, ref levels, .. } = *texture;
    assert!(!levels.is_empty() && width > 0 && height > 0, "a texture has a size and a level");
    assert!(faces == 1 || faces == 6 && width == height, "{faces} faces of {width} × {height}");
    assert!(levels.len() <= (width.max(height).ilog2() + 1) as usize, "{} levels are too many", levels.len());
    for (index, level) in levels.iter().enumerate() {
        let expected = format.level_bytes(width, height, faces, index);
        assert_eq!(Some(level.len()), expected, "bytes of level {index}");
    }
}

/// Byte offsets by level, the last level first in the file.
fn level_offsets(levels: &[&[u8]], start: usize, alignment: usize) -> Vec<usize> {
    let mut offsets = vec![0; levels.len()];
    let mut position = start;
    for (offset, level) in offsets.iter_mut().zip(levels).rev() {
        position = position.next_multiple_of(alignment);
        *offset = position;
        position += level.len();
    }
    offsets
}

/// Sorted by key; each pair is length, key, NUL, value, NUL, padding to 4.
fn key_value_data(given: &[(String, String)]) -> Vec<u8> {
    let mut pairs = given.to_vec();
    for (key, value) in [("KTXorientation", "rd"), ("KTXwriter", "Kiln")] {
        if !given.iter().any(|(name, _)| name == key) {
            pairs.push((key.to_owned(), value.to_owned()));
        }
    }
    pairs.sort();
    crate::ktx1::key_value_data(&pairs)
}
