//! PNG files of 8-bit sRGB values.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// Encodes `width · height · 4` bytes, row 0 at the top.
///
/// # Panics
/// Where the bytes do not fill the size, or a side is zero or over 2³² − 1.
pub fn encode_rgba8(width: usize, height: usize, rgba: &[u8]) -> Vec<u8> {
    encode(width, height, rgba, ExtendedColorType::Rgba8)
}

/// Encodes `width · height · 3` bytes, row 0 at the top.
///
/// # Panics
/// As [`encode_rgba8`].
pub fn encode_rgb8(width: usize, height: usize, rgb: &[u8]) -> Vec<u8> {
    encode(width, height, rgb, ExtendedColorType::Rgb8)
}

fn encode(width: usize, height: usize, bytes: &[u8], kind: ExtendedColorType) -> Vec<u8> {
    let channels = usize::from(kind.channel_count());
    assert_eq!(bytes.len(), width * height * channels, "{width} × {height} × {channels} bytes");
    let size = [width, height].map(|side| u32::try_from(side).expect("a side below 2³²"));
    let mut out = Vec::new();
    PngEncoder::new(&mut out)
        .write_image(bytes, size[0], size[1], kind)
        .expect("writing a picture of matching size to memory succeeds");
    out
}
