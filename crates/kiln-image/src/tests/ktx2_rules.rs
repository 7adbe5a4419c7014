//! The rules of the KTX 2.0 specification, checked on the bytes of our files without our reader.

use super::Random;
use crate::ktx2::{Format, Texture, write, write_zstd};
use crate::{Cancel, Cancelled};
use std::sync::atomic::AtomicI64;

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize
}

fn double(bytes: &[u8], at: usize) -> usize {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes")) as usize
}

/// What each format must say: VkFormat → typeSize, model, block edge, block bytes and, per sample, offset, bits,
/// channel with qualifiers, lower and upper bound.
type Sample = (usize, usize, u8, u32, u32);
const ONE: u32 = 0x3f80_0000;
const MINUS_ONE: u32 = 0xbf80_0000;

fn expected(vk_format: usize) -> (usize, u8, usize, usize, Vec<Sample>) {
    let channels = |count: usize, bits: usize, qualifiers: u8, lower: u32, upper: u32| -> Vec<Sample> {
        (0..count).map(|i| (i * bits, bits, qualifiers | [0, 1, 2, 15][i], lower, upper)).collect()
    };
    let float = |count, bits| channels(count, bits, 0xc0, MINUS_ONE, ONE);
    match vk_format {
        37 => (1, 1, 1, 4, channels(4, 8, 0, 0, 255)),
        83 => (2, 1, 1, 4, float(2, 16)),
        90 => (2, 1, 1, 6, float(3, 16)),
        97 => (2, 1, 1, 8, float(4, 16)),
        103 => (4, 1, 1, 8, float(2, 32)),
        106 => (4, 1, 1, 12, float(3, 32)),
        109 => (4, 1, 1, 16, float(4, 32)),
        122 => (4, 1, 1, 4, vec![(0, 11, 0x80, 0, ONE), (11, 11, 0x81, 0, ONE), (22, 10, 0x82, 0, ONE)]),
        123 => {
            let samples =
                (0..3_u8).flat_map(|c| [(9 * usize::from(c), 9, c, 0, 8448), (27, 5, 0x20 | c, 15, 31)]);
            (4, 1, 1, 4, samples.collect())
        }
        143 => (1, 133, 4, 16, vec![(0, 128, 0x80, 0, ONE)]),
        other => panic!("no expectation for VkFormat {other}"),
    }
}

/// Everything wrong with a file, in words.
fn violations(bytes: &[u8]) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut rule = |holds: bool, what: &str| {
        if !holds {
            wrong.push(what.to_owned());
        }
    };
    let header: Vec<usize> = (0..13).map(|index| word(bytes, 12 + 4 * index)).collect();
    let [
        vk_format,
        type_size,
        width,
        height,
        depth,
        layers,
        faces,
        levels,
        scheme,
        dfd,
        dfd_length,
        kvd,
        kvd_length,
    ] = header[..]
    else {
        unreachable!("thirteen words")
    };
    let (wanted_type_size, model, edge, block_bytes, samples) = expected(vk_format);
    rule(type_size == wanted_type_size, "typeSize");
    rule(depth == 0 && layers == 0, "a 2D texture has no depth and no layers");
    rule(faces == 1 || faces == 6 && width == height, "a cube is square");
    rule(levels >= 1 && levels <= (width.max(height).ilog2() + 1) as usize, "level count");
    rule(double(bytes, 64) == 0 && double(bytes, 72) == 0, "no global data");
    rule(dfd == 80 + 24 * levels, "the descriptor follows the level index");
    rule(kvd == dfd + dfd_length, "key/value data follows the descriptor");

    rule(word(bytes, dfd) == dfd_length, "descriptor total size");
    rule(word(bytes, dfd + 4) == 0, "vendor and type of the basic block");
    rule(word(bytes, dfd + 8) == (dfd_length - 4) << 16 | 2, "block size and version 1.3");
    rule(bytes[dfd + 12..dfd + 16] == [model, 1, 1, 0], "model, Rec. 709, linear, straight alpha");
    let edge_byte = edge as u8 - 1;
    rule(bytes[dfd + 16..dfd + 20] == [edge_byte, edge_byte, 0, 0], "texel block dimensions");
    let plane = if scheme == 0 { block_bytes as u8 } else { 0 };
    rule(bytes[dfd + 20..dfd + 28] == [plane, 0, 0, 0, 0, 0, 0, 0], "bytesPlane");
    rule(dfd_length == 28 + 16 * samples.len(), "sample count");
    for (index, &(offset, bits, channel, lower, upper)) in samples.iter().enumerate() {
        let at = dfd + 28 + 16 * index;
        let first = (channel as usize) << 24 | (bits - 1) << 16 | offset;
        rule(word(bytes, at) == first && word(bytes, at + 4) == 0, "sample bits and position");
        rule(
            word(bytes, at + 8) == lower as usize && word(bytes, at + 12) == upper as usize,
            "sample bounds",
        );
    }

    let (mut at, mut last_key) = (kvd, String::new());
    while at < kvd + kvd_length {
        let length = word(bytes, at);
        let pair = &bytes[at + 4..at + 4 + length];
        let end = pair.iter().position(|&byte| byte == 0).unwrap_or(length);
        let key = String::from_utf8_lossy(&pair[..end]).into_owned();
        rule(key > last_key, "keys are sorted and occur once");
        let value = pair.get(end + 1..).unwrap_or_default();
        rule(key != "KTXorientation" || value == b"rd\0", "orientation of a 2D or cube texture");
        rule(
            !key.starts_with("KTX") || ["KTXorientation", "KTXwriter"].contains(&key.as_str()),
            "reserved key",
        );
        at += 4 + length.next_multiple_of(4);
        last_key = key;
    }
    rule(at == kvd + kvd_length, "pairs fill their section");

    let lcm = if block_bytes.is_multiple_of(4) { block_bytes } else { block_bytes * 2 };
    let alignment = if scheme == 0 { lcm } else { 1 };
    let mut end = at;
    for level in (0..levels).rev() {
        let entry = 80 + 24 * level;
        let [offset, length, uncompressed] = [0, 8, 16].map(|part| double(bytes, entry + part));
        let side = |length: usize| (length >> level).max(1).div_ceil(edge);
        rule(offset == end.next_multiple_of(alignment), "level offset: smallest first, aligned, no gaps");
        rule(uncompressed == side(width) * side(height) * faces * block_bytes, "uncompressed level length");
        rule(scheme != 0 || length == uncompressed, "level length");
        end = offset + length;
        if scheme == 2 {
            let inflated = zstd::bulk::decompress(&bytes[offset..end], uncompressed + 1);
            rule(inflated.is_ok_and(|data| data.len() == uncompressed), "level inflates to its length");
        }
    }
    rule(end == bytes.len(), "the file ends with level 0");
    wrong
}

