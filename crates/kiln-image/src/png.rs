//! PNG files of 8-bit sRGB values.

use crate::colour::linear_to_srgb;
use crate::{Cancel, Cancelled, Image};
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

/// An image of radiance as 8-bit sRGB: each value times `exposure`, clamped to 0 … 1, sRGB-encoded, rounded.
///
/// Everything above 1/`exposure` is lost; the second result is the share of texels with a channel that was (negative
/// and not finite ones included; NaN becomes 0). For looking at, not for lighting.
///
/// # Errors
/// [`Cancelled`] within a row; compressing afterwards takes some 30 ns a texel.
pub fn encode_radiance(image: &Image, exposure: f64, cancel: Cancel) -> Result<(Vec<u8>, f64), Cancelled> {
    let mut rgb = Vec::with_capacity(image.rgb.len());
    let mut clamped = 0_usize;
    for row in image.rgb.chunks(image.width.max(1) * 3) {
        cancel.check()?;
        for texel in row.chunks_exact(3) {
            let exposed = [texel[0], texel[1], texel[2]].map(|value| f64::from(value) * exposure);
            clamped += usize::from(!exposed.iter().all(|value| (0.0..=1.0).contains(value)));
            rgb.extend(exposed.map(|value| {
                libm::round(linear_to_srgb(if value > 0.0 { value.min(1.0) } else { 0.0 }) * 255.0) as u8
            }));
        }
    }
    let texels = (rgb.len() / 3).max(1);
    Ok((encode_rgb8(image.width, image.height, &rgb), clamped as f64 / texels as f64))
}
