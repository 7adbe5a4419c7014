//! Where BC6H keeps its fields: modes, partitions, bit order.

use std::sync::LazyLock;

/// Interpolation weights of three index bits, in 64ths.
pub(super) const WEIGHTS_3: [i32; 8] = [0, 9, 18, 27, 37, 46, 55, 64];
/// Interpolation weights of four index bits, in 64ths.
pub(super) const WEIGHTS_4: [i32; 16] = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];

/// Shapes of the second region: bit i belongs to texel i.
const PARTITIONS: [u16; 32] = [
    0xcccc, 0x8888, 0xeeee, 0xecc8, 0xc880, 0xfeec, 0xfec8, 0xec80, 0xc800, 0xffec, 0xfe80, 0xe800, 0xffe8,
    0xff00, 0xfff0, 0xf000, 0xf710, 0x008e, 0x7100, 0x08ce, 0x008c, 0x7310, 0x3100, 0x8cce, 0x088c, 0x3110,
    0x6666, 0x366c, 0x17e8, 0x0ff0, 0x718e, 0x399c,
];
/// The second region's anchor of each shape: the texel whose index lacks its top bit. The first region's is texel 0.
const ANCHORS: [u8; 32] = [
    15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 2, 8, 2, 2, 8, 8, 15, 2, 8, 2, 2, 8,
    8, 2, 2,
];

pub(super) const PARTITION_COUNT: usize = PARTITIONS.len();

/// 0 or 1: the region a texel is in.
pub(super) fn region_of(partition: usize, texel: usize, regions: usize) -> usize {
    if regions == 1 { 0 } else { usize::from(PARTITIONS[partition] >> texel & 1) }
}

/// Whether a texel's index is stored without its top bit, which is 0.
pub(super) fn is_anchor(partition: usize, texel: usize, regions: usize) -> bool {
    texel == 0 || regions == 2 && texel == usize::from(ANCHORS[partition])
}

/// One of the 14 ways to spend a block's bits.
pub(super) struct Mode {
    /// The mode's number in the block's first bits: two of them where it is below 2, else five.
    code: u8,
    /// Regions, 1 or 2.
    pub(super) regions: usize,
    /// Bits of the first end.
    pub(super) bits: u32,
    /// Bits of the other ends, per channel: differences to the first one unless they equal `bits`.
    pub(super) delta_bits: [u32; 3],
    /// Fields after the code, least significant bit first, as the specification lists them: channel, end (w x y z),
    /// then the bits from the last to the first.
    fields: &'static str,
}

impl Mode {
    /// Whether the ends after the first are stored as differences.
    pub(super) fn is_transformed(&self) -> bool {
        self.delta_bits[0] != self.bits
    }

    /// Ends stored: 2 or 4.
    pub(super) fn end_count(&self) -> usize {
        2 * self.regions
    }
}

const fn mode(code: u8, regions: usize, bits: u32, delta_bits: [u32; 3], fields: &'static str) -> Mode {
    Mode { code, regions, bits, delta_bits, fields }
}

