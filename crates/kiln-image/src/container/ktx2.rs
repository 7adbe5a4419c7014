//! KTX 2.0 as a source.
//!
//! Source: Khronos "KTX File Format Specification, Version 2.0".

use super::{IDENTITY, Swizzle, Texture, check_texture_size, convert_primaries, texel::TexelFormat};
use crate::{
    Cancel, DecodeError, Limits,
    colour::{self, Chromaticities},
    decode::{Source, guard, too_large},
    ktx2::{self, Header, KtxError},
};

/// The format's name in messages.
const FORMAT: &str = "KTX2";

/// Decodes level 0 of a cube or of a 2D texture.
pub(crate) fn decode(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    guard(FORMAT, || decode_unguarded(bytes, limits, cancel))
}

fn decode_unguarded(bytes: &[u8], limits: &Limits, cancel: Cancel) -> Result<Source, DecodeError> {
    let header = ktx2::read_header(bytes).map_err(explain)?;
    let texel = texel_format(header.vk_format).map_err(unsupported)?;
    let (width, height) = (header.width as usize, header.height as usize);
    check_kind(&header)?;
    let faces = header.faces as usize;
    check_texture_size(FORMAT, width, height, faces, limits)?;
    let image_bytes = texel.image_bytes(width, height, 1);
    let expected = image_bytes.and_then(|bytes| bytes.checked_mul(faces));
    let expected =
        expected.ok_or_else(|| too_large(FORMAT, "the size of level 0", usize::MAX, isize::MAX as usize))?;
    let level = ktx2::level_bytes(bytes, &header, 0, expected).map_err(explain)?;
    cancel.check()?;

    let key_values = ktx2::key_values(bytes, &header).map_err(explain)?;
    let value = |key: &str| key_values.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str());
    let mut notes = Vec::new();
    let is_bottom_up =
        faces == 1 && value("KTXorientation").is_some_and(|value| value.as_bytes().get(1) == Some(&b'u'));
    if is_bottom_up {
        notes.push("rows were stored from the bottom".to_owned());
    }
    let texture = Texture {
        format: FORMAT,
        texel,
        width,
        height,
        faces: level.chunks_exact(expected / faces).collect(),
        row_padding: 0,
        swap_bytes: 1,
        is_bottom_up,
        swizzle: value("KTXswizzle").map_or(Ok(IDENTITY), parse_swizzle)?,
        level_count: header.level_count.max(1) as usize,
        notes,
    };
    let mut source = texture.decode(cancel)?;
    match primaries(bytes, &header) {
        Primaries::Rec709 => {}
        Primaries::Other(space) => convert_primaries(&mut source, space, cancel)?,
        Primaries::Unknown(number) => {
            source.notes.push(format!("colour primaries {number} are not known here; taken as Rec. 709"));
        }
    }
    Ok(source)
}

fn check_kind(header: &Header) -> Result<(), DecodeError> {
    let kind = match header {
        Header { depth: 2.., .. } => "a volume",
        Header { height: 0, .. } => "a 1D texture",
        Header { layers: 2.., .. } => "an array",
        Header { faces: 6, width, height, .. } if width == height => return Ok(()),
        Header { faces: 1, .. } => return Ok(()),
        Header { faces: 6, .. } => "a cube whose faces are no squares",
        _ => "a texture with neither one nor six faces",
    };
    Err(unsupported(format!("{kind}; a cube or a 2D texture is read")))
}

