//! Decoding of PNG, JPEG and WebP, and what their texels say about effects.

use std::io::Cursor;

use image::{ImageFormat, ImageReader};

use crate::{Image8, limits};

/// A decoded picture, its source bytes, and the range of each channel.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    pub decoded: Image8,
    /// PNG or JPEG bytes, as they go into a pack.
    pub encoded: Vec<u8>,
    pub mime_type: &'static str,
    pub range: ChannelRange,
}

/// Smallest and largest code of each channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ChannelRange {
    pub min: [u8; 4],
    pub max: [u8; 4],
}

/// Decodes a picture of at most `texels_left` texels.
///
/// # Errors
/// A sentence: unknown format, damaged data, too large.
pub(crate) fn decode(bytes: &[u8], texels_left: usize) -> Result<Picture, String> {
    let (format, mime_type) = sniff(bytes).ok_or("it is none of PNG, JPEG and WebP")?;
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut bounds = image::Limits::default();
        bounds.max_image_width = Some(limits::IMAGE_EDGE_MAX);
        bounds.max_image_height = Some(limits::IMAGE_EDGE_MAX);
        bounds.max_alloc = Some(8 * texels_left as u64 + (1 << 16));
        reader.limits(bounds);
        reader
    };
    // The size is checked before a texel is allocated.
    let (width, height) = reader().into_dimensions().map_err(|error| error.to_string())?;
    let texels = width as usize * height as usize;
    if texels > texels_left || width.max(height) > limits::IMAGE_EDGE_MAX {
        return Err(format!("{width}×{height} texels exceed the limit"));
    }
    let decoded = reader().decode().map_err(|error| error.to_string())?.into_rgba8();
    let decoded = Image8 { width: decoded.width(), height: decoded.height(), rgba: decoded.into_raw() };
    if format == ImageFormat::WebP {
        // As PNG no reader of the pack needs an extension, and not a texel changes.
        return from_texels(decoded);
    }
    let range = channel_range(&decoded.rgba).ok_or("it has no texels")?;
    Ok(Picture { decoded, encoded: bytes.to_vec(), mime_type, range })
}

/// Decodes a PNG, JPEG or WebP file that is no part of a scene, within the limits of one.
///
/// # Errors
/// A sentence: unknown format, damaged data, too large.
pub fn decode_image(bytes: &[u8]) -> Result<Image8, String> {
    decode(bytes, limits::TEXEL_COUNT_MAX / 4).map(|picture| picture.decoded)
}

/// Encodes a generated picture as PNG.
///
/// # Errors
/// A sentence, if the encoder refuses the size.
pub(crate) fn from_texels(decoded: Image8) -> Result<Picture, String> {
    let mut encoded = Vec::new();
    let buffer = image::RgbaImage::from_raw(decoded.width, decoded.height, decoded.rgba.clone());
    let buffer = buffer.ok_or("texels and size disagree")?;
    buffer.write_to(&mut Cursor::new(&mut encoded), ImageFormat::Png).map_err(|error| error.to_string())?;
    let range = channel_range(&decoded.rgba).ok_or("it has no texels")?;
    Ok(Picture { decoded, encoded, mime_type: "image/png", range })
}

/// By the first bytes, because MIME types in files are often wrong.
fn sniff(bytes: &[u8]) -> Option<(ImageFormat, &'static str)> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some((ImageFormat::Png, "image/png"))
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        Some((ImageFormat::Jpeg, "image/jpeg"))
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Some((ImageFormat::WebP, "image/webp"))
    } else {
        None
    }
}

fn channel_range(rgba: &[u8]) -> Option<ChannelRange> {
    let (texels, _) = rgba.as_chunks::<4>();
    let first = *texels.first()?;
    let mut range = ChannelRange { min: first, max: first };
    for texel in texels {
        range.min = std::array::from_fn(|channel| range.min[channel].min(texel[channel]));
        range.max = std::array::from_fn(|channel| range.max[channel].max(texel[channel]));
    }
    Some(range)
}
