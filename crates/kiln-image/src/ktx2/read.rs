//! The reader: our own files, and what others write uncompressed in float.

use super::{
    Format, IDENTIFIER,
    write::{HEADER_BYTES, LEVEL_ENTRY_BYTES},
};
use crate::{Cube, Image, LayoutError};
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

/// Reads a container; nothing is allocated before its bytes are seen.
///
/// # Errors
/// [`KtxError`] for anything but a plain 2D or cube float texture.
pub fn read(bytes: &[u8]) -> Result<OwnedTexture, KtxError> {
    let rest = bytes.strip_prefix(&IDENTIFIER).ok_or(KtxError::Identifier)?;
    let truncated = |what| KtxError::Truncated { what, end: bytes.len() };
    let (words, _) = rest.first_chunk::<{ HEADER_BYTES - 12 }>().ok_or(truncated("the header"))?.as_chunks();
    let word = |index: usize| u32::from_le_bytes(words[index]);
    let format = Format::from_vk_format(word(0)).ok_or(KtxError::Format(word(0)))?;
    let [width, height, faces] = [word(2), word(3), word(6)].map(|value| value as usize);
    let plain =
        [("depth", word(4), 0..=1), ("layer count", word(5), 0..=1), ("supercompression", word(8), 0..=0)];
    for (what, actual, accepted) in plain {
        if !accepted.contains(&actual) {
            return Err(KtxError::Unsupported { what, actual });
        }
    }
    if !(faces == 1 || faces == 6 && width == height) {
        return Err(KtxError::Unsupported { what: "face count", actual: word(6) });
    }
    if width == 0 || height == 0 {
        return Err(LayoutError::Empty { width, height }.into());
    }
    let level_count = word(7).max(1) as usize;
    if level_count > 32 {
        return Err(KtxError::Unsupported { what: "level count", actual: word(7) });
    }
    let levels = (0..level_count)
        .map(|level| read_level(bytes, level, format.level_bytes(width, height, faces, level)))
        .collect::<Result<_, _>>()?;
    let key_values = section(bytes, word(11).into(), word(12).into()).ok_or(truncated("key/value data"))?;
    Ok(OwnedTexture { format, width, height, faces, levels, key_values: read_key_values(key_values) })
}

fn read_level(bytes: &[u8], level: usize, expected: Option<usize>) -> Result<Vec<u8>, KtxError> {
    let truncated = |what| KtxError::Truncated { what, end: bytes.len() };
    let start = HEADER_BYTES + level * LEVEL_ENTRY_BYTES;
    let entry = bytes.get(start..start + LEVEL_ENTRY_BYTES).ok_or(truncated("the level index"))?;
    let (numbers, _) = entry.as_chunks();
    let [offset, actual] = [0, 1].map(|index| u64::from_le_bytes(numbers[index]));
    let expected = expected.map_or(u64::MAX, |bytes| bytes as u64);
    if actual != expected {
        return Err(KtxError::LevelSize { level, actual, expected });
    }
    Ok(section(bytes, offset, actual).ok_or(truncated("level data"))?.to_vec())
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
