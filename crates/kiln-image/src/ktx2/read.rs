//! The reader: our own files, and what others write uncompressed in float.

use super::{
    Format, IDENTIFIER,
    write::{HEADER_BYTES, LEVEL_ENTRY_BYTES},
};
use crate::{Cube, Image, LayoutError};
use std::{borrow::Cow, io::Read};
use thiserror::Error;

/// A texture read back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnedTexture {
    /// Texel format.
    pub format: Format,
    /// Columns of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// 1 or 6.
    pub faces: usize,
    /// Level 0 first.
    pub levels: Vec<Vec<u8>>,
    /// In file order, without the NUL at the end of a value; values that are no UTF-8 are left out.
    pub key_values: Vec<(String, String)>,
}

/// Why bytes are no texture that is read here.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum KtxError {
    /// The identifier is another one.
    #[error("no KTX 2.0 file: the identifier is missing")]
    Identifier,
    /// The bytes end too early.
    #[error("the file ends at byte {end}, in {what}")]
    Truncated {
        /// What is missing.
        what: &'static str,
        /// Length of the file.
        end: usize,
    },
    /// Another texel format.
    #[error(
        "VkFormat {0} is not read; float formats with 2 to 4 channels, RGB9E5, R11G11B10, BC6H and RGBA8 are"
    )]
    Format(u32),
    /// Well-formed, but no plain 2D or cube texture.
    #[error("{what} {actual} is not read")]
    Unsupported {
        /// Which field.
        what: &'static str,
        /// Its value.
        actual: u32,
    },
    /// A level whose size contradicts the header.
    #[error("level {level} has {actual} bytes, its size asks for {expected}")]
    LevelSize {
        /// Level, 0 the largest.
        level: usize,
        /// Bytes stated.
        actual: u64,
        /// Bytes wanted; `u64::MAX` where the product overflows.
        expected: u64,
    },
    /// Level whose Zstandard data are damaged.
    #[error("level {level} cannot be decompressed: {reason}")]
    Zstandard {
        /// Level, 0 the largest.
        level: usize,
        /// The decoder's words.
        reason: String,
    },
    /// Level or face that is not there, or texels that make no image.
    #[error("the texture has no level {level} with {faces} face(s)")]
    NoSuchLevel {
        /// Level asked for.
        level: usize,
        /// Faces asked for.
        faces: usize,
    },
    /// A size that makes no image.
    #[error(transparent)]
    Layout(#[from] LayoutError),
}

/// The numbers at a file's start, unchecked but for the levels' count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub vk_format: u32,
    pub width: u32,
    pub height: u32,
    pub depth: u32,
    pub layers: u32,
    pub faces: u32,
    pub level_count: u32,
    pub supercompression: u32,
    pub descriptor_start: u32,
    pub key_values: [u32; 2],
}

/// Supercompression schemes: none, and Zstandard.
const NONE: u32 = 0;
const ZSTANDARD: u32 = 2;

/// Levels of the largest texture that 32 bits can state.
const LEVELS_MAX: u32 = 32;

/// The largest window that is decompressed, 128 MiB: what Zstandard's own tool accepts unasked.
const ZSTANDARD_WINDOW_LOG_MAX: u32 = 27;

/// Reads the header.
pub(crate) fn read_header(bytes: &[u8]) -> Result<Header, KtxError> {
    let rest = bytes.strip_prefix(&IDENTIFIER).ok_or(KtxError::Identifier)?;
    let truncated = KtxError::Truncated { what: "the header", end: bytes.len() };
    let (words, _) = rest.first_chunk::<{ HEADER_BYTES - 12 }>().ok_or(truncated)?.as_chunks();
    let word = |index: usize| u32::from_le_bytes(words[index]);
    let header = Header {
        vk_format: word(0),
        width: word(2),
        height: word(3),
        depth: word(4),
        layers: word(5),
        faces: word(6),
        level_count: word(7),
        supercompression: word(8),
        descriptor_start: word(9),
        key_values: [word(11), word(12)],
    };
    if header.level_count > LEVELS_MAX {
        return Err(KtxError::Unsupported { what: "level count", actual: header.level_count });
    }
    Ok(header)
}

/// Reads a container; nothing is allocated before its bytes are seen.
///
/// # Errors
/// [`KtxError`] for anything but a plain 2D or cube float texture, with or without Zstandard.
pub fn read(bytes: &[u8]) -> Result<OwnedTexture, KtxError> {
    let header = read_header(bytes)?;
    let format = Format::from_vk_format(header.vk_format).ok_or(KtxError::Format(header.vk_format))?;
    let [width, height, faces] = [header.width, header.height, header.faces].map(|value| value as usize);
    for (what, actual) in [("depth", header.depth), ("layer count", header.layers)] {
        if actual > 1 {
            return Err(KtxError::Unsupported { what, actual });
        }
    }
    if !(faces == 1 || faces == 6 && width == height) {
        return Err(KtxError::Unsupported { what: "face count", actual: header.faces });
    }
    if width == 0 || height == 0 {
        return Err(LayoutError::Empty { width, height }.into());
    }
    let level = |level: usize| {
        let expected = format.level_bytes(width, height, faces, level).unwrap_or(usize::MAX);
        Ok(level_bytes(bytes, &header, level, expected)?.into_owned())
    };
    let levels = (0..header.level_count.max(1) as usize).map(level).collect::<Result<_, KtxError>>()?;
    Ok(OwnedTexture { format, width, height, faces, levels, key_values: key_values(bytes, &header)? })
}

