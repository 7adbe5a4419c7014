//! The data format descriptor: what a level's bits mean.
//!
//! Source: Khronos "Data Format Specification 1.3", chapter 5 (basic block) and the examples of its section on shared
//! exponents; `VkFormat` to descriptor as in KTX 2.0, section 3.10.

use super::Format;
use super::write::Supercompression;

const MODEL_RGBSDA: u8 = 1;
const MODEL_BC6H: u8 = 133;
const PRIMARIES_BT709: u8 = 1;
const TRANSFER_LINEAR: u8 = 1;
const ALPHA: u8 = 15;

/// Qualifiers in the upper half of a sample's channel byte.
const FLOAT: u8 = 0x80;
const SIGNED: u8 = 0x40;
const EXPONENT: u8 = 0x20;

const ONE: u32 = 1.0_f32.to_bits();
const MINUS_ONE: u32 = (-1.0_f32).to_bits();

/// A channel or part of one.
struct Sample {
    bit_offset: u16,
    bits: u8,
    /// Channel and qualifiers.
    channel: u8,
    lower: u32,
    upper: u32,
}

/// Total size, then one basic block: linear Rec. 709, straight alpha.
pub(super) fn data_format_descriptor(format: Format, scheme: Supercompression) -> Vec<u8> {
    let samples = samples(format);
    let block_bytes = 24 + 16 * samples.len() as u32;
    let mut out = Vec::new();
    out.extend_from_slice(&(block_bytes + 4).to_le_bytes());
    out.extend_from_slice(&0_u32.to_le_bytes()); // Khronos, basic format
    out.extend_from_slice(&(block_bytes << 16 | 2).to_le_bytes()); // version 1.3 of the specification
    let model = if format == Format::BC6H_UFLOAT_BLOCK { MODEL_BC6H } else { MODEL_RGBSDA };
    out.extend_from_slice(&[model, PRIMARIES_BT709, TRANSFER_LINEAR, 0]); // straight alpha
    let edge = format.block_size() as u8 - 1; // stored as size − 1
    out.extend_from_slice(&[edge, edge, 0, 0]);
    // Compressed levels have no planes of known size (KTX 2.0, 3.10.2).
    let plane_bytes = if scheme == Supercompression::None { format.block_bytes() as u8 } else { 0 };
    out.extend_from_slice(&[plane_bytes, 0, 0, 0, 0, 0, 0, 0]);
    for sample in samples {
        out.extend_from_slice(&sample.bit_offset.to_le_bytes());
        out.extend_from_slice(&[sample.bits - 1, sample.channel]);
        out.extend_from_slice(&[0; 4]); // sample position
        out.extend_from_slice(&sample.lower.to_le_bytes());
        out.extend_from_slice(&sample.upper.to_le_bytes());
    }
    out
}

fn samples(format: Format) -> Vec<Sample> {
    match format {
        Format::BC6H_UFLOAT_BLOCK => {
            vec![Sample { bit_offset: 0, bits: 128, channel: FLOAT, lower: 0, upper: ONE }]
        }
        Format::B10G11R11_UFLOAT_PACK32 => [(0, 11), (11, 11), (22, 10)]
            .into_iter()
            .zip(0..)
            .map(|((bit_offset, bits), id)| Sample {
                bit_offset,
                bits,
                channel: FLOAT | id,
                lower: 0,
                upper: ONE,
            })
            .collect(),
        // Each channel is a mantissa and the exponent that all share. 8448 = 2⁸ · 33 stands for 1.0, as in the
        // specification's example; the exponent's bounds are its bias and its greatest value.
        Format::E5B9G9R9_UFLOAT_PACK32 => (0..3)
            .flat_map(|id| {
                let bit_offset = 9 * u16::from(id);
                [
                    Sample { bit_offset, bits: 9, channel: id, lower: 0, upper: 8448 },
                    Sample { bit_offset: 27, bits: 5, channel: EXPONENT | id, lower: 15, upper: 31 },
                ]
            })
            .collect(),
        Format::R8G8B8A8_UNORM => channels(4, 8)
            .map(|(bit_offset, id)| Sample { bit_offset, bits: 8, channel: id, lower: 0, upper: 255 })
            .collect(),
        _ => {
            let bits = (format.type_size() * 8) as u8;
            let sample = |(bit_offset, id)| Sample {
                bit_offset,
                bits,
                channel: FLOAT | SIGNED | id,
                lower: MINUS_ONE,
                upper: ONE,
            };
            channels(format.channels(), bits).map(sample).collect()
        }
    }
}

/// Bit offset and name of `count` channels of `bits` each: red, green, blue, alpha.
fn channels(count: usize, bits: u8) -> impl Iterator<Item = (u16, u8)> {
    [0, 1, 2, ALPHA]
        .into_iter()
        .take(count)
        .enumerate()
        .map(move |(index, id)| (index as u16 * u16::from(bits), id))
}
