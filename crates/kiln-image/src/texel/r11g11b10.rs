//! R11G11B10: three unsigned floats of 11, 11 and 10 bits, 4 bytes a texel.
//!
//! Source: Khronos, "Vulkan Specification", sections "Unsigned 11-Bit" and "Unsigned 10-Bit Floating-Point Numbers"
//! (`VK_FORMAT_B10G11R11_UFLOAT_PACK32`, GL's `R11F_G11F_B10F`): 5 exponent bits, bias 15, and 6, 6, 5 mantissa bits.

use half::f16;

/// Largest values of red, green and blue.
pub const MAX: [f32; 3] = [65024.0, 65024.0, 64512.0];

const MANTISSA_BITS: [i32; 3] = [6, 6, 5];
const SHIFTS: [u32; 3] = [0, 11, 22];
/// Exponent of the smallest normal value.
const EXPONENT_MIN: i32 = -14;

/// One texel, little-endian `b << 22 | g << 11 | r`, rounded to nearest, ties to even.
///
/// Red and green are off by at most 2⁻⁷ of themselves, blue by 2⁻⁶ (below 2⁻¹⁴ by a step of 2⁻²⁰ or 2⁻¹⁹). Negative
/// values and NaN become 0, values above [`MAX`] saturate.
pub fn encode(rgb: [f64; 3]) -> [u8; 4] {
    let bits =
        |channel: usize| channel_bits(rgb[channel], MANTISSA_BITS[channel], MAX[channel]) << SHIFTS[channel];
    (bits(0) | bits(1) | bits(2)).to_le_bytes()
}

fn channel_bits(value: f64, mantissa_bits: i32, max: f32) -> u32 {
    let value = value.max(0.0).min(f64::from(max));
    if value == 0.0 {
        return 0;
    }
    let exponent = (libm::frexp(value).1 - 1).max(EXPONENT_MIN);
    // In units of the last place: at most 2^(mantissa bits + 1), which carries into the exponent as it should.
    let mantissa = libm::rint(libm::ldexp(value, mantissa_bits - exponent)) as u32;
    (((exponent - EXPONENT_MIN) as u32) << mantissa_bits) + mantissa
}

/// The values of one texel; infinite and NaN patterns come out as such.
pub fn decode(bytes: [u8; 4]) -> [f32; 3] {
    let word = u32::from_le_bytes(bytes);
    // They have binary16's exponent and its upper mantissa bits.
    let float = |bits: u32| f16::from_bits(bits as u16).to_f32();
    [float((word & 0x7ff) << 4), float((word >> 11 & 0x7ff) << 4), float((word >> 22) << 5)]
}