/// The bytes of one level, which must be `expected` many once they are decompressed. Memory grows with what they yield.
pub(crate) fn level_bytes<'a>(
    bytes: &'a [u8],
    header: &Header,
    level: usize,
    expected: usize,
) -> Result<Cow<'a, [u8]>, KtxError> {
    let truncated = |what| KtxError::Truncated { what, end: bytes.len() };
    let start = HEADER_BYTES + level * LEVEL_ENTRY_BYTES;
    let entry = bytes.get(start..start + LEVEL_ENTRY_BYTES).ok_or(truncated("the level index"))?;
    let (numbers, _) = entry.as_chunks();
    let [offset, length, uncompressed] = [0, 1, 2].map(|index| u64::from_le_bytes(numbers[index]));
    let (actual, is_compressed) = match header.supercompression {
        NONE => (length, false),
        ZSTANDARD => (uncompressed, true),
        actual => return Err(KtxError::Unsupported { what: "supercompression scheme", actual }),
    };
    let expected = expected as u64;
    if actual != expected {
        return Err(KtxError::LevelSize { level, actual, expected });
    }
    let stored = section(bytes, offset, length).ok_or(truncated("level data"))?;
    if !is_compressed {
        return Ok(Cow::Borrowed(stored));
    }
    let damaged = |error: std::io::Error| KtxError::Zstandard { level, reason: error.to_string() };
    let mut decoder = zstd::stream::read::Decoder::with_buffer(stored).map_err(damaged)?;
    decoder.window_log_max(ZSTANDARD_WINDOW_LOG_MAX).map_err(damaged)?;
    let mut out = Vec::new();
    // One byte more, so that a longer level is seen.
    decoder.take(expected.saturating_add(1)).read_to_end(&mut out).map_err(damaged)?;
    if out.len() as u64 != expected {
        return Err(KtxError::LevelSize { level, actual: out.len() as u64, expected });
    }
    Ok(Cow::Owned(out))
}

/// Key/value pairs in file order, as [`OwnedTexture::key_values`] has them.
pub(crate) fn key_values(bytes: &[u8], header: &Header) -> Result<Vec<(String, String)>, KtxError> {
    let [start, length] = header.key_values.map(u64::from);
    let data = section(bytes, start, length);
    Ok(read_key_values(data.ok_or(KtxError::Truncated { what: "key/value data", end: bytes.len() })?))
}

fn section(bytes: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    bytes.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

/// Stops at the first pair that does not fit; nothing depends on them.
fn read_key_values(mut data: &[u8]) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    while let Some((length, rest)) = data.split_first_chunk::<4>() {
        let length = u32::from_le_bytes(*length) as usize;
        let Some(pair) = rest.get(..length) else { break };
        let mut parts = pair.splitn(2, |&byte| byte == 0);
        if let (Some(Ok(key)), Some(value)) = (parts.next().map(std::str::from_utf8), parts.next())
            && let Ok(value) = std::str::from_utf8(value.strip_suffix(&[0]).unwrap_or(value))
        {
            pairs.push((key.to_owned(), value.to_owned()));
        }
        data = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
    }
    pairs
}

impl OwnedTexture {
    /// One level of a cube texture, alpha dropped; a missing blue channel reads as 0.
    ///
    /// # Errors
    /// [`KtxError::NoSuchLevel`] where there is no such level or the texture is no cube.
    pub fn cube(&self, level: usize) -> Result<Cube, KtxError> {
        let rgb = self.rgb(level, 6)?;
        Ok(Cube::new((self.width >> level).max(1), rgb)?)
    }

    /// One level of a 2D texture, alpha dropped; a missing blue channel reads as 0.
    ///
    /// # Errors
    /// [`KtxError::NoSuchLevel`] where there is no such level or the texture is a cube.
    pub fn image(&self, level: usize) -> Result<Image, KtxError> {
        let rgb = self.rgb(level, 1)?;
        Ok(Image::new((self.width >> level).max(1), (self.height >> level).max(1), rgb)?)
    }

    fn rgb(&self, level: usize, faces: usize) -> Result<Vec<f32>, KtxError> {
        let bytes = self.levels.get(level).filter(|_| self.faces == faces);
        let bytes = bytes.ok_or(KtxError::NoSuchLevel { level, faces })?;
        let (width, height) = ((self.width >> level).max(1), (self.height >> level).max(1));
        let values =
            self.format.decode_image(width, height, bytes).ok_or(KtxError::NoSuchLevel { level, faces })?;
        let texels = values.chunks_exact(self.format.channels());
        Ok(texels.flat_map(|texel| [texel[0], texel[1], texel.get(2).copied().unwrap_or(0.0)]).collect())
    }
}
