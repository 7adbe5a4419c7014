//! The store's form of a decoded environment: `KILNENV1`, width and height (u32 LE), then RGB as f32 LE. Twice as wide as
//! high it is a panorama; six times as high as wide the faces of a cube, one below the other in KTX2 order.

use kiln_bake::{Cancel, Cancelled};
use kiln_build::Error;
use kiln_image::{Cube, Environment, Image, Panorama};

use crate::environment::ended;

const MAGIC: &[u8; 8] = b"KILNENV1";
const HEADER_BYTES: usize = 16;

/// Width and height of the panorama that a stored environment of this length is, or becomes: a cube's is four faces
/// wide, and longer as stored.
pub(crate) fn environment_size(blob_bytes: usize) -> (usize, usize) {
    let texels = blob_bytes.saturating_sub(HEADER_BYTES) / 12;
    // A cube of 6 n² texels becomes a panorama of 8 n².
    let height = (texels.saturating_mul(2) / 3).isqrt() + 1;
    (2 * height, height)
}

/// Bytes between two looks at a [`Cancel`]: about a millisecond's work.
const CHUNK_BYTES: usize = 1 << 20;

pub(crate) fn encode_environment(environment: &Environment, cancel: Cancel) -> Result<Vec<u8>, Cancelled> {
    let (width, height, rgb) = match environment {
        Environment::Panorama(panorama) => (panorama.width(), panorama.height(), panorama.rgb()),
        Environment::Cube(cube) => (cube.face_size, 6 * cube.face_size, cube.rgb.as_slice()),
    };
    let mut bytes = Vec::with_capacity(HEADER_BYTES + rgb.len() * 4);
    bytes.extend_from_slice(MAGIC);
    for size in [width, height] {
        bytes.extend_from_slice(&u32::try_from(size).unwrap_or(u32::MAX).to_le_bytes());
    }
    for values in rgb.chunks(CHUNK_BYTES / 4) {
        cancel.check()?;
        values.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    }
    Ok(bytes)
}

pub(crate) fn decode_environment(bytes: &[u8], cancel: Cancel) -> Result<Environment, Error> {
    let damaged = || Error::Action {
        action: "read a decoded environment".to_owned(),
        reason: "the store holds something else under its name".to_owned(),
    };
    let (header, texels) = bytes.split_first_chunk::<HEADER_BYTES>().ok_or_else(damaged)?;
    let size = |at: usize| header[at..at + 4].try_into().map(u32::from_le_bytes).map_err(|_| damaged());
    let (width, height) = (size(8)? as usize, size(12)? as usize);
    if header[..8] != *MAGIC {
        return Err(damaged());
    }
    let mut rgb = Vec::with_capacity(texels.len() / 4);
    for chunk in texels.chunks(CHUNK_BYTES) {
        cancel.check().map_err(ended)?;
        rgb.extend(chunk.as_chunks::<4>().0.iter().map(|value| f32::from_le_bytes(*value)));
    }
    if height == 6 * width {
        return Cube::new(width, rgb).map(Environment::Cube).map_err(|_| damaged());
    }
    let image = Image::new(width, height, rgb).map_err(|_| damaged())?;
    Panorama::new(image).map(Environment::Panorama).map_err(|_| damaged())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn environments_survive_the_store_and_other_bytes_do_not() {
        let image = Image::new(4, 2, (0..24u8).map(f32::from).collect()).unwrap();
        let panorama = Environment::Panorama(Panorama::new(image).unwrap());
        let cube = Environment::Cube(Cube::new(2, (0..72u8).map(f32::from).collect()).unwrap());
        for environment in [panorama, cube] {
            let bytes = encode_environment(&environment, Cancel::NEVER).unwrap();
            assert_eq!(decode_environment(&bytes, Cancel::NEVER).unwrap(), environment);
            let (width, height) = environment_size(bytes.len());
            assert!(width >= 4 && height >= 2, "{width} x {height} is too small an estimate");
            assert!(decode_environment(&bytes[..bytes.len() - 4], Cancel::NEVER).is_err());
            assert!(decode_environment(&[b"X", &bytes[1..]].concat(), Cancel::NEVER).is_err());
        }
    }
}
