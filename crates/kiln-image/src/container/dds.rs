//! DirectDraw surfaces as a source, with the DX10 header and without.
//!
//! Source: Microsoft, "DDS_HEADER", "DDS_PIXELFORMAT", "DDS_HEADER_DXT10", "DXGI_FORMAT enumeration" and "Programming Guide for
//! DDS". Faces are stored one after the other, each with all its levels, in the order and orientation of KTX2.

use super::{IDENTITY, Texture, check_texture_size, texel::TexelFormat};
use crate::{
    Cancel, DecodeError, Limits,
    decode::{Source, guard, too_large},
};

/// The format's name in messages.
const FORMAT: &str = "DDS";
/// Magic and header.
const HEADER_BYTES: usize = 128;
/// What follows where the four characters are `DX10`.
const DX10_BYTES: usize = 20;
const LEVELS_MAX: u32 = 32;

const PIXEL_FORMAT_FOUR_CC: u32 = 0x4;
const PIXEL_FORMAT_RGB: u32 = 0x40;
const CAPS2_CUBE: u32 = 0x200;
const CAPS2_ALL_FACES: u32 = 0xfc00;
const CAPS2_VOLUME: u32 = 0x20_0000;

/// Decodes level 0 of a cube or of a 2D texture.
pub(crate) fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    guard(FORMAT, || decode_unguarded(bytes, limits, cancel))
}

fn decode_unguarded(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    let truncated =
        |what: &str| DecodeError::Truncated { format: FORMAT, what: what.to_owned(), byte: bytes.len() };
    let words = bytes.get(..HEADER_BYTES).ok_or_else(|| truncated("the header"))?.as_chunks::<4>().0;
    let word = |index: usize| u32::from_le_bytes(words[index]);
    for (what, index, wanted) in [("the header's size", 1, 124), ("the pixel format's size", 19, 32)] {
        // Some writers leave them 0.
        if word(index) != wanted && word(index) != 0 {
            return Err(invalid(what, format!("it is {}, not {wanted}", word(index))));
        }
    }
    let (width, height) = (word(4) as usize, word(3) as usize);
    let caps2 = word(28);
    let is_dx10 = word(20) & PIXEL_FORMAT_FOUR_CC != 0 && words[21] == *b"DX10";
    let (texel, is_cube, data_start) = if is_dx10 {
        let rest =
            bytes.get(HEADER_BYTES..HEADER_BYTES + DX10_BYTES).ok_or_else(|| truncated("the DX10 header"))?;
        let numbers = rest.as_chunks::<4>().0;
        let (texel, is_cube) = read_dx10(|index| u32::from_le_bytes(numbers[index]))?;
        (texel, is_cube, HEADER_BYTES + DX10_BYTES)
    } else {
        (legacy_format(word, words[21])?, caps2 & CAPS2_CUBE != 0, HEADER_BYTES)
    };
    if caps2 & CAPS2_VOLUME != 0 {
        return Err(unsupported("a volume; a cube or a 2D texture is read".to_owned()));
    }
    if is_cube && !is_dx10 && caps2 & CAPS2_ALL_FACES != CAPS2_ALL_FACES {
        let count = (caps2 & CAPS2_ALL_FACES).count_ones();
        return Err(unsupported(format!("a cube with {count} of six faces")));
    }
    if is_cube && width != height {
        return Err(invalid("the header", format!("a cube's face of {width} × {height} is no square")));
    }
    let face_count = if is_cube { 6 } else { 1 };
    check_texture_size(FORMAT, width, height, face_count, limits)?;
    let level_count = word(7).max(1);
    if level_count > LEVELS_MAX {
        return Err(invalid("the header", format!("{level_count} levels are too many")));
    }
    let image_bytes = |level: u32| {
        let side = |length: usize| length.checked_shr(level).unwrap_or(0).max(1);
        texel.image_bytes(side(width), side(height), 1)
    };
    let face_bytes = (0..level_count).try_fold(0_usize, |sum, level| sum.checked_add(image_bytes(level)?));
    let (Some(level_0), Some(face_bytes)) = (image_bytes(0), face_bytes) else {
        return Err(too_large(FORMAT, "the size of a face", usize::MAX, isize::MAX as usize));
    };
    let faces = (0..face_count)
        .map(|face| {
            let start = face_bytes.checked_mul(face)?.checked_add(data_start)?;
            bytes.get(start..start.checked_add(level_0)?)
        })
        .collect::<Option<Vec<&[u8]>>>()
        .ok_or_else(|| truncated("the texels"))?;
    let texture = Texture {
        format: FORMAT,
        texel,
        width,
        height,
        faces,
        row_padding: 0,
        swap_bytes: 1,
        is_bottom_up: false,
        swizzle: IDENTITY,
        level_count: level_count as usize,
        notes: Vec::new(),
    };
    texture.decode(cancel)
}