const FORMATS: [u32; 10] = [37, 83, 90, 97, 103, 106, 109, 122, 123, 143];

/// A texture written both ways.
struct Files {
    format: Format,
    size: usize,
    levels: Vec<Vec<u8>>,
    plain: Vec<u8>,
    zstd: Vec<u8>,
}

fn files() -> Vec<Files> {
    let mut files = Vec::new();
    for number in FORMATS {
        let format = Format::from_vk_format(number).expect("known");
        for (size, faces, count) in [(16, 6, 5), (12, 6, 2), (1, 6, 1), (8, 1, 4)] {
            let mut random = Random(9);
            let bytes = |level| format.level_bytes(size, size, faces, level).expect("small");
            let mut byte = |_| (random.next() & 0x1f) as u8;
            let levels: Vec<Vec<u8>> =
                (0..count).map(|level| (0..bytes(level)).map(&mut byte).collect()).collect();
            let texture = Texture {
                format,
                width: size,
                height: size,
                faces,
                levels: levels.iter().map(Vec::as_slice).collect(),
                key_values: vec![("kilnLaw".to_owned(), "linear".to_owned())],
            };
            let zstd = write_zstd(&texture, 3, Cancel::NEVER).expect("nobody cancels");
            let plain = write(&texture);
            drop(texture);
            files.push(Files { format, size, levels, plain, zstd });
        }
    }
    files
}

#[test]
fn all_files_keep_the_rules_plain_and_compressed() {
    for Files { format, size, plain, zstd, .. } in files() {
        assert_eq!(violations(&plain), [""; 0], "{format:?} {size}");
        assert_eq!(violations(&zstd), [""; 0], "{format:?} {size} zstd");
    }
}

#[test]
fn a_changed_field_breaks_a_rule() {
    let plain = &files()[3 * 4].plain;
    // typeSize, faces, level count + 1 stays in range for none, descriptor model, plane bytes, sample length, level offset.
    for position in [16, 36, 80 + 24 * 5 + 12, 80 + 24 * 5 + 20, 80 + 24 * 5 + 30, 80, 81] {
        let mut damaged = plain.clone();
        damaged[position] ^= 1;
        assert!(!violations(&damaged).is_empty(), "byte {position}");
    }
}

#[test]
fn compressed_levels_are_what_the_crate_sees_and_inflate_to_the_same_bytes() {
    for Files { format, levels, zstd, .. } in files() {
        let reader = ktx2::Reader::new(&zstd).expect("the crate reads it");
        let header = reader.header();
        assert_eq!(header.supercompression_scheme, Some(ktx2::SupercompressionScheme::Zstandard));
        assert_eq!(header.format.map(|f| f.value()), Some(format.vk_format()));
        for (level, wanted) in reader.levels().zip(&levels) {
            let inflated = zstd::bulk::decompress(level.data, wanted.len()).expect("Zstandard");
            assert_eq!(&inflated, wanted);
        }
    }
}

#[test]
fn compression_ends_when_it_is_cancelled() {
    let level = vec![0; 6 * 16];
    let texture = Texture {
        format: Format::R32G32B32A32_SFLOAT,
        width: 1,
        height: 1,
        faces: 6,
        levels: vec![&level],
        key_values: Vec::new(),
    };
    assert_eq!(write_zstd(&texture, 3, Cancel::countdown(&AtomicI64::new(0))), Err(Cancelled));
}
