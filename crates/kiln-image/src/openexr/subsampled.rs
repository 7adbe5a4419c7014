//! Chroma stored at half size, which crate `exr` decompresses but does not read.
//!
//! The crate refuses the header. So it is shown one that claims full sampling, the true sampling goes back into what it
//! parsed, and the lines of each decompressed chunk are taken apart here. B44 is left out: the crate's decoder
//! counts its blocks wrongly then.
//!
//! Source: "OpenEXR File Layout" (attributes, `chlist`); "Technical Introduction to OpenEXR", Luminance/Chroma Images.

use super::{FORMAT, channels::ColourChannels, chunks, explain, invalid};
use crate::{Bulk, Cancel, DecodeError};
use exr::{
    block::UncompressedBlock,
    compression::Compression,
    math::Vec2,
    meta::{MetaData, attribute::ChannelDescription, header::Header},
};

/// Bit of the version word that says: several parts.
const MULTI_PART: u32 = 0x1000;

/// A file whose header claims full sampling.
pub(super) struct Patched {
    pub bytes: Bulk<Vec<u8>>,
    /// What each channel's sampling was.
    pub sampling: Vec<Vec2<usize>>,
}

/// Sets every channel's sampling of a single-part file to 1; `None` where there is nothing to set.
pub(super) fn with_full_sampling(bytes: &[u8]) -> Option<Patched> {
    let version = u32::from_le_bytes(*bytes.get(4..)?.first_chunk()?);
    if version & MULTI_PART != 0 {
        return None;
    }
    let mut position = find_channel_list(bytes)?;
    let mut sampling = Vec::new();
    let mut places = Vec::new();
    while *bytes.get(position)? != 0 {
        // Name, sample type, quantisation, then the two rates.
        position = end_of_text(bytes, position)? + 8;
        let rate = |at: usize| usize::try_from(i32::from_le_bytes(*bytes.get(at..)?.first_chunk()?)).ok();
        sampling.push(Vec2(rate(position)?, rate(position + 4)?));
        places.push(position);
        position += 8;
    }
    if sampling.iter().all(|&rate| rate == Vec2(1, 1)) {
        return None;
    }
    let mut bytes = Bulk::new(bytes.to_vec());
    for place in places {
        bytes[place..place + 8].copy_from_slice(&[1, 0, 0, 0, 1, 0, 0, 0]);
    }
    Some(Patched { bytes, sampling })
}

/// Where the value of the attribute of type `chlist` starts.
fn find_channel_list(bytes: &[u8]) -> Option<usize> {
    let mut position = 8;
    while *bytes.get(position)? != 0 {
        let kind = end_of_text(bytes, position)?;
        let size = end_of_text(bytes, kind)?;
        let length = usize::try_from(i32::from_le_bytes(*bytes.get(size..)?.first_chunk()?)).ok()?;
        if bytes[kind..].starts_with(b"chlist\0") {
            return Some(size + 4);
        }
        position = size.checked_add(4)?.checked_add(length)?;
    }
    None
}

fn end_of_text(bytes: &[u8], start: usize) -> Option<usize> {
    Some(start + bytes.get(start..)?.iter().position(|&byte| byte == 0)? + 1)
}

/// Puts the sampling back into the only part's channels.
///
/// # Errors
/// For anything but luminance at full size with chroma at half size, in scan lines.
pub(super) fn restore(meta: &mut MetaData, sampling: &[Vec2<usize>]) -> Result<(), DecodeError> {
    let refuse = |what: &str| {
        let reason = format!("channel subsampling of {what} is not read; save the image as RGB");
        DecodeError::Unsupported { format: FORMAT, reason }
    };
    let [header] = meta.headers.as_mut_slice() else { return Err(refuse("several parts")) };
    if matches!(header.compression, Compression::B44 | Compression::B44A) {
        return Err(refuse("B44 data"));
    }
    let window = header.data_window();
    let list = &mut header.channels.list;
    if list.len() != sampling.len() {
        return Err(refuse("repeated channels"));
    }
    for (channel, &rate) in list.iter_mut().zip(sampling) {
        let is_chroma = ["RY", "BY"].iter().any(|name| channel.name == **name);
        if rate != Vec2(1, 1) && !(is_chroma && rate == Vec2(2, 2)) {
            return Err(refuse(&format!("{} by {} × {}", channel.name, rate.0, rate.1)));
        }
        channel.sampling = rate;
    }
    let is_even = [window.position.0, window.position.1].iter().all(|start| start % 2 == 0);
    if !is_even || window.size.0 % 2 != 0 || window.size.1 % 2 != 0 {
        return Err(invalid("data window".to_owned(), "it cuts texels of half-size chroma".to_owned()));
    }
    Ok(())
}

