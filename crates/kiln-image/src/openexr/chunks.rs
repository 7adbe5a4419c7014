//! From chunk offsets to texels.

use super::{FORMAT, channels::ColourChannels, explain, invalid};
use crate::{Bulk, Cancel, Cancelled, DecodeError};
use exr::{
    block::{
        UncompressedBlock,
        chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates},
    },
    math::Vec2,
    meta::{BlockDescription, MetaData, attribute::SampleType, compute_block_count, header::Header},
};
use half::f16;

/// Reads one part's data window, `width · height · 3` values.
///
/// Every chunk's place and length are checked before the image is allocated, so a short file that
/// claims a large image costs nothing.
pub(super) fn read_part(
    bytes: &[u8],
    meta: &MetaData,
    part: usize,
    tables_start: usize,
    channels: &ColourChannels,
    cancel: Cancel,
) -> Result<Bulk<Vec<f32>>, DecodeError> {
    let header = &meta.headers[part];
    let skipped: usize = meta.headers[..part].iter().map(|header| header.chunk_count).sum();
    let (block, size) = (header.max_block_pixel_size(), header.layer_size);
    // The largest level stands first in the table, whatever levels follow.
    let count = compute_block_count(size.0, block.0) * compute_block_count(size.1, block.1);
    let chunks = (0..count)
        .map(|index| {
            cancel.check()?;
            locate_chunk(bytes, meta, part, tables_start + (skipped + index) * 8, index)
        })
        .collect::<Result<Vec<_>, _>>()?;

    let mut target = Target { channels, width: size.0, rgb: Bulk::new(vec![0.0; size.0 * size.1 * 3]) };
    let mut is_filled = vec![false; count];
    let columns = compute_block_count(size.0, block.0);
    for (index, chunk) in chunks.into_iter().enumerate() {
        cancel.check()?;
        let chunk = chunk.compressed(bytes, part);
        let block_data = UncompressedBlock::decompress_chunk(chunk, meta, false)
            .map_err(|error| explain(error, &format!("chunk {index} of {count}"), bytes.len()))?;
        let at = block_data.index.pixel_position;
        let slot = is_filled.get_mut(at.1 / block.1 * columns + at.0 / block.0);
        if block_data.index.level != Vec2(0, 0) || slot.is_none_or(|slot| std::mem::replace(slot, true)) {
            return Err(invalid(format!("chunk {index} of {count}"), "it is stored twice".to_owned()));
        }
        target.write(&block_data, meta, part, cancel)?;
    }
    Ok(target.rgb)
}

/// A chunk's head, its bytes still in the file.
pub(super) struct Located {
    place: ChunkPlace,
    data: std::ops::Range<usize>,
}

enum ChunkPlace {
    Row(i32),
    Tile(TileCoordinates),
}

/// Reads a chunk's head: part number (multi-part files), coordinates, byte count.
pub(super) fn locate_chunk(
    bytes: &[u8],
    meta: &MetaData,
    part: usize,
    table_entry: usize,
    index: usize,
) -> Result<Located, DecodeError> {
    let place = || format!("chunk {index}");
    let truncated = || DecodeError::Truncated { format: FORMAT, what: place(), byte: bytes.len() };
    let entry = bytes.get(table_entry..).and_then(|rest| rest.first_chunk()).ok_or_else(truncated)?;
    let offset = usize::try_from(u64::from_le_bytes(*entry)).map_err(|_| truncated())?;
    if offset < table_entry {
        let reason = if offset == 0 { "it was never written" } else { "its offset points into the headers" };
        return Err(invalid(place(), reason.to_owned()));
    }
    let mut position = offset;
    let mut next = || {
        let word = bytes.get(position..).and_then(|rest| rest.first_chunk()).ok_or_else(truncated)?;
        position += 4;
        Ok::<i32, DecodeError>(i32::from_le_bytes(*word))
    };
    if meta.requirements.is_multilayer() && usize::try_from(next()?) != Ok(part) {
        return Err(invalid(place(), "it belongs to another part".to_owned()));
    }
    let chunk_place = match meta.headers[part].blocks {
        BlockDescription::ScanLines => ChunkPlace::Row(next()?),
        BlockDescription::Tiles(_) => {
            let coordinates = [next()?, next()?, next()?, next()?];
            ChunkPlace::Tile(
                tile_coordinates(coordinates)
                    .ok_or_else(|| invalid(place(), format!("its tile coordinates are {coordinates:?}")))?,
            )
        }
    };
    let length =
        usize::try_from(next()?).map_err(|_| invalid(place(), "its length is negative".to_owned()))?;
    let end = position.checked_add(length).filter(|&end| end <= bytes.len()).ok_or_else(truncated)?;
    Ok(Located { place: chunk_place, data: position..end })
}