/// The texel format, or the name of what is not read.
fn texel_format(vk_format: u32) -> Result<TexelFormat, String> {
    let unorm8 = |channels, is_bgr, is_srgb| TexelFormat::Unorm8 { channels, is_bgr, is_srgb };
    let name = match vk_format {
        9 => return Ok(unorm8(1, false, false)),
        15 => return Ok(unorm8(1, false, true)),
        16 => return Ok(unorm8(2, false, false)),
        22 => return Ok(unorm8(2, false, true)),
        23 | 29 => return Ok(unorm8(3, false, vk_format == 29)),
        30 | 36 => return Ok(unorm8(3, true, vk_format == 36)),
        37 | 43 => return Ok(unorm8(4, false, vk_format == 43)),
        44 | 50 => return Ok(unorm8(4, true, vk_format == 50)),
        76 | 83 | 90 | 97 => return Ok(TexelFormat::Half { channels: 1 + (vk_format as usize - 76) / 7 }),
        100 | 103 | 106 | 109 => {
            return Ok(TexelFormat::Float { channels: 1 + (vk_format as usize - 100) / 3 });
        }
        122 => return Ok(TexelFormat::B10G11R11),
        123 => return Ok(TexelFormat::Rgb9E5),
        143 | 144 => return Ok(TexelFormat::Bc6h { is_signed: vk_format == 144 }),
        0 => "Basis Universal or a format Vulkan does not know",
        124..=130 => "depth or stencil",
        131..=142 | 145 | 146 => "BC1 to BC5 or BC7",
        147..=156 => "ETC2 or EAC",
        157..=184 | 1_000_066_000..=1_000_066_013 | 1_000_288_000..=1_000_288_029 => "ASTC",
        1_000_054_000..=1_000_054_007 => "PVRTC",
        _ => "an integer or packed format",
    };
    Err(format!(
        "VkFormat {vk_format} ({name}) is not read; 16- and 32-bit float, RGB9E5, B10G11R11, BC6H and 8-bit colour are"
    ))
}

/// `KTXswizzle`: four of r, g, b, a, 0 and 1.
fn parse_swizzle(value: &str) -> Result<[Swizzle; 3], DecodeError> {
    let letter = |letter: u8| match letter {
        b'r' => Some(Swizzle::Channel(0)),
        b'g' => Some(Swizzle::Channel(1)),
        b'b' => Some(Swizzle::Channel(2)),
        b'0' => Some(Swizzle::Zero),
        b'1' => Some(Swizzle::One),
        _ => None,
    };
    match value.as_bytes() {
        [r, g, b, _] => match (letter(*r), letter(*g), letter(*b)) {
            (Some(r), Some(g), Some(b)) => Ok([r, g, b]),
            _ => Err(unsupported(format!(
                "KTXswizzle {value:?} is not read: colour comes from r, g, b, 0 and 1"
            ))),
        },
        _ => Err(invalid("KTXswizzle", format!("{value:?} has not four letters"))),
    }
}

enum Primaries {
    Rec709,
    Other(Chromaticities),
    Unknown(u8),
}

/// The primaries of the basic data format descriptor (Khronos Data Format Specification 1.3, table 17); what cannot be
/// found there is Rec. 709, as most writers assume.
fn primaries(bytes: &[u8], header: &Header) -> Primaries {
    const PRIMARIES_OFFSET: usize = 13;
    let chromaticities = |xy: [f64; 8]| Primaries::Other(Chromaticities::from_array(xy));
    match bytes.get(header.descriptor_start as usize..).and_then(|rest| rest.get(PRIMARIES_OFFSET)) {
        None | Some(0 | 1) => Primaries::Rec709,
        Some(4) => chromaticities([0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290]), // BT.2020
        Some(5) => Primaries::Other(colour::CIE_XYZ),
        Some(6) => chromaticities([0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767]), // ACES AP0
        Some(7) => chromaticities([0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767]),  // ACES AP1
        Some(10) => chromaticities([0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290]), // Display P3
        Some(11) => chromaticities([0.640, 0.330, 0.210, 0.710, 0.150, 0.060, 0.3127, 0.3290]), // Adobe RGB
        Some(&number) => Primaries::Unknown(number),
    }
}

fn explain(error: KtxError) -> DecodeError {
    match error {
        KtxError::Truncated { what, end } => {
            DecodeError::Truncated { format: FORMAT, what: what.to_owned(), byte: end }
        }
        KtxError::Unsupported { .. } | KtxError::Format(_) => unsupported(error.to_string()),
        KtxError::Layout(error) => error.into(),
        other => invalid("file", other.to_string()),
    }
}

fn unsupported(reason: String) -> DecodeError {
    DecodeError::Unsupported { format: FORMAT, reason }
}

fn invalid(place: &str, reason: String) -> DecodeError {
    DecodeError::Invalid { format: FORMAT, place: place.to_owned(), reason }
}
