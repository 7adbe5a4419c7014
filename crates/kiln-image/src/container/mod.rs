//! Texture containers of GPUs as sources: KTX2, KTX1 and DDS; level 0 of a cube or of a 2D texture.
//!
//! Only what can hold radiance is read, and 8-bit colour with a warning; arrays, volumes and other block compression are
//! refused by name. Nothing is allocated before the bytes for it have been seen.

pub(crate) mod dds;
pub(crate) mod ktx1;
pub(crate) mod ktx2;
mod texel;

use crate::{
    Bulk, Cancel, Cube, DecodeError, Image, Limits,
    colour::{self, Gamut},
    decode::{Source, Stored, check_size, too_large},
};
use texel::TexelFormat;

/// Level 0 of a container, located.
struct Texture<'a> {
    /// The container's name.
    format: &'static str,
    texel: TexelFormat,
    width: usize,
    height: usize,
    /// One image, or six in KTX2 order.
    faces: Vec<&'a [u8]>,
    /// A row is followed by so many bytes of padding.
    row_padding: usize,
    /// Bytes of a number, where they stand in the other order than little-endian.
    swap_bytes: usize,
    /// Row 0 is the bottom (of a 2D texture).
    is_bottom_up: bool,
    /// For each of R, G, B the stored channel, or a constant.
    swizzle: [Swizzle; 3],
    level_count: usize,
    notes: Vec<String>,
}

/// Where a colour comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Swizzle {
    Channel(usize),
    Zero,
    One,
}

const IDENTITY: [Swizzle; 3] = [Swizzle::Channel(0), Swizzle::Channel(1), Swizzle::Channel(2)];

/// Refuses sizes over the limits; the six faces count together.
fn check_texture_size(
    format: &'static str,
    width: usize,
    height: usize,
    faces: usize,
    limits: &Limits,
) -> Result<(), DecodeError> {
    check_size(format, width, height, limits)?;
    let texels = width.saturating_mul(height).saturating_mul(faces);
    if texels > limits.texels_max {
        return Err(too_large(format, "the number of texels", texels, limits.texels_max));
    }
    Ok(())
}

impl Texture<'_> {
    /// Texels from bytes.
    fn decode(mut self, cancel: Cancel) -> Result<Source, DecodeError> {
        if self.level_count > 1 {
            self.notes.push(format!("level 0 of {} was read; the others are made again", self.level_count));
        }
        self.notes.extend(self.texel.note());
        let mut rgb = Bulk::new(Vec::with_capacity(self.faces.len() * self.width * self.height * 3));
        for face in &self.faces {
            self.decode_face(face, &mut rgb, cancel)?;
        }
        if self.swizzle != IDENTITY {
            self.notes.push("channels were exchanged as KTXswizzle says".to_owned());
            let pick = |texel: [f64; 3]| {
                self.swizzle.map(|source| match source {
                    Swizzle::Channel(channel) => texel[channel],
                    Swizzle::Zero => 0.0,
                    Swizzle::One => 1.0,
                })
            };
            colour::change_texels(&mut rgb, pick, cancel)?;
        }
        let rgb = rgb.into_inner();
        let texels = if self.faces.len() == 6 {
            Stored::Cube(Cube::new(self.width, rgb)?)
        } else {
            Stored::Flat(Image::new(self.width, self.height, rgb)?)
        };
        let Texture { format, notes, .. } = self;
        Ok(Source { format, texels, notes, gamut: None, texel_aspect: 1.0, declared: None })
    }

    fn decode_face(&self, bytes: &[u8], rgb: &mut Vec<f32>, cancel: Cancel) -> Result<(), DecodeError> {
        let start = rgb.len();
        if self.texel.is_block() {
            return Ok(self.texel.decode_blocks(bytes, self.width, self.height, rgb, cancel)?);
        }
        let row_bytes = self.width * self.texel.texel_bytes();
        let mut swapped = Vec::new();
        for row in bytes.chunks(row_bytes + self.row_padding).take(self.height) {
            cancel.check()?;
            let mut row = &row[..row_bytes];
            if self.swap_bytes > 1 {
                swapped.clear();
                swapped.extend_from_slice(row);
                swapped.chunks_exact_mut(self.swap_bytes).for_each(<[u8]>::reverse);
                row = &swapped;
            }
            self.texel.decode_row(row, rgb);
        }
        if self.is_bottom_up && self.faces.len() == 1 {
            let stride = self.width * 3;
            for y in 0..self.height / 2 {
                cancel.check()?;
                let (top, bottom) = (start + y * stride, start + (self.height - 1 - y) * stride);
                let (upper, lower) = rgb.split_at_mut(bottom);
                upper[top..top + stride].swap_with_slice(&mut lower[..stride]);
            }
        }
        Ok(())
    }
}

/// Converts a decoded texture from the primaries its container names.
fn convert_primaries(
    source: &mut Source,
    primaries: colour::Chromaticities,
    cancel: Cancel,
) -> Result<(), DecodeError> {
    let matrix = colour::to_rec_709(primaries).and_then(|matrix| Some((matrix, Gamut::new(matrix)?)));
    let (matrix, gamut) = matrix.ok_or_else(|| DecodeError::Invalid {
        format: source.format,
        place: "colour primaries".to_owned(),
        reason: "they span no colour space".to_owned(),
    })?;
    let rgb = match &mut source.texels {
        Stored::Flat(image) => &mut image.rgb,
        Stored::Cube(cube) => &mut cube.rgb,
    };
    colour::transform_texels(&matrix, rgb, cancel)?;
    source.gamut = Some(gamut);
    source.notes.push(format!("primaries {:?} were converted to Rec. 709", primaries.to_array()));
    Ok(())
}
