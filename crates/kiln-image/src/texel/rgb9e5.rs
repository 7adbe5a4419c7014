//! RGB9E5: three 9-bit mantissas with one 5-bit exponent, 4 bytes a texel.
//!
//! Source: Khronos, `EXT_texture_shared_exponent` and "Vulkan Specification", section "Shared Exponent Format"
//! (`VK_FORMAT_E5B9G9R9_UFLOAT_PACK32`): N = 9 mantissa bits, bias B = 15, greatest exponent 31.

/// Largest value: 511/512 · 2¹⁶.
pub const MAX: f32 = 65408.0;

const MANTISSA_BITS: i32 = 9;
const BIAS: i32 = 15;

/// One texel, little-endian `exponent << 27 | b << 18 | g << 9 | r`.
///
/// A channel is off by at most 2⁻¹⁰ of the brightest one's power of two above (about 1e-3 of the brightest channel),
/// so dark channels beside bright ones are coarse. Negative values and NaN become 0, values above [`MAX`] saturate.
pub fn encode(rgb: [f64; 3]) -> [u8; 4] {
    // `max` and `min` drop NaN.
    let [r, g, b] = rgb.map(|value| value.max(0.0).min(f64::from(MAX)));
    let brightest = r.max(g).max(b);
    // brightest = fraction · 2^(floor(log2) + 1) with fraction in [0.5, 1): the logarithm is exact.
    let log2_floor = if brightest > 0.0 { libm::frexp(brightest).1 - 1 } else { -BIAS - 1 };
    let exponent = log2_floor.max(-BIAS - 1) + 1 + BIAS;
    let mantissa = |value: f64, exponent: i32| {
        libm::floor(libm::ldexp(value, BIAS + MANTISSA_BITS - exponent) + 0.5) as u32
    };
    let is_full = mantissa(brightest, exponent) == 1 << MANTISSA_BITS;
    let exponent = if is_full { exponent + 1 } else { exponent };
    let [r, g, b] = [r, g, b].map(|value| mantissa(value, exponent));
    ((exponent as u32) << 27 | b << 18 | g << 9 | r).to_le_bytes()
}

/// The values of one texel; every pattern is valid.
pub fn decode(bytes: [u8; 4]) -> [f32; 3] {
    let word = u32::from_le_bytes(bytes);
    // Mantissas without a leading one and a power of two: exact in binary32.
    let scale = libm::ldexpf(1.0, (word >> 27) as i32 - BIAS - MANTISSA_BITS);
    [word, word >> 9, word >> 18].map(|bits| (bits & 0x1ff) as f32 * scale)
}
