//! KTX 1 containers of cubes, written for engines that read nothing newer.
//!
//! Source: Khronos "KTX File Format Specification", version 1 ("KTX 11"), sections 2.1 to 2.18; the numbers are those
//! of OpenGL. A reader of one's own stands in the tests.

use crate::ktx2;

/// First twelve bytes of each file.
pub const IDENTIFIER: [u8; 12] = [0xab, b'K', b'T', b'X', b' ', b'1', b'1', 0xbb, b'\r', b'\n', 0x1a, b'\n'];

const ENDIANNESS: u32 = 0x0403_0201;
const GL_RGB: u32 = 0x1907;
const GL_RGBA: u32 = 0x1908;
const GL_HALF_FLOAT: u32 = 0x140b;
const GL_FLOAT: u32 = 0x1406;
const GL_RGB16F: u32 = 0x881b;
const GL_RGBA16F: u32 = 0x881a;
const GL_RGBA32F: u32 = 0x8814;
const GL_R11F_G11F_B10F: u32 = 0x8c3a;
const GL_UNSIGNED_INT_10F_11F_11F_REV: u32 = 0x8c3b;

/// Texel formats, under OpenGL's names for the internal format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// `R11F_G11F_B10F` as the specification has it: `glType` is `UNSIGNED_INT_10F_11F_11F_REV`.
    R11fG11fB10f,
    /// The same texels with `glType` = `R11F_G11F_B10F`, which is what Filament's cmgen writes and the only number
    /// Filament's `ktxreader::Ktx1Reader` takes for packed texels (google/filament, libs/ktxreader/src/Ktx1Reader.cpp,
    /// `toPixelDataType`).
    R11fG11fB10fFilament,
    /// `RGB16F`: three binary16 channels.
    Rgb16f,
    /// `RGBA16F`: four binary16 channels.
    Rgba16f,
    /// `RGBA32F`: four binary32 channels.
    Rgba32f,
}

impl Format {
    /// The KTX 2 format with the same texels, and therefore the codec.
    pub fn texels(self) -> ktx2::Format {
        match self {
            Format::R11fG11fB10f | Format::R11fG11fB10fFilament => ktx2::Format::B10G11R11_UFLOAT_PACK32,
            Format::Rgb16f => ktx2::Format::R16G16B16_SFLOAT,
            Format::Rgba16f => ktx2::Format::R16G16B16A16_SFLOAT,
            Format::Rgba32f => ktx2::Format::R32G32B32A32_SFLOAT,
        }
    }

    /// glType, glFormat (also glBaseInternalFormat), glInternalFormat.
    fn numbers(self) -> [u32; 3] {
        match self {
            Format::R11fG11fB10f => [GL_UNSIGNED_INT_10F_11F_11F_REV, GL_RGB, GL_R11F_G11F_B10F],
            Format::R11fG11fB10fFilament => [GL_R11F_G11F_B10F, GL_RGB, GL_R11F_G11F_B10F],
            Format::Rgb16f => [GL_HALF_FLOAT, GL_RGB, GL_RGB16F],
            Format::Rgba16f => [GL_HALF_FLOAT, GL_RGBA, GL_RGBA16F],
            Format::Rgba32f => [GL_FLOAT, GL_RGBA, GL_RGBA32F],
        }
    }
}

/// A cube to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cube<'a> {
    /// Texel format.
    pub format: Format,
    /// Texels along an edge of level 0.
    pub face_size: usize,
    /// Level 0 first; six faces concatenated in the order +X −X +Y −Y +Z −Z, rows from the top.
    pub levels: Vec<&'a [u8]>,
    /// Key/value pairs in file order; values get a NUL at the end.
    pub key_values: Vec<(String, String)>,
}

/// Writes the container, little-endian.
///
/// Rows of `Rgb16f` are padded to four bytes each (`GL_UNPACK_ALIGNMENT` 4), other formats need no padding.
///
/// # Panics
/// Where a level's bytes do not fit its size, or there is no level or more than there are sizes.
pub fn write_cube(cube: &Cube) -> Vec<u8> {
    let &Cube { format, face_size, ref levels, .. } = cube;
    let texels = format.texels();
    assert!(!levels.is_empty() && face_size > 0, "a cube has a size and a level");
    assert!(levels.len() <= (face_size.ilog2() + 1) as usize, "{} levels are too many", levels.len());
    let pairs = key_value_data(&cube.key_values);
    let [gl_type, gl_format, internal_format] = format.numbers();
    let size = face_size as u32;
    let header = [
        ENDIANNESS,
        gl_type,
        texels.type_size() as u32,
        gl_format,
        internal_format,
        gl_format,
        size,
        size,
        0, // depth: no 3D texture
        0, // no array
        6,
        levels.len() as u32,
        pairs.len() as u32,
    ];
    let mut out = IDENTIFIER.to_vec();
    header.into_iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
    out.extend_from_slice(&pairs);
    for (index, level) in levels.iter().enumerate() {
        let side = (face_size >> index).max(1);
        assert_eq!(
            Some(level.len()),
            texels.level_bytes(face_size, face_size, 6, index),
            "bytes of level {index}"
        );
        let row_bytes = side * texels.block_bytes();
        let padded_row = row_bytes.next_multiple_of(4);
        // For a cube that is no array the size is that of one face.
        out.extend_from_slice(&((side * padded_row) as u32).to_le_bytes());
        for row in level.chunks(row_bytes) {
            out.extend_from_slice(row);
            out.resize(out.len() + padded_row - row_bytes, 0);
        }
    }
    out
}

/// Each pair is length, key, NUL, value, NUL, padding to 4: in KTX1 and KTX2 alike.
pub(crate) fn key_value_data(pairs: &[(String, String)]) -> Vec<u8> {
    let mut out = Vec::new();
    for (key, value) in pairs {
        let length = key.len() + value.len() + 2;
        out.extend_from_slice(&(length as u32).to_le_bytes());
        out.extend_from_slice(key.as_bytes());
        out.push(0);
        out.extend_from_slice(value.as_bytes());
        out.push(0);
        out.resize(out.len().next_multiple_of(4), 0);
    }
    out
}