/// Khronos "Data Format Specification 1.3", table "Bit layout for BC6H blocks"; modes 1 to 14 of Microsoft's list.
pub(super) const MODES: [Mode; 14] = [
    mode(
        0x00,
        2,
        10,
        [5, 5, 5],
        "gy4 by4 bz4 rw9:0 gw9:0 bw9:0 rx4:0 gz4 gy3:0 gx4:0 bz0 gz3:0 bx4:0 bz1 by3:0 ry4:0 bz2 rz4:0 bz3",
    ),
    mode(
        0x01,
        2,
        7,
        [6, 6, 6],
        "gy5 gz4 gz5 rw6:0 bz0 bz1 by4 gw6:0 by5 bz2 gy4 bw6:0 bz3 bz5 bz4 rx5:0 gy3:0 gx5:0 gz3:0 bx5:0 by3:0 ry5:0 rz5:0",
    ),
    mode(
        0x02,
        2,
        11,
        [5, 4, 4],
        "rw9:0 gw9:0 bw9:0 rx4:0 rw10 gy3:0 gx3:0 gw10 bz0 gz3:0 bx3:0 bw10 bz1 by3:0 ry4:0 bz2 rz4:0 bz3",
    ),
    mode(
        0x06,
        2,
        11,
        [4, 5, 4],
        "rw9:0 gw9:0 bw9:0 rx3:0 rw10 gz4 gy3:0 gx4:0 gw10 gz3:0 bx3:0 bw10 bz1 by3:0 ry3:0 bz0 bz2 rz3:0 gy4 bz3",
    ),
    mode(
        0x0a,
        2,
        11,
        [4, 4, 5],
        "rw9:0 gw9:0 bw9:0 rx3:0 rw10 by4 gy3:0 gx3:0 gw10 bz0 gz3:0 bx4:0 bw10 by3:0 ry3:0 bz1 bz2 rz3:0 bz4 bz3",
    ),
    mode(
        0x0e,
        2,
        9,
        [5, 5, 5],
        "rw8:0 by4 gw8:0 gy4 bw8:0 bz4 rx4:0 gz4 gy3:0 gx4:0 bz0 gz3:0 bx4:0 bz1 by3:0 ry4:0 bz2 rz4:0 bz3",
    ),
    mode(
        0x12,
        2,
        8,
        [6, 5, 5],
        "rw7:0 gz4 by4 gw7:0 bz2 gy4 bw7:0 bz3 bz4 rx5:0 gy3:0 gx4:0 bz0 gz3:0 bx4:0 bz1 by3:0 ry5:0 rz5:0",
    ),
    mode(
        0x16,
        2,
        8,
        [5, 6, 5],
        "rw7:0 bz0 by4 gw7:0 gy5 gy4 bw7:0 gz5 bz4 rx4:0 gz4 gy3:0 gx5:0 gz3:0 bx4:0 bz1 by3:0 ry4:0 bz2 rz4:0 bz3",
    ),
    mode(
        0x1a,
        2,
        8,
        [5, 5, 6],
        "rw7:0 bz1 by4 gw7:0 by5 gy4 bw7:0 bz5 bz4 rx4:0 gz4 gy3:0 gx4:0 bz0 gz3:0 bx5:0 by3:0 ry4:0 bz2 rz4:0 bz3",
    ),
    mode(
        0x1e,
        2,
        6,
        [6, 6, 6],
        "rw5:0 gz4 bz0 bz1 by4 gw5:0 gy5 by5 bz2 gy4 bw5:0 gz5 bz3 bz5 bz4 rx5:0 gy3:0 gx5:0 gz3:0 bx5:0 by3:0 ry5:0 rz5:0",
    ),
    mode(0x03, 1, 10, [10, 10, 10], "rw9:0 gw9:0 bw9:0 rx9:0 gx9:0 bx9:0"),
    mode(0x07, 1, 11, [9, 9, 9], "rw9:0 gw9:0 bw9:0 rx8:0 rw10 gx8:0 gw10 bx8:0 bw10"),
    mode(0x0b, 1, 12, [8, 8, 8], "rw9:0 gw9:0 bw9:0 rx7:0 rw10:11 gx7:0 gw10:11 bx7:0 bw10:11"),
    mode(0x0f, 1, 16, [4, 4, 4], "rw9:0 gw9:0 bw9:0 rx3:0 rw10:15 gx3:0 gw10:15 bx3:0 bw10:15"),
];

/// For each mode, the (end, channel, bit) of each of its bits after the code.
static BIT_PLACES: LazyLock<[Vec<(u8, u8, u8)>; 14]> =
    LazyLock::new(|| MODES.each_ref().map(|mode| bit_places(mode.fields)));

fn bit_places(fields: &str) -> Vec<(u8, u8, u8)> {
    let position =
        |names: &str, name: u8| names.bytes().position(|byte| byte == name).expect("a known name") as u8;
    let number = |digits: &str| digits.parse::<u8>().expect("a bit number");
    let field = |field: &str| {
        let (channel, end) = (position("rgb", field.as_bytes()[0]), position("wxyz", field.as_bytes()[1]));
        let (last, first) = field[2..].split_once(':').unwrap_or((&field[2..], &field[2..]));
        let (last, first) = (number(last), number(first));
        let bits: Vec<u8> =
            if first <= last { (first..=last).collect() } else { (last..=first).rev().collect() };
        bits.into_iter().map(move |bit| (end, channel, bit))
    };
    fields.split(' ').flat_map(field).collect()
}

