//! OpenEXR through crate `exr`, which decompresses; this module chooses the part, checks sizes and
//! chunk bounds before anything is allocated, places the data window and converts colours.
//!
//! Read: scan lines and tiles (largest level), every compression of the crate, half, float and uint
//! samples, RGB or luminance, luminance with chroma at full or half size. Not read: deep parts,
//! half-size chroma in several parts or with B44, HTJ2K.
//!
//! Source: "OpenEXR File Layout" and "Technical Introduction to OpenEXR" (Academy Software Foundation).

mod channels;
mod chunks;
mod subsampled;

use crate::{
    Bulk, Cancel, DecodeError, Image, Layout, Limits,
    colour::{self, Chromaticities, Gamut},
    decode::{Source, check_size, guard, too_large},
};
use channels::ColourChannels;
use exr::meta::{
    MetaData,
    attribute::{EnvironmentMap, IntegerBounds},
    header::Header,
};
use std::io::Cursor;

/// The format's name in messages.
pub(crate) const FORMAT: &str = "OpenEXR";

/// Decoded bytes of one chunk: a hostile tile size must not ask for more.
const CHUNK_BYTES_MAX: usize = 1 << 30;

/// Decodes the first part that holds colour.
///
/// # Errors
/// [`DecodeError`] with part or chunk; [`DecodeError::Cancelled`] after the chunk in work.
pub(crate) fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    guard(FORMAT, || decode_unguarded(bytes, limits, cancel))
}

fn decode_unguarded(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    let full = subsampled::with_full_sampling(bytes);
    let bytes = full.as_ref().map_or(bytes, |full| &full.bytes);
    let (mut meta, chunk_tables_start) = read_meta(bytes)?;
    if let Some(full) = &full {
        subsampled::restore(&mut meta, &full.sampling)?;
    }
    check_tables(&meta, bytes.len(), chunk_tables_start, limits)?;
    let (part, channels) = choose_part(&meta)?;
    let header = &meta.headers[part];
    check_part(header, limits)?;

    let mut notes = part_notes(&meta, part, &channels);
    let mut rgb = if subsampled::is_subsampled(header) {
        subsampled::read_part(bytes, &meta, chunk_tables_start, &channels, cancel)?
    } else {
        chunks::read_part(bytes, &meta, part, chunk_tables_start, &channels, cancel)?
    };
    let gamut = convert_colour(header, &mut rgb, &channels, &mut notes, cancel)?;
    let image = place(header, rgb, limits, &mut notes, cancel)?;
    let declared = header.own_attributes.environment_map.map(|map| match map {
        EnvironmentMap::LatitudeLongitude => Layout::Equirect,
        EnvironmentMap::Cube => Layout::ExrCube,
    });
    let texel_aspect = texel_aspect(header);
    Ok(Source { gamut, declared, texel_aspect, ..Source::flat(FORMAT, image, notes) })
}

/// Height of a texel over its width; pixelAspectRatio is the other way round, and 0 or no number says nothing.
fn texel_aspect(header: &Header) -> f64 {
    let aspect = f64::from(header.shared_attributes.pixel_aspect);
    if aspect.is_finite() && aspect > 0.0 { 1.0 / aspect } else { 1.0 }
}

/// The validated headers, and the byte where the chunk offset tables start.
fn read_meta(bytes: &[u8]) -> Result<(MetaData, usize), DecodeError> {
    let failed = |error: exr::error::Error| explain(error, "the header", bytes.len());
    let meta = exr::block::read(Cursor::new(bytes), false).map_err(failed)?.into_meta_data();
    // The crate validates only what it goes on to read itself; a second look tells where headers end.
    let mut cursor = Cursor::new(bytes);
    MetaData::read_from_buffered(&mut cursor, false).map_err(failed)?;
    Ok((meta, cursor.position() as usize))
}

