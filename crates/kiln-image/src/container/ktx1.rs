//! KTX 1 as a source, of either byte order.
//!
//! Source: Khronos "KTX File Format Specification, version 1"; numbers of formats and types from the OpenGL registry.

use super::{IDENTITY, Texture, check_texture_size, texel::TexelFormat};
use crate::{
    Cancel, DecodeError, Limits,
    decode::{Source, guard, too_large},
    ktx1::IDENTIFIER,
};

/// The format's name in messages.
const FORMAT: &str = "KTX1";
/// Identifier and thirteen numbers.
const HEADER_BYTES: usize = 64;
/// Rows, faces and levels end at a multiple of it.
const ALIGNMENT: usize = 4;

/// Decodes level 0 of a cube or of a 2D texture.
pub(crate) fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    guard(FORMAT, || decode_unguarded(bytes, limits, cancel))
}

fn decode_unguarded(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    let truncated =
        |what: &str| DecodeError::Truncated { format: FORMAT, what: what.to_owned(), byte: bytes.len() };
    if !bytes.starts_with(&IDENTIFIER) {
        return Err(invalid("the identifier", "it is damaged".to_owned()));
    }
    let numbers = bytes.get(12..HEADER_BYTES).ok_or_else(|| truncated("the header"))?.as_chunks::<4>().0;
    let is_swapped = match numbers[0] {
        [1, 2, 3, 4] => false,
        [4, 3, 2, 1] => true,
        other => return Err(invalid("endianness", format!("it is {other:?}"))),
    };
    // Written as 0x04030201, so a little-endian file starts with 1.
    let read =
        |bytes: [u8; 4]| if is_swapped { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) };
    let word = |index: usize| read(numbers[index]);
    let gl = GlFormat { kind: word(1), format: word(3), internal: word(4) };
    let texel = gl.texel_format().ok_or_else(|| {
        unsupported(format!(
            "glType {:#06x}, glFormat {:#06x}, glInternalFormat {:#06x} is not read; 16- and 32-bit float, RGB9E5, \
             R11G11B10, BC6H and 8-bit colour are",
            gl.kind, gl.format, gl.internal
        ))
    })?;
    let (width, height, faces) = (word(6) as usize, word(7) as usize, word(10) as usize);
    let kind = match (word(8), word(7), word(9), word(10)) {
        (2.., ..) => Some("a volume"),
        (_, 0, ..) => Some("a 1D texture"),
        (_, _, 1.., _) => Some("an array"),
        (_, _, _, 6) if width != height => Some("a cube whose faces are no squares"),
        (_, _, _, 1 | 6) => None,
        _ => Some("a texture with neither one nor six faces"),
    };
    if let Some(kind) = kind {
        return Err(unsupported(format!("{kind}; a cube or a 2D texture is read")));
    }
    check_texture_size(FORMAT, width, height, faces, limits)?;

    let key_values_end = HEADER_BYTES.saturating_add(word(12) as usize);
    let key_values = bytes.get(HEADER_BYTES..key_values_end).ok_or_else(|| truncated("key/value data"))?;
    let data = &bytes[key_values_end..];
    let (stated, data) = data.split_first_chunk::<4>().ok_or_else(|| truncated("the size of level 0"))?;
    let alignment = if texel.is_block() { 1 } else { ALIGNMENT };
    let image_bytes = texel
        .image_bytes(width, height, alignment)
        .ok_or_else(|| too_large(FORMAT, "the size of level 0", usize::MAX, isize::MAX as usize))?;
    // One face's size, though some writers state that of all six.
    let stated = read(*stated) as usize;
    if stated != image_bytes && Some(stated) != image_bytes.checked_mul(faces) {
        return Err(invalid("level 0", format!("it has {stated} bytes, its size asks for {image_bytes}")));
    }
    let stride = image_bytes.next_multiple_of(ALIGNMENT);
    let faces = (0..faces)
        .map(|face| data.get(face * stride..face * stride + image_bytes))
        .collect::<Option<Vec<&[u8]>>>()
        .ok_or_else(|| truncated("level 0"))?;

    let mut notes = Vec::new();
    let is_bottom_up = faces.len() == 1 && states_bottom_up(key_values);
    if is_bottom_up {
        notes.push("rows were stored from the bottom".to_owned());
    }
    let padding = if texel.is_block() { 0 } else { image_bytes / height - width * texel.texel_bytes() };
    let texture = Texture {
        format: FORMAT,
        texel,
        width,
        height,
        faces,
        row_padding: padding,
        swap_bytes: if is_swapped { gl.type_bytes() } else { 1 },
        is_bottom_up,
        swizzle: IDENTITY,
        level_count: word(11).max(1) as usize,
        notes,
    };
    texture.decode(cancel)
}

/// `KTXorientation` with `T=u`; the metadata are few, and only this pair matters.
fn states_bottom_up(key_values: &[u8]) -> bool {
    const KEY: &[u8] = b"KTXorientation\0";
    let found = key_values.windows(KEY.len()).position(|window| window == KEY);
    found.is_some_and(|start| {
        let value = &key_values[start + KEY.len()..];
        value.iter().position(|&byte| byte == 0).map_or(value, |end| &value[..end]).ends_with(b"T=u")
    })
}

/// How OpenGL names a format: type and order of what is stored, and what the GPU makes of it.
struct GlFormat {
    kind: u32,
    format: u32,
    internal: u32,
}

impl GlFormat {
    fn texel_format(&self) -> Option<TexelFormat> {
        const GL_SRGB8: u32 = 0x8c41;
        const GL_SRGB8_ALPHA8: u32 = 0x8c43;
        if self.kind == 0 {
            // Compressed: type and format say nothing.
            return match self.internal {
                0x8e8e => Some(TexelFormat::Bc6h { is_signed: true }),
                0x8e8f => Some(TexelFormat::Bc6h { is_signed: false }),
                _ => None,
            };
        }
        let (channels, is_bgr) = match self.format {
            0x1903 => (1, false), // GL_RED
            0x8227 => (2, false), // GL_RG
            0x1907 => (3, false), // GL_RGB
            0x1908 => (4, false), // GL_RGBA
            0x80e0 => (3, true),  // GL_BGR
            0x80e1 => (4, true),  // GL_BGRA
            _ => return None,
        };
        match self.kind {
            0x1401 => {
                let is_srgb = [GL_SRGB8, GL_SRGB8_ALPHA8, 0x8c40, 0x8c42].contains(&self.internal);
                Some(TexelFormat::Unorm8 { channels, is_bgr, is_srgb })
            }
            0x140b | 0x8d61 if !is_bgr => Some(TexelFormat::Half { channels }),
            0x1406 if !is_bgr => Some(TexelFormat::Float { channels }),
            // The second is the internal format's number, which Filament's cmgen writes in its place.
            0x8c3b | 0x8c3a if channels == 3 && !is_bgr => Some(TexelFormat::B10G11R11),
            0x8c3e if channels == 3 && !is_bgr => Some(TexelFormat::Rgb9E5),
            _ => None,
        }
    }

    /// Bytes of the unit that byte order applies to; the file's own glTypeSize is not needed for it.
    fn type_bytes(&self) -> usize {
        match self.kind {
            0x140b | 0x8d61 => 2,
            0x1406 | 0x8c3a | 0x8c3b | 0x8c3e => 4,
            _ => 1,
        }
    }
}

fn unsupported(reason: String) -> DecodeError {
    DecodeError::Unsupported { format: FORMAT, reason }
}

fn invalid(place: &str, reason: String) -> DecodeError {
    DecodeError::Invalid { format: FORMAT, place: place.to_owned(), reason }
}
