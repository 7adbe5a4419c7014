//! BC6H: blocks of 4×4 texels in 16 bytes, half floats, no alpha. Written unsigned, read signed too.
//!
//! Source: Khronos "Data Format Specification 1.3", section "BC6H" (the tables of modes and partitions are in
//! `layout.rs`). Each of the block's one or two regions is a line of 16 or 8 colours; 14 modes trade the precision of
//! the line's ends against how far they may lie apart.

mod encode;
mod layout;

pub use encode::encode_block;

use crate::{Cancel, Cancelled};
use half::f16;
use layout::{Block, MODES, WEIGHTS_3, WEIGHTS_4, region_of, unquantise, unquantise_signed};

/// Bytes of a block.
pub const BLOCK_BYTES: usize = 16;
/// Texels along a block's edge.
pub const BLOCK_SIZE: usize = 4;
/// Largest value, that of binary16.
pub const MAX: f32 = 65504.0;

/// Sixteen texels, row by row.
pub type Texels = [[f32; 3]; 16];

/// Blocks along a side of `length` texels.
pub fn block_count(length: usize) -> usize {
    length.div_ceil(BLOCK_SIZE)
}

/// Encodes one row of blocks of an image of `width` columns; `rows` are the 1 to 4 rows of values under it, three a
/// texel. Where the image ends inside a block, its last column and row are repeated.
///
/// # Panics
/// Unless `rows` is a whole number of rows, at least one.
pub fn encode_rows(width: usize, rows: &[f32]) -> Vec<u8> {
    let row_count = rows.len() / (width * 3);
    assert!(row_count >= 1 && rows.len() == row_count * width * 3, "{} values of width {width}", rows.len());
    let blocks = (0..block_count(width)).flat_map(|column| {
        encode_block(&std::array::from_fn(|index| {
            let x = (column * BLOCK_SIZE + index % BLOCK_SIZE).min(width - 1);
            let y = (index / BLOCK_SIZE).min(row_count - 1);
            let start = (y * width + x) * 3;
            [rows[start], rows[start + 1], rows[start + 2]]
        }))
    });
    blocks.collect()
}

/// Encodes an image, row 0 at the top, three values a texel.
///
/// # Errors
/// [`Cancelled`] within a row of blocks.
///
/// # Panics
/// Unless `rgb` has `width · height · 3` values.
pub fn encode(width: usize, height: usize, rgb: &[f32], cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    assert_eq!(rgb.len(), width * height * 3, "{width} × {height} texels");
    let mut bytes = Vec::with_capacity(block_count(width) * block_count(height) * BLOCK_BYTES);
    for rows in rgb.chunks(width * 3 * BLOCK_SIZE) {
        cancel.check()?;
        bytes.extend(encode_rows(width, rows));
    }
    Ok(bytes)
}

/// Decodes an unsigned image; `None` where `bytes` are not its blocks.
pub fn decode(width: usize, height: usize, bytes: &[u8]) -> Option<Vec<f32>> {
    let (columns, rows) = (block_count(width), block_count(height));
    let expected = columns.checked_mul(rows)?.checked_mul(BLOCK_BYTES)?;
    if bytes.len() != expected {
        return None;
    }
    let mut rgb = vec![0.0; width * height * 3];
    for (index, &block) in bytes.as_chunks::<BLOCK_BYTES>().0.iter().enumerate() {
        let (left, top) = (index % columns * BLOCK_SIZE, index / columns * BLOCK_SIZE);
        for (texel, value) in decode_block(block, false).into_iter().enumerate() {
            let (x, y) = (left + texel % BLOCK_SIZE, top + texel / BLOCK_SIZE);
            if x < width && y < height {
                rgb[(y * width + x) * 3..][..3].copy_from_slice(&value);
            }
        }
    }
    Some(rgb)
}

/// The texels of a block; the four reserved modes are black, as the specification says.
pub fn decode_block(bytes: [u8; BLOCK_BYTES], is_signed: bool) -> Texels {
    let Some(block) = Block::from_bytes(bytes) else { return [[0.0; 3]; 16] };
    let mode = &MODES[block.mode];
    let unquantise = if is_signed { unquantise_signed } else { unquantise };
    let finish = if is_signed { finish_signed } else { finish };
    let ends = block.ends.map(|end| end.map(|value| unquantise(value, mode.bits)));
    std::array::from_fn(|texel| {
        let region = region_of(block.partition, texel, mode.regions);
        let index = usize::from(block.indices[texel]);
        let weight = if mode.regions == 1 { WEIGHTS_4[index] } else { WEIGHTS_3[index] };
        std::array::from_fn(|channel| {
            let mixed = mix(ends[2 * region][channel], ends[2 * region + 1][channel], weight);
            f16::from_bits(finish(mixed)).to_f32()
        })
    })
}

/// A colour on the line between two unquantised ends.
fn mix(a: i32, b: i32, weight: i32) -> i32 {
    (a * (64 - weight) + b * weight + 32) >> 6
}

/// The half float that a mixed value stands for.
fn finish(value: i32) -> u16 {
    ((value * 31) >> 6) as u16
}

/// The same of a signed format: sign and magnitude, 0 without a sign.
fn finish_signed(value: i32) -> u16 {
    let magnitude = ((value.abs() * 31) >> 5) as u16;
    if value < 0 && magnitude > 0 { magnitude | 0x8000 } else { magnitude }
}