/// The crate's error in our words.
fn explain(error: exr::error::Error, place: &str, end: usize) -> DecodeError {
    match error {
        exr::error::Error::NotSupported(reason) if reason.contains("subsampling") => {
            let reason =
                "chroma subsampling (channels stored at half size) is not read; save the image as RGB";
            DecodeError::Unsupported { format: FORMAT, reason: reason.to_owned() }
        }
        exr::error::Error::NotSupported(reason) => {
            DecodeError::Unsupported { format: FORMAT, reason: reason.into_owned() }
        }
        // The crate turns an early end into this sentence.
        exr::error::Error::Invalid(reason) if reason == "reference to missing bytes" => {
            DecodeError::Truncated { format: FORMAT, what: place.to_owned(), byte: end }
        }
        exr::error::Error::Invalid(reason) => invalid(place.to_owned(), reason.into_owned()),
        other => invalid(place.to_owned(), other.to_string()),
    }
}

fn invalid(place: String, reason: String) -> DecodeError {
    DecodeError::Invalid { format: FORMAT, place, reason }
}

/// The offset tables of all parts must fit into what is left of the file.
fn check_tables(meta: &MetaData, end: usize, start: usize, limits: &Limits) -> Result<(), DecodeError> {
    if meta.headers.len() > limits.parts_max {
        return Err(too_large(FORMAT, "the number of parts", meta.headers.len(), limits.parts_max));
    }
    let chunks = meta.headers.iter().try_fold(0_usize, |sum, header| sum.checked_add(header.chunk_count));
    match chunks {
        Some(chunks) if chunks <= end.saturating_sub(start) / 8 => Ok(()),
        _ => {
            let what = "the chunk offset table".to_owned();
            Err(DecodeError::Truncated { format: FORMAT, what, byte: end })
        }
    }
}

fn choose_part(meta: &MetaData) -> Result<(usize, ColourChannels), DecodeError> {
    let flat = meta.headers.iter().enumerate().filter(|(_, header)| !header.deep);
    let found = flat.clone().find_map(|(index, header)| Some((index, ColourChannels::find(header)?)));
    found.ok_or_else(|| {
        let reason = if flat.clone().next().is_none() {
            "deep data has no single radiance per texel; flatten it first".to_owned()
        } else {
            let names = meta.headers.iter().flat_map(|h| &h.channels.list).map(|c| c.name.to_string());
            let names: Vec<String> = names.take(16).collect();
            format!("no part has colour channels (R, G, B or Y); there are {}", names.join(", "))
        };
        DecodeError::Unsupported { format: FORMAT, reason }
    })
}

fn check_part(header: &Header, limits: &Limits) -> Result<(), DecodeError> {
    check_size(FORMAT, header.layer_size.width(), header.layer_size.height(), limits)?;
    let count = header.channels.list.len();
    if count > limits.channels_max {
        return Err(too_large(FORMAT, "the number of channels", count, limits.channels_max));
    }
    let block = header.max_block_pixel_size().min(header.layer_size);
    let bytes = block.0.saturating_mul(block.1).saturating_mul(header.channels.bytes_per_pixel);
    if bytes > CHUNK_BYTES_MAX {
        return Err(too_large(FORMAT, "the size of a decoded chunk", bytes, CHUNK_BYTES_MAX));
    }
    Ok(())
}

fn part_notes(meta: &MetaData, part: usize, channels: &ColourChannels) -> Vec<String> {
    let header = &meta.headers[part];
    let mut notes = channels.notes.clone();
    if meta.headers.len() > 1 {
        let name =
            header.own_attributes.layer_name.as_ref().map_or("unnamed".to_owned(), ToString::to_string);
        let deep = meta.headers.iter().filter(|h| h.deep).count();
        let skipped = if deep > 0 { format!(", {deep} of them deep") } else { String::new() };
        notes.push(format!("part {part} ({name}) was taken, of {} parts{skipped}", meta.headers.len()));
    }
    notes
}

fn chromaticities(header: &Header) -> Option<Chromaticities> {
    let c = header.shared_attributes.chromaticities?;
    let pair = |v: exr::math::Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    let found =
        Chromaticities { red: pair(c.red), green: pair(c.green), blue: pair(c.blue), white: pair(c.white) };
    // Eight zeros say as little here as in a .hdr.
    (found.to_array() != [0.0; 8]).then_some(found)
}

