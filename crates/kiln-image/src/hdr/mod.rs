//! Radiance pictures (.hdr, .pic), read in full and written.
//!
//! Source: Greg Ward, "Real Pixels", Graphics Gems II (1991); the format's description in the Radiance
//! reference manual ("File Formats: Picture Files"). Deviations are said where they stand.
//!
//! A value is `mantissa · 2^(exponent − 136)` without half a step added: that is what was encoded where
//! the encoder rounds, and constant maps stay constant.

mod encode;
mod header;
mod scanline;

pub use encode::encode;

use crate::{
    Bulk, Cancel, Cancelled, DecodeError, Decoded, Image, Limits,
    colour::{self, Gamut},
    decode::{Source, check_size},
};
use header::{Axis, Header, Orientation, PixelFormat};
use scanline::{Reader, line_bytes_min};

/// The format's name in messages.
pub(crate) const FORMAT: &str = "Radiance HDR";

/// Lumens per watt of white light, the constant Radiance puts between XYZE (luminance) and RGBE (radiance).
const WHITE_EFFICACY: f64 = 179.0;

/// Decodes a Radiance picture.
///
/// RGBE and XYZE, flat and both run-length forms, all eight orientations. EXPOSURE and COLORCORR are
/// undone, PRIMARIES converted to Rec. 709 (all-zero, as Photoshop writes it, means absent), PIXASPECT
/// and GAMMA noted (of an environment, whole multiples of PIXASPECT are undone). XYZE is divided by Radiance's 179 lm/W, so that a picture has the same values in
/// either form.
///
/// # Errors
/// [`DecodeError`] with header line, row and byte; [`DecodeError::Cancelled`] within a row's work.
pub fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Decoded, DecodeError> {
    decode_source(bytes, limits, cancel)?.into_decoded()
}

/// [`decode`], with the shape of texels and the colour space they were stored in.
pub(crate) fn decode_source(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    let header = header::parse(bytes)?;
    let orientation = header.orientation;
    let (width, height) = orientation.image_size();
    check_size(FORMAT, width, height, limits)?;
    let stored = read_scanlines(bytes, &header, cancel)?;
    let mut rgb = orientation.upright(stored, cancel)?;
    let mut notes = header.notes.clone();
    undo_exposure(&header, &mut rgb, &mut notes, cancel)?;
    let gamut = convert_colour(&header, &mut rgb, &mut notes, cancel)?;
    let image = Image::new(width, height, rgb.into_inner())?;
    Ok(Source { gamut, texel_aspect: header.texel_aspect, ..Source::flat(FORMAT, image, notes) })
}

/// Reads in file order. Memory grows with what the bytes yield, not with what the header claims, unless the bytes are
/// enough for the claim: growing means copying, which cannot be interrupted.
fn read_scanlines(bytes: &[u8], header: &Header, cancel: Cancel) -> Result<Bulk<Vec<f32>>, DecodeError> {
    let Orientation { slow, fast, .. } = header.orientation;
    let scale = exponent_scale();
    let mut reader = Reader::new(bytes, header.pixels_start);
    let mut line = vec![[0_u8; 4]; fast.length];
    let has_enough =
        bytes.len() - header.pixels_start >= slow.length.saturating_mul(line_bytes_min(fast.length));
    let value_count = if has_enough { slow.length * fast.length * 3 } else { 0 };
    let mut rgb = Bulk::new(Vec::with_capacity(value_count));
    for row in 0..slow.length {
        cancel.check()?;
        reader.read_line(row, &mut line)?;
        rgb.extend(line.iter().flat_map(|&[r, g, b, e]| {
            let scale = scale[usize::from(e)];
            [f32::from(r) * scale, f32::from(g) * scale, f32::from(b) * scale]
        }));
    }
    Ok(rgb)
}

/// 2^(e − 136) for each exponent byte, exact in binary32 (the small ones are subnormal); 0 for e = 0.
fn exponent_scale() -> [f32; 256] {
    std::array::from_fn(|e| if e == 0 { 0.0 } else { libm::ldexp(1.0, e as i32 - 136) as f32 })
}

fn undo_exposure(
    header: &Header,
    rgb: &mut [f32],
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<(), Cancelled> {
    let factor = header.colour_correction.map(|correction| 1.0 / (header.exposure * correction));
    if factor == [1.0; 3] {
        return Ok(());
    }
    notes.push(format!(
        "EXPOSURE {} and COLORCORR {:?} were undone",
        header.exposure, header.colour_correction
    ));
    colour::change_texels(rgb, |[r, g, b]| [r * factor[0], g * factor[1], b * factor[2]], cancel)
}

fn convert_colour(
    header: &Header,
    rgb: &mut [f32],
    notes: &mut Vec<String>,
    cancel: Cancel,
) -> Result<Option<Gamut>, DecodeError> {
    let (source, divisor) = match (header.pixel_format, header.primaries) {
        (PixelFormat::Xyze, _) => {
            notes.push(
                "XYZ was converted to Rec. 709, equal-energy white adapted to D65, 179 lm/W".to_owned(),
            );
            (colour::CIE_XYZ, WHITE_EFFICACY)
        }
        (PixelFormat::Rgbe, None) => return Ok(None),
        (PixelFormat::Rgbe, Some(primaries)) if primaries.is_close_to(colour::REC_709) => return Ok(None),
        (PixelFormat::Rgbe, Some(primaries)) => {
            notes.push(format!("PRIMARIES {:?} were converted to Rec. 709", primaries.to_array()));
            (primaries, 1.0)
        }
    };
    let no_space = || DecodeError::Invalid {
        format: FORMAT,
        place: "PRIMARIES".to_owned(),
        reason: format!("{:?} span no colour space", source.to_array()),
    };
    let matrix = colour::to_rec_709(source).ok_or_else(no_space)?.map(|row| row.map(|value| value / divisor));
    colour::transform_texels(&matrix, rgb, cancel)?;
    Ok(Some(Gamut::new(matrix).ok_or_else(no_space)?))
}

impl Orientation {
    /// Columns and rows of the upright image.
    fn image_size(self) -> (usize, usize) {
        if self.is_transposed {
            (self.slow.length, self.fast.length)
        } else {
            (self.fast.length, self.slow.length)
        }
    }

    /// Reorders texels from file order to rows from the top, columns from the left.
    fn upright(self, stored: Bulk<Vec<f32>>, cancel: Cancel) -> Result<Bulk<Vec<f32>>, Cancelled> {
        let (width, height) = self.image_size();
        let (x_axis, y_axis) =
            if self.is_transposed { (self.slow, self.fast) } else { (self.fast, self.slow) };
        if !self.is_transposed && !x_axis.is_reversed && !y_axis.is_reversed {
            return Ok(stored);
        }
        let stored: &[f32] = &stored;
        let mut rgb = Bulk::new(Vec::with_capacity(stored.len()));
        for y in 0..height {
            cancel.check()?;
            let rgb: &mut Vec<f32> = &mut rgb;
            for x in 0..width {
                let (u, v) = (x_axis.stored_index(x), y_axis.stored_index(y));
                let index = if self.is_transposed { u * height + v } else { v * width + u };
                rgb.extend_from_slice(&stored[3 * index..3 * index + 3]);
            }
        }
        Ok(rgb)
    }
}

impl Axis {
    fn stored_index(self, index: usize) -> usize {
        if self.is_reversed { self.length - 1 - index } else { index }
    }
}