/// Tile column and row of the largest level, small enough that their products cannot overflow.
fn tile_coordinates([x, y, level_x, level_y]: [i32; 4]) -> Option<TileCoordinates> {
    let tile_index = Vec2(usize::try_from(x).ok()?, usize::try_from(y).ok()?);
    ([level_x, level_y] == [0, 0]).then_some(TileCoordinates { tile_index, level_index: Vec2(0, 0) })
}

impl Located {
    /// The row of the data window it starts at; `None` for tiles and rows outside.
    pub(super) fn row(&self, header: &Header) -> Option<usize> {
        let ChunkPlace::Row(y) = self.place else { return None };
        let row = i64::from(y) - i64::from(header.data_window().position.1);
        usize::try_from(row).ok().filter(|&row| row < header.layer_size.1)
    }

    pub(super) fn compressed(self, bytes: &[u8], part: usize) -> Chunk {
        let compressed_pixels_le = bytes[self.data].to_vec();
        let compressed_block = match self.place {
            ChunkPlace::Row(y_coordinate) => {
                CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le })
            }
            ChunkPlace::Tile(coordinates) => {
                CompressedBlock::Tile(CompressedTileBlock { coordinates, compressed_pixels_le })
            }
        };
        Chunk { layer_index: part, compressed_block }
    }
}

struct Target<'a> {
    channels: &'a ColourChannels,
    width: usize,
    rgb: Bulk<Vec<f32>>,
}

impl Target<'_> {
    /// Spreads a block's lines (one channel each) over the interleaved texels.
    fn write(
        &mut self,
        block: &UncompressedBlock,
        meta: &MetaData,
        part: usize,
        cancel: Cancel,
    ) -> Result<(), Cancelled> {
        let list = &meta.headers[part].channels;
        for line in block.lines(list) {
            cancel.check()?;
            let sources = self.channels.sources;
            for (component, _) in
                sources.iter().enumerate().filter(|(_, s)| **s == Some(line.location.channel))
            {
                let Vec2(x, y) = line.location.position;
                let start = (y * self.width + x) * 3 + component;
                let texels = self.rgb[start..].iter_mut().step_by(3);
                copy_samples(list.list[line.location.channel].sample_type, line.value, texels);
            }
        }
        Ok(())
    }
}

/// The crate hands samples over in native byte order.
pub(super) fn copy_samples<'a>(kind: SampleType, bytes: &[u8], texels: impl Iterator<Item = &'a mut f32>) {
    match kind {
        SampleType::F16 => {
            let values = bytes.as_chunks().0.iter().map(|&b| f16::from_ne_bytes(b).to_f32());
            texels.zip(values).for_each(|(texel, value)| *texel = value);
        }
        SampleType::F32 => {
            let values = bytes.as_chunks().0.iter().map(|&b| f32::from_ne_bytes(b));
            texels.zip(values).for_each(|(texel, value)| *texel = value);
        }
        SampleType::U32 => {
            let values = bytes.as_chunks().0.iter().map(|&b| u32::from_ne_bytes(b) as f32);
            texels.zip(values).for_each(|(texel, value)| *texel = value);
        }
    }
}
