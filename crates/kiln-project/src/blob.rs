//! The store's form of a decoded panorama: `KILNPAN1`, width and height (u32 LE), then RGB as f32 LE.

use kiln_bake::{Cancel, Cancelled};
use kiln_build::Error;
use kiln_image::{Image, Panorama};

use crate::environment::ended;

const MAGIC: &[u8; 8] = b"KILNPAN1";
const HEADER_BYTES: usize = 16;

/// Width and height of a stored panorama of this length: it is twice as wide as high.
pub(crate) fn panorama_size(blob_bytes: usize) -> (usize, usize) {
    let height = (blob_bytes.saturating_sub(HEADER_BYTES) / 24).isqrt();
    (2 * height, height)
}

/// Bytes between two looks at a [`Cancel`]: about a millisecond's work.
const CHUNK_BYTES: usize = 1 << 20;

pub(crate) fn encode_panorama(panorama: &Panorama, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + panorama.rgb().len() * 4);
    bytes.extend_from_slice(MAGIC);
    for size in [panorama.width(), panorama.height()] {
        bytes.extend_from_slice(&u32::try_from(size).unwrap_or(u32::MAX).to_le_bytes());
    }
    for values in panorama.rgb().chunks(CHUNK_BYTES / 4) {
        cancel.check()?;
        values.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    }
    Ok(bytes)
}

pub(crate) fn decode_panorama(bytes: &[u8], cancel: Cancel) -> Result<Panorama, Error> {
    let damaged = || Error::Action {
        action: "read a decoded panorama".to_owned(),
        reason: "the store holds something else under its name".to_owned(),
    };
    let (header, texels) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or_else(damaged)?;
    let size = |at: usize| header[at..at + 4].try_into().map(u32::from_le_bytes).map_err(|_| damaged());
    let (width, height) = (size(8)? as usize, size(12)? as usize);
    let mut rgb = Vec::with_capacity(texels.len() / 4);
    for chunk in texels.chunks(CHUNK_BYTES) {
        cancel.check().map_err(ended)?;
        rgb.extend(
            chunk.chunks_exact(4).map(|value| f32::from_le_bytes([value[0], value[1], value[2], value[3]])),
        );
    }
    let image = Image::new(width, height, rgb).map_err(|_| damaged())?;
    if header[..8] != *MAGIC {
        return Err(damaged());
    }
    Panorama::new(image).map_err(|_| damaged())
}