/// The value that a quantised end stands for, in 0 … 65535.
pub(super) fn unquantise(value: i32, bits: u32) -> i32 {
    if bits >= 15 || value == 0 {
        value
    } else if value == (1 << bits) - 1 {
        0xffff
    } else {
        ((value << 16) + 0x8000) >> bits
    }
}

/// The same of a signed format, in −32767 … 32767.
pub(super) fn unquantise_signed(value: i32, bits: u32) -> i32 {
    let unused = 32 - bits;
    let value = value << unused >> unused; // sign extension
    let magnitude = match value.abs() {
        magnitude if bits >= 16 || magnitude == 0 => magnitude,
        magnitude if magnitude >= (1 << (bits - 1)) - 1 => 0x7fff,
        magnitude => ((magnitude << 15) + 0x4000) >> (bits - 1),
    };
    if value < 0 { -magnitude } else { magnitude }
}

/// A block's fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// Index into [`MODES`].
    pub(super) mode: usize,
    /// Shape; 0 where there is one region.
    pub(super) partition: usize,
    /// Quantised ends in full (no differences): two a region.
    pub(super) ends: [[i32; 3]; 4],
    /// Index on the line of each texel.
    pub(super) indices: [u8; 16],
}

impl Block {
    /// Packs the fields. Ends whose difference does not fit are wrapped: check before.
    pub(super) fn to_bytes(self) -> [u8; 16] {
        let mode = &MODES[self.mode];
        let (mut word, mut position) = (0_u128, 0);
        let mut push = |value: u128, bits: u32| {
            word |= (value & ((1 << bits) - 1)) << position;
            position += bits;
        };
        push(u128::from(mode.code), if mode.code < 2 { 2 } else { 5 });
        let base = self.ends[0];
        for &(end, channel, bit) in &BIT_PLACES[self.mode] {
            let (end, channel) = (usize::from(end), usize::from(channel));
            let is_delta = mode.is_transformed() && end > 0;
            let value = self.ends[end][channel] - if is_delta { base[channel] } else { 0 };
            push((value >> bit & 1) as u128, 1);
        }
        if mode.regions == 2 {
            push(self.partition as u128, 5);
        }
        let index_bits = if mode.regions == 1 { 4 } else { 3 };
        for (texel, &index) in self.indices.iter().enumerate() {
            let is_short = is_anchor(self.partition, texel, mode.regions);
            push(u128::from(index), index_bits - u32::from(is_short));
        }
        word.to_le_bytes()
    }

    /// Unpacks the fields; `None` for a reserved mode.
    pub(super) fn from_bytes(bytes: [u8; 16]) -> Option<Block> {
        let mut word = u128::from_le_bytes(bytes);
        let mut pull = |bits: u32| {
            let value = word & ((1 << bits) - 1);
            word >>= bits;
            value as i32
        };
        let low = pull(2) as u8;
        let code = if low < 2 { low } else { low | (pull(3) as u8) << 2 };
        let index = MODES.iter().position(|mode| mode.code == code)?;
        let mode = &MODES[index];
        let mut ends = [[0; 3]; 4];
        for &(end, channel, bit) in &BIT_PLACES[index] {
            ends[usize::from(end)][usize::from(channel)] |= pull(1) << bit;
        }
        if mode.is_transformed() {
            let base = ends[0];
            for end in &mut ends[1..mode.end_count()] {
                for channel in 0..3 {
                    let unused = 32 - mode.delta_bits[channel];
                    let delta = end[channel] << unused >> unused; // sign extension
                    end[channel] = (base[channel] + delta) & ((1 << mode.bits) - 1);
                }
            }
        }
        let partition = if mode.regions == 2 { pull(5) as usize } else { 0 };
        let index_bits = if mode.regions == 1 { 4 } else { 3 };
        let indices = std::array::from_fn(|texel| {
            pull(index_bits - u32::from(is_anchor(partition, texel, mode.regions))) as u8
        });
        Some(Block { mode: index, partition, ends, indices })
    }
}
