//! PNG and JPEG: display-referred pictures, decoded as what they can at most mean.

use crate::{
    Bulk, Cancel, Cancelled, DecodeError, Image, Limits,
    colour::srgb_to_linear,
    decode::{CHECK_TEXELS, Source, check_size, guard},
};
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader};
use std::io::Cursor;

/// Which decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Png,
    Jpeg,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Png => "PNG",
            Kind::Jpeg => "JPEG",
        }
    }
}

/// Decodes as sRGB; the notes say that a range of 0…1 is no radiance.
pub(crate) fn decode(
    bytes: &[u8],
    kind: Kind,
    limits: &Limits,
    cancel: Cancel,
) -> Result<Source, DecodeError> {
    guard(kind.name(), || decode_unguarded(bytes, kind, limits, cancel))
}

fn decode_unguarded(
    bytes: &[u8],
    kind: Kind,
    limits: &Limits,
    cancel: Cancel,
) -> Result<Source, DecodeError> {
    let format = kind.name();
    let failed = |error| explain(error, format, bytes.len());
    let image_format = match kind {
        Kind::Png => image::ImageFormat::Png,
        Kind::Jpeg => image::ImageFormat::Jpeg,
    };
    let decoder =
        ImageReader::with_format(Cursor::new(bytes), image_format).into_decoder().map_err(failed)?;
    let (width, height) = decoder.dimensions();
    check_size(format, width as usize, height as usize, limits)?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(failed)?;
    let mut notes = vec![format!(
        "{format} holds display values from 0 to 1, decoded as sRGB: lights are clipped, \
         so lighting from it will be too dark"
    )];
    if decoded.color().has_alpha() {
        notes.push("alpha was ignored".to_owned());
    }
    let image = Image::new(width as usize, height as usize, linear_values(decoded, cancel)?)?;
    Ok(Source::flat(format, image, notes))
}

fn linear_values(decoded: DynamicImage, cancel: Cancel) -> Result<Vec<f32>, Cancelled> {
    let is_8_bit = decoded.color().bytes_per_pixel() == decoded.color().channel_count();
    if is_8_bit {
        let table: [f32; 256] = std::array::from_fn(|value| srgb_to_linear(value as f64 / 255.0) as f32);
        convert(decoded.into_rgb8().into_raw(), |value| table[usize::from(value)], cancel)
    } else {
        let linear = |value: u16| srgb_to_linear(f64::from(value) / 65535.0) as f32;
        convert(decoded.into_rgb16().into_raw(), linear, cancel)
    }
}

fn convert<T: Copy + Send + 'static>(
    stored: Vec<T>,
    linear: impl Fn(T) -> f32,
    cancel: Cancel,
) -> Result<Vec<f32>, Cancelled> {
    let stored = Bulk::new(stored);
    let mut rgb = Bulk::new(Vec::with_capacity(stored.len()));
    for values in stored.chunks(CHECK_TEXELS) {
        cancel.check()?;
        rgb.extend(values.iter().map(|&value| linear(value)));
    }
    Ok(rgb.into_inner())
}

fn explain(error: ImageError, format: &'static str, end: usize) -> DecodeError {
    match error {
        ImageError::Unsupported(reason) => DecodeError::Unsupported { format, reason: reason.to_string() },
        ImageError::IoError(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => {
            DecodeError::Truncated { format, what: "the pixel data".to_owned(), byte: end }
        }
        other => DecodeError::Invalid { format, place: "file".to_owned(), reason: other.to_string() },
    }
}