/// Texel format, and whether it is a cube.
fn read_dx10(word: impl Fn(usize) -> u32) -> Result<(TexelFormat, bool), DecodeError> {
    const DIMENSION_2D: u32 = 3;
    const MISC_CUBE: u32 = 4;
    let unorm8 = |channels, is_bgr, is_srgb| TexelFormat::Unorm8 { channels, is_bgr, is_srgb };
    let texel = match word(0) {
        2 => TexelFormat::Float { channels: 4 },
        6 => TexelFormat::Float { channels: 3 },
        10 => TexelFormat::Half { channels: 4 },
        16 => TexelFormat::Float { channels: 2 },
        26 => TexelFormat::B10G11R11,
        28 => unorm8(4, false, false),
        29 => unorm8(4, false, true),
        34 => TexelFormat::Half { channels: 2 },
        41 => TexelFormat::Float { channels: 1 },
        49 => unorm8(2, false, false),
        54 => TexelFormat::Half { channels: 1 },
        61 => unorm8(1, false, false),
        67 => TexelFormat::Rgb9E5,
        87 | 88 => unorm8(4, true, false),
        91 | 93 => unorm8(4, true, true),
        95 => TexelFormat::Bc6h { is_signed: false },
        96 => TexelFormat::Bc6h { is_signed: true },
        other => {
            return Err(unsupported(format!(
                "DXGI format {other} is not read; 16- and 32-bit float, R9G9B9E5, R11G11B10, BC6H and 8-bit colour are"
            )));
        }
    };
    if word(1) != DIMENSION_2D {
        return Err(unsupported(format!("resource dimension {} is not read; 2D (3) is", word(1))));
    }
    if word(3) > 1 {
        return Err(unsupported(format!("an array of {}; a cube or a 2D texture is read", word(3))));
    }
    Ok((texel, word(2) & MISC_CUBE != 0))
}

/// The formats of Direct3D 9: numbers in place of four characters, or bit masks.
fn legacy_format(word: impl Fn(usize) -> u32, four_cc: [u8; 4]) -> Result<TexelFormat, DecodeError> {
    let flags = word(20);
    if flags & PIXEL_FORMAT_FOUR_CC != 0 {
        return match word(21) {
            111 => Ok(TexelFormat::Half { channels: 1 }),
            112 => Ok(TexelFormat::Half { channels: 2 }),
            113 => Ok(TexelFormat::Half { channels: 4 }),
            114 => Ok(TexelFormat::Float { channels: 1 }),
            115 => Ok(TexelFormat::Float { channels: 2 }),
            116 => Ok(TexelFormat::Float { channels: 4 }),
            _ => {
                let name = four_cc.escape_ascii();
                Err(unsupported(format!(
                    "format \"{name}\" is not read; 16- and 32-bit float, BC6H (DX10) and 8-bit colour are"
                )))
            }
        };
    }
    let [bits, red, green, blue] = [22, 23, 24, 25].map(&word);
    let is_rgb = flags & PIXEL_FORMAT_RGB != 0 && green == 0xff00;
    match (is_rgb, bits, red, blue) {
        (true, 24 | 32, 0xff, 0xff_0000) => {
            Ok(TexelFormat::Unorm8 { channels: bits as usize / 8, is_bgr: false, is_srgb: false })
        }
        (true, 24 | 32, 0xff_0000, 0xff) => {
            Ok(TexelFormat::Unorm8 { channels: bits as usize / 8, is_bgr: true, is_srgb: false })
        }
        _ => Err(unsupported(format!(
            "{bits} bits with masks {red:#x}, {green:#x}, {blue:#x} are not read; 24- and 32-bit colour is"
        ))),
    }
}

fn unsupported(reason: String) -> DecodeError {
    DecodeError::Unsupported { format: FORMAT, reason }
}

fn invalid(place: &str, reason: String) -> DecodeError {
    DecodeError::Invalid { format: FORMAT, place: place.to_owned(), reason }
}