/// Whether [`restore`] found something.
pub(super) fn is_subsampled(header: &Header) -> bool {
    header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1))
}

/// Reads the only part's data window, `width · height · 3` values: RY, Y, BY, chroma interpolated between its samples, which
/// stand at even columns and rows.
pub(super) fn read_part(
    bytes: &[u8],
    meta: &MetaData,
    tables_start: usize,
    channels: &ColourChannels,
    cancel: Cancel,
) -> Result<Bulk<Vec<f32>>, DecodeError> {
    let (width, height) = (meta.headers[0].layer_size.0, meta.headers[0].layer_size.1);
    let mut meta = meta.clone();
    let lines_per_chunk = meta.headers[0].compression.scan_lines_per_block();
    let mut rgb = Bulk::new(vec![0.0; width * height * 3]);
    let mut is_filled = vec![false; height.div_ceil(lines_per_chunk)];
    for index in 0..is_filled.len() {
        cancel.check()?;
        let place = || format!("chunk {index} of {}", height.div_ceil(lines_per_chunk));
        let chunk = chunks::locate_chunk(bytes, &meta, 0, tables_start + index * 8, index)?;
        let Some(first) = chunk.row(&meta.headers[0]) else {
            return Err(invalid(place(), "its row lies outside the data window".to_owned()));
        };
        if first % lines_per_chunk != 0 || std::mem::replace(&mut is_filled[first / lines_per_chunk], true) {
            return Err(invalid(place(), "it is stored twice".to_owned()));
        }
        let rows = first..(first + lines_per_chunk).min(height);
        // The crate computes the chunk's size as texels times this.
        let chunk_bytes: usize = rows.clone().map(|row| line_bytes(&meta.headers[0], row)).sum();
        let texels = width * rows.len();
        if !chunk_bytes.is_multiple_of(texels) {
            return Err(invalid(place(), "its channels do not fill whole bytes".to_owned()));
        }
        meta.headers[0].channels.bytes_per_pixel = chunk_bytes / texels;
        let block = UncompressedBlock::decompress_chunk(chunk.compressed(bytes, 0), &meta, false)
            .map_err(|error| explain(error, &place(), bytes.len()))?;
        let mut data = block.data.as_slice();
        for row in rows {
            cancel.check()?;
            for (channel, description) in meta.headers[0].channels.list.iter().enumerate() {
                let length = channel_bytes(description, row, width);
                let line = data
                    .split_off(..length)
                    .ok_or_else(|| invalid(place(), "it is shorter than its channels".to_owned()))?;
                let sources = channels.sources.iter().enumerate();
                for (component, _) in sources.filter(|(_, source)| **source == Some(channel)) {
                    let texels = rgb[row * width * 3 + component..].iter_mut();
                    let step = 3 * description.sampling.0;
                    chunks::copy_samples(description.sample_type, line, texels.step_by(step));
                }
            }
        }
    }
    for component in 0..3 {
        let is_half = channels.sources[component]
            .is_some_and(|channel| meta.headers[0].channels.list[channel].sampling == Vec2(2, 2));
        if is_half {
            interpolate(&mut rgb, width, height, component, cancel)?;
        }
    }
    Ok(rgb)
}

/// Bytes of one channel in one row of the data window; none in the rows it skips.
fn channel_bytes(channel: &ChannelDescription, row: usize, width: usize) -> usize {
    let is_stored = row.is_multiple_of(channel.sampling.1);
    if is_stored { width / channel.sampling.0 * channel.sample_type.bytes_per_sample() } else { 0 }
}

fn line_bytes(header: &Header, row: usize) -> usize {
    header.channels.list.iter().map(|channel| channel_bytes(channel, row, header.layer_size.0)).sum()
}

/// Fills odd columns of even rows, then odd rows, with the mean of what is beside; the last one repeats its neighbour.
fn interpolate(
    rgb: &mut [f32],
    width: usize,
    height: usize,
    component: usize,
    cancel: Cancel,
) -> Result<(), DecodeError> {
    let at = |x: usize, y: usize| (y * width + x) * 3 + component;
    for y in (0..height).step_by(2) {
        cancel.check()?;
        for x in (1..width).step_by(2) {
            let next = if x + 1 < width { x + 1 } else { x - 1 };
            rgb[at(x, y)] = 0.5 * (rgb[at(x - 1, y)] + rgb[at(next, y)]);
        }
    }
    for y in (1..height).step_by(2) {
        cancel.check()?;
        let next = if y + 1 < height { y + 1 } else { y - 1 };
        for x in 0..width {
            rgb[at(x, y)] = 0.5 * (rgb[at(x, y - 1)] + rgb[at(x, next)]);
        }
    }
    Ok(())
}
