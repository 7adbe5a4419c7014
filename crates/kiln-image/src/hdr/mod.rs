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

use crate::{DecodeError, Decoded, Image, Limits, colour, decode::check_size};
use header::{Axis, Header, Orientation, PixelFormat};
use scanline::Reader;

/// The format's name in messages.
pub(crate) const FORMAT: &str = "Radiance HDR";

/// Lumens per watt of white light, the constant Radiance puts between XYZE (luminance) and RGBE (radiance).
const WHITE_EFFICACY: f64 = 179.0;

/// Decodes a Radiance picture.
///
/// RGBE and XYZE, flat and both run-length forms, all eight orientations. EXPOSURE and COLORCORR are
/// undone, PRIMARIES converted to Rec. 709 (all-zero, as Photoshop writes it, means absent), PIXASPECT
/// and GAMMA noted. XYZE is divided by Radiance's 179 lm/W, so that a picture has the same values in
/// either form.
///
/// # Errors
/// [`DecodeError`] with header line, row and byte.
pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Decoded, DecodeError> {
    let header = header::parse(bytes)?;
    let orientation = header.orientation;
    let (width, height) = orientation.image_size();
    check_size(FORMAT, width, height, limits)?;
    let stored = read_scanlines(bytes, &header)?;
    let mut rgb = orientation.upright(stored);
    let mut notes = header.notes.clone();
    undo_exposure(&header, &mut rgb, &mut notes);
    convert_colour(&header, &mut rgb, &mut notes)?;
    Ok(Decoded { image: Image::new(width, height, rgb)?, format: FORMAT, notes })
}

/// Reads in file order. Memory grows with what the bytes yield, not with what the header claims.
fn read_scanlines(bytes: &[u8], header: &Header) -> Result<Vec<f32>, DecodeError> {
    let Orientation { slow, fast, .. } = header.orientation;
    let scale = exponent_scale();
    let mut reader = Reader::new(bytes, header.pixels_start);
    let mut line = vec![[0_u8; 4]; fast.length];
    let mut rgb = Vec::new();
    for row in 0..slow.length {
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

fn undo_exposure(header: &Header, rgb: &mut [f32], notes: &mut Vec<String>) {
    let factor = header.colour_correction.map(|correction| 1.0 / (header.exposure * correction));
    if factor == [1.0; 3] {
        return;
    }
    notes.push(format!(
        "EXPOSURE {} and COLORCORR {:?} were undone",
        header.exposure, header.colour_correction
    ));
    for texel in rgb.chunks_exact_mut(3) {
        for (value, factor) in texel.iter_mut().zip(factor) {
            *value = (f64::from(*value) * factor) as f32;
        }
    }
}

fn convert_colour(header: &Header, rgb: &mut [f32], notes: &mut Vec<String>) -> Result<(), DecodeError> {
    let (source, divisor) = match (header.pixel_format, header.primaries) {
        (PixelFormat::Xyze, _) => {
            notes.push(
                "XYZ was converted to Rec. 709, equal-energy white adapted to D65, 179 lm/W".to_owned(),
            );
            (colour::CIE_XYZ, WHITE_EFFICACY)
        }
        (PixelFormat::Rgbe, None) => return Ok(()),
        (PixelFormat::Rgbe, Some(primaries)) if primaries.is_close_to(colour::REC_709) => return Ok(()),
        (PixelFormat::Rgbe, Some(primaries)) => {
            notes.push(format!("PRIMARIES {:?} were converted to Rec. 709", primaries.to_array()));
            (primaries, 1.0)
        }
    };
    let matrix = colour::to_rec_709(source).ok_or_else(|| DecodeError::Invalid {
        format: FORMAT,
        place: "PRIMARIES".to_owned(),
        reason: format!("{:?} span no colour space", source.to_array()),
    })?;
    colour::transform_texels(&matrix.map(|row| row.map(|value| value / divisor)), rgb);
    Ok(())
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
    fn upright(self, stored: Vec<f32>) -> Vec<f32> {
        let (width, height) = self.image_size();
        let (x_axis, y_axis) =
            if self.is_transposed { (self.slow, self.fast) } else { (self.fast, self.slow) };
        if !self.is_transposed && !x_axis.is_reversed && !y_axis.is_reversed {
            return stored;
        }
        let mut rgb = Vec::with_capacity(stored.len());
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (x_axis.stored_index(x), y_axis.stored_index(y));
                let index = if self.is_transposed { u * height + v } else { v * width + u };
                rgb.extend_from_slice(&stored[3 * index..3 * index + 3]);
            }
        }
        rgb
    }
}

impl Axis {
    fn stored_index(self, index: usize) -> usize {
        if self.is_reversed { self.length - 1 - index } else { index }
    }
}