fn convert_colour(
    header: &Header,
    rgb: &mut [f32],
    channels: &ColourChannels,
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<Option<Gamut>, DecodeError> {
    let source = chromaticities(header).unwrap_or(colour::REC_709);
    let no_space =
        || invalid("chromaticities".to_owned(), format!("{:?} span no colour space", source.to_array()));
    if channels.has_chroma {
        let weights = colour::luminance_weights(source).ok_or_else(no_space)?;
        channels::undo_luminance_chroma(rgb, weights, cancel)?;
    }
    if channels.is_grey || source.is_close_to(colour::REC_709) {
        return Ok(None);
    }
    let matrix = if source.is_close_to(colour::CIE_XYZ) {
        // Tristimulus values are no RGB with a white of its own: nothing is adapted.
        colour::xyz_to_rec_709()
    } else {
        colour::to_rec_709(source)
    };
    let matrix = matrix.ok_or_else(no_space)?;
    colour::transform_texels(&matrix, rgb, cancel)?;
    notes.push(format!("chromaticities {:?} were converted to Rec. 709", source.to_array()));
    Ok(Some(Gamut::new(matrix).ok_or_else(no_space)?))
}

/// Puts the data window where the display window is; what was not stored is black.
///
/// An environment map is its data window, whatever is displayed (OpenEXR's ImfEnvmap), and so is an image of which
/// nothing would be displayed.
fn place(
    header: &Header,
    rgb: Bulk<Vec<f32>>,
    limits: &Limits,
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<Image, DecodeError> {
    let (width, height) = (header.layer_size.0, header.layer_size.1);
    let data = header.data_window();
    let display = header.shared_attributes.display_window;
    if display == data {
        return Ok(Image::new(width, height, rgb.into_inner())?);
    }
    if header.own_attributes.environment_map.is_some() {
        notes.push(format!(
            "the data window ({}) was taken as the environment map; the display window ({}) has no effect",
            describe(data),
            describe(display)
        ));
        return Ok(Image::new(width, height, rgb.into_inner())?);
    }
    check_size(FORMAT, display.size.0, display.size.1, limits)?;
    let columns = Overlap::new(data.position.0, width, display.position.0, display.size.0);
    let rows = Overlap::new(data.position.1, height, display.position.1, display.size.1);
    if columns.length == 0 || rows.length == 0 {
        notes.push(format!(
            "the data window ({}) lies outside the display window ({}); it was taken alone",
            describe(data),
            describe(display)
        ));
        return Ok(Image::new(width, height, rgb.into_inner())?);
    }
    notes.push(format!(
        "the data window ({}) was placed in the display window ({}); the rest is black or cropped",
        describe(data),
        describe(display)
    ));
    let mut out = Bulk::new(vec![0.0; display.size.0 * display.size.1 * 3]);
    for row in 0..rows.length {
        cancel.check()?;
        let from = ((rows.data_start + row) * width + columns.data_start) * 3;
        let to = ((rows.display_start + row) * display.size.0 + columns.display_start) * 3;
        out[to..to + columns.length * 3].copy_from_slice(&rgb[from..from + columns.length * 3]);
    }
    Ok(Image::new(display.size.0, display.size.1, out.into_inner())?)
}

/// The common part of two intervals, in the coordinates of each.
struct Overlap {
    data_start: usize,
    display_start: usize,
    length: usize,
}

impl Overlap {
    fn new(data: i32, data_length: usize, display: i32, display_length: usize) -> Overlap {
        let offset = i64::from(display) - i64::from(data);
        let data_start = usize::try_from(offset).unwrap_or(0);
        let display_start = usize::try_from(-offset).unwrap_or(0);
        let length = data_length.saturating_sub(data_start).min(display_length.saturating_sub(display_start));
        Overlap { data_start, display_start, length }
    }
}

fn describe(window: IntegerBounds) -> String {
    format!("{} × {} at {}, {}", window.size.0, window.size.1, window.position.0, window.position.1)
}
