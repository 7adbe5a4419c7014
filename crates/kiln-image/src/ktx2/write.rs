//! The writer.

use super::{Format, IDENTIFIER, Texture};

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
    let descriptor = data_format_descriptor(texture.format);
    let key_values = key_value_data(&texture.key_values);
    let descriptor_start = HEADER_BYTES + texture.levels.len() * LEVEL_ENTRY_BYTES;
    let key_values_start = descriptor_start + descriptor.len();
    let levels_start = key_values_start + key_values.len();
    let offsets = level_offsets(texture, levels_start);

    let mut out = Vec::with_capacity(offsets[0] + texture.levels[0].len());
    out.extend_from_slice(&IDENTIFIER);
    let word = |value: usize| u32::try_from(value).expect("a size below 4 GiB").to_le_bytes();
    let header = [
        texture.format.vk_format() as usize,
        texture.format.channel_bytes(),
        texture.width,
        texture.height,
        0, // depth: no 3D texture
        0, // layers: no array
        texture.faces,
        texture.levels.len(),
        0, // no supercompression
        descriptor_start,
        descriptor.len(),
        key_values_start,
        key_values.len(),
    ];
    header.into_iter().for_each(|value| out.extend_from_slice(&word(value)));
    out.extend_from_slice(&[0; 16]); // no supercompression data
    for (offset, level) in offsets.iter().zip(&texture.levels) {
        for value in [*offset, level.len(), level.len()] {
            out.extend_from_slice(&(value as u64).to_le_bytes());
        }
    }
    out.extend_from_slice(&descriptor);
    out.extend_from_slice(&key_values);
    for (offset, level) in offsets.iter().zip(&texture.levels).rev() {
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
fn level_offsets(texture: &Texture, start: usize) -> Vec<usize> {
    let alignment = texture.format.level_alignment();
    let mut offsets = vec![0; texture.levels.len()];
    let mut position = start;
    for (offset, level) in offsets.iter_mut().zip(&texture.levels).rev() {
        position = position.next_multiple_of(alignment);
        *offset = position;
        position += level.len();
    }
    offsets
}

/// Total size, then one basic block: linear Rec. 709 RGBA, one signed float sample per channel.
fn data_format_descriptor(format: Format) -> Vec<u8> {
    const MODEL_RGBSDA: u8 = 1;
    const PRIMARIES_BT709: u8 = 1;
    const TRANSFER_LINEAR: u8 = 1;
    const SAMPLE_FLOAT_SIGNED: u8 = 0xc0;
    const CHANNEL_IDS: [u8; 4] = [0, 1, 2, 15];

    let block_bytes = 24 + 16 * format.channels() as u32;
    let mut out = Vec::new();
    out.extend_from_slice(&(block_bytes + 4).to_le_bytes());
    out.extend_from_slice(&0_u32.to_le_bytes()); // Khronos, basic format
    out.extend_from_slice(&(block_bytes << 16 | 2).to_le_bytes()); // version 1.3 of the specification
    out.extend_from_slice(&[MODEL_RGBSDA, PRIMARIES_BT709, TRANSFER_LINEAR, 0]); // straight alpha
    out.extend_from_slice(&[0; 4]); // blocks of one texel, stored as size − 1
    out.extend_from_slice(&[format.texel_bytes() as u8, 0, 0, 0, 0, 0, 0, 0]);
    let bits = format.channel_bytes() * 8;
    for (index, id) in CHANNEL_IDS.into_iter().take(format.channels()).enumerate() {
        out.extend_from_slice(&((index * bits) as u16).to_le_bytes());
        out.extend_from_slice(&[(bits - 1) as u8, SAMPLE_FLOAT_SIGNED | id]);
        out.extend_from_slice(&[0; 4]); // sample position
        out.extend_from_slice(&(-1.0_f32).to_le_bytes());
        out.extend_from_slice(&1.0_f32.to_le_bytes());
    }
    out
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
    let mut out = Vec::new();
    for (key, value) in pairs {
        let length = key.len() + value.len() + 2;
        out.extend_from_slice(&(length as u32).to_le_bytes());
        out.extend_from_slice(key.as_bytes());
        out.push(0);
        out.extend_from_slice(value.as_bytes());
        out.push(0);
        out.resize(out.len().next_multiple_of(4), 0);
    }
    out
}
