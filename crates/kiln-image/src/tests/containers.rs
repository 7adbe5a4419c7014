//! Containers written here byte by byte, each for one case.

use crate::{
    Cancel, DecodeError, DecodedEnvironment, Environment, Image, Limits, colour::srgb_to_linear, decode,
    decode_environment, ktx2,
};
use half::f16;

fn open(bytes: &[u8]) -> Result<DecodedEnvironment, DecodeError> {
    decode_environment(bytes, None, &Limits::default(), Cancel::NEVER)
}

fn cube_rgb(bytes: &[u8]) -> Vec<f32> {
    match open(bytes).expect("a cube").environment {
        Environment::Cube(cube) => cube.rgb,
        Environment::Panorama(_) => panic!("no cube"),
    }
}

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Six faces of 2 × 2 with a number of their own for each value, exact in binary16.
fn values(channels: usize) -> Vec<f32> {
    (0..24 * channels).map(|index| index as f32 * 0.25).collect()
}

fn rgb_of(values: &[f32], channels: usize) -> Vec<f32> {
    let texels = values.chunks_exact(channels);
    texels.flat_map(|texel| [0, 1, 2].map(|c| texel.get(c).copied().unwrap_or(0.0))).collect()
}

fn halves(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|&value| f16::from_f32(value).to_le_bytes()).collect()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A KTX2 of one level; `descriptor_primaries` stands where the descriptor has it.
struct Ktx2 {
    vk_format: u32,
    size: [u32; 3],
    layers: u32,
    faces: u32,
    levels: u32,
    is_compressed: bool,
    primaries: u8,
    key_values: Vec<(&'static str, &'static str)>,
}

impl Ktx2 {
    fn cube(vk_format: u32, size: u32) -> Ktx2 {
        Ktx2 {
            vk_format,
            size: [size, size, 0],
            layers: 0,
            faces: 6,
            levels: 1,
            is_compressed: false,
            primaries: 1,
            key_values: Vec::new(),
        }
    }

    fn bytes(&self, level: &[u8]) -> Vec<u8> {
        let stored = if self.is_compressed {
            zstd::stream::encode_all(level, 3).expect("to memory")
        } else {
            level.to_vec()
        };
        let mut pairs = Vec::new();
        for (key, value) in &self.key_values {
            let length = key.len() + value.len() + 2;
            pairs.extend(words(&[length as u32]));
            pairs.extend(format!("{key}\0{value}\0").bytes());
            pairs.resize(pairs.len().next_multiple_of(4), 0);
        }
        let (descriptor_start, descriptor_bytes) = (80 + 24 * self.levels, 28_u32);
        let pairs_start = descriptor_start + descriptor_bytes;
        let level_start = pairs_start as usize + pairs.len();
        let mut bytes = ktx2::IDENTIFIER.to_vec();
        let [width, height, depth] = self.size;
        let scheme = if self.is_compressed { 2 } else { 0 };
        bytes.extend(words(&[
            self.vk_format,
            1,
            width,
            height,
            depth,
            self.layers,
            self.faces,
            self.levels,
            scheme,
        ]));
        bytes.extend(words(&[
            descriptor_start,
            descriptor_bytes,
            pairs_start,
            pairs.len() as u32,
            0,
            0,
            0,
            0,
        ]));
        for _ in 0..self.levels {
            let numbers = [level_start, stored.len(), level.len()];
            bytes.extend(numbers.iter().flat_map(|&number| (number as u64).to_le_bytes()));
        }
        let mut descriptor = vec![0; descriptor_bytes as usize];
        descriptor[13] = self.primaries;
        bytes.extend(descriptor);
        bytes.extend(pairs);
        bytes.extend(stored);
        bytes
    }
}

#[test]
fn float_cubes_of_ktx2_are_exact_with_and_without_zstandard() {
    for channels in 1..=4 {
        let values = values(channels);
        let cases = [
            (76 + 7 * (channels as u32 - 1), halves(&values)),
            (100 + 3 * (channels as u32 - 1), floats(&values)),
        ];
        for (vk_format, level) in cases {
            for is_compressed in [false, true] {
                let file = Ktx2 { is_compressed, ..Ktx2::cube(vk_format, 2) }.bytes(&level);
                assert_eq!(cube_rgb(&file), rgb_of(&values, channels), "VkFormat {vk_format}");
            }
        }
    }
}

#[test]
fn packed_floats_have_their_values() {
    // 1, 0.5, 2: exponents 15, 14, 16 without mantissa; red in the lowest bits.
    let packed = 15 << 6 | (14 << 6) << 11 | (16 << 5) << 22;
    assert_eq!(cube_rgb(&Ktx2::cube(122, 1).bytes(&words(&[packed; 6])))[..3], [1.0, 0.5, 2.0]);
    // Largest: 65408, 64512 with all mantissa bits.
    let largest = 0x7bf | 0x7bf << 11 | 0x3df << 22;
    assert_eq!(cube_rgb(&Ktx2::cube(122, 1).bytes(&words(&[largest; 6])))[..3], [65024.0, 65024.0, 64512.0]);
    // 256/512, 1/512 and 511/512, times 2^(20 − 15).
    let shared = 256 | 1 << 9 | 511 << 18 | 20 << 27;
    assert_eq!(cube_rgb(&Ktx2::cube(123, 1).bytes(&words(&[shared; 6])))[..3], [16.0, 0.0625, 31.9375]);
}

/// A block with both endpoints alike, ten bits each (mode 11, Khronos Data Format Specification 1.3, chapter 20).
fn bc6h_constant(quantised: u128) -> [u8; 16] {
    let mut block: u128 = 0b00011;
    for field in 0..6 {
        block |= quantised << (5 + 10 * field);
    }
    block.to_le_bytes()
}

#[test]
fn bc6h_blocks_are_decoded_and_cropped() {
    // Unquantised ((512 · 2¹⁶ + 2¹⁵) / 2¹⁰), finished by 31/64.
    let wanted =
        f16::from_bits((((512_u32 << 16) + 0x8000) >> 10).wrapping_mul(31).wrapping_shr(6) as u16).to_f32();
    for size in [1, 4, 5] {
        let blocks = (size as usize).div_ceil(4).pow(2) * 6;
        let file = Ktx2::cube(143, size).bytes(&bc6h_constant(512).repeat(blocks));
        let rgb = cube_rgb(&file);
        assert_eq!(rgb.len(), 18 * (size * size) as usize);
        assert!(rgb.iter().all(|&value| value == wanted), "{rgb:?}");
    }
}

#[test]
fn eight_bit_cubes_are_read_with_a_warning() {
    let level: Vec<u8> = (0..24).collect();
    for (vk_format, is_srgb, is_bgr) in [(37, false, false), (43, true, false), (50, true, true)] {
        let decoded = open(&Ktx2::cube(vk_format, 1).bytes(&level)).expect("a cube");
        assert!(decoded.notes.iter().any(|note| note.contains("lights are clipped")), "{:?}", decoded.notes);
        let Environment::Cube(cube) = decoded.environment else { panic!("no cube") };
        let linear = |value: u8| {
            let value = f64::from(value) / 255.0;
            (if is_srgb { srgb_to_linear(value) } else { value }) as f32
        };
        let first = if is_bgr { [2, 1, 0] } else { [0, 1, 2] };
        assert_eq!(cube.texel(0, 0, 0), first.map(linear));
    }
}

#[test]
fn ktx2_says_what_it_did_and_refuses_by_name() {
    let level = halves(&values(4));
    let mips = Ktx2 { levels: 2, ..Ktx2::cube(97, 2) };
    assert!(
        open(&mips.bytes(&level)).expect("a cube").notes.iter().any(|note| note.contains("level 0 of 2"))
    );
    let refused = [
        (Ktx2 { layers: 2, ..Ktx2::cube(97, 2) }, "an array"),
        (Ktx2 { size: [2, 2, 2], ..Ktx2::cube(97, 2) }, "a volume"),
        (Ktx2 { size: [2, 0, 0], ..Ktx2::cube(97, 2) }, "a 1D texture"),
        (Ktx2 { size: [2, 1, 0], ..Ktx2::cube(97, 2) }, "no squares"),
        (Ktx2 { faces: 3, ..Ktx2::cube(97, 2) }, "neither one nor six"),
        (Ktx2::cube(145, 2), "BC7"),
        (Ktx2::cube(157, 2), "ASTC"),
        (Ktx2::cube(97, 3), "its size asks for"),
        (Ktx2::cube(97, 40_000), "over the limit"),
        (Ktx2 { key_values: vec![("KTXswizzle", "aaaa")], ..Ktx2::cube(97, 2) }, "KTXswizzle"),
    ];
    for (file, reason) in refused {
        let error = open(&file.bytes(&level)).expect_err(reason).to_string();
        assert!(error.contains(reason), "{error}");
    }
    assert!(open(&Ktx2::cube(97, 2).bytes(&level)).is_ok(), "the check itself");
}

#[test]
fn ktx2_swizzle_and_primaries_are_applied() {
    let values = values(4);
    let level = floats(&values);
    let swizzled = Ktx2 { key_values: vec![("KTXswizzle", "bg01")], ..Ktx2::cube(109, 2) };
    assert_eq!(cube_rgb(&swizzled.bytes(&level))[..3], [values[2], values[1], 0.0]);
    let wide = open(&Ktx2 { primaries: 4, ..Ktx2::cube(109, 2) }.bytes(&level)).expect("BT.2020");
    assert!(
        wide.gamut.is_some() && wide.notes.iter().any(|note| note.contains("were converted to Rec. 709"))
    );
    assert_ne!(cube_rgb(&Ktx2 { primaries: 4, ..Ktx2::cube(109, 2) }.bytes(&level)), rgb_of(&values, 4));
}

#[test]
fn flat_ktx2_is_a_picture_and_turned_where_it_says_so() {
    let values: Vec<f32> = (0..4 * 2 * 3).map(|index| index as f32).collect();
    let flat = |key_values| {
        Ktx2 { size: [4, 2, 0], faces: 1, key_values, ..Ktx2::cube(106, 0) }.bytes(&floats(&values))
    };
    let read = |bytes: &[u8]| decode(bytes, &Limits::default(), Cancel::NEVER).expect("a picture").image;
    let image = read(&flat(vec![("KTXorientation", "rd")]));
    assert_eq!(image, Image::new(4, 2, values.clone()).expect("values fit"));
    let turned = read(&flat(vec![("KTXorientation", "ru")]));
    assert_eq!((turned.row(0), turned.row(1)), (image.row(1), image.row(0)));
    assert!(matches!(open(&flat(Vec::new())).expect("2:1").environment, Environment::Panorama(_)));
    let cube = Ktx2::cube(106, 1).bytes(&floats(&values[..18]));
    let error = decode(&cube, &Limits::default(), Cancel::NEVER).expect_err("no picture").to_string();
    assert!(error.contains("cube map"), "{error}");
}

/// A frame that yields gigabytes of zeros is stopped at the size the header allows.
#[test]
fn zstandard_bomb_ends_at_the_stated_size() {
    let bomb = zstd::stream::encode_all(std::io::repeat(0).take_bytes(1 << 28), 1).expect("to memory");
    let file = Ktx2::cube(97, 2);
    let mut bytes = file.bytes(&bomb);
    bytes[44..48].copy_from_slice(&2_u32.to_le_bytes());
    let uncompressed = 80 + 16;
    bytes[uncompressed..uncompressed + 8].copy_from_slice(&192_u64.to_le_bytes());
    let error = open(&bytes).expect_err("a bomb").to_string();
    assert!(error.contains("its size asks for 192"), "{error}");
}

trait TakeBytes {
    fn take_bytes(self, count: u64) -> std::io::Take<std::io::Repeat>;
}

impl TakeBytes for std::io::Repeat {
    fn take_bytes(self, count: u64) -> std::io::Take<std::io::Repeat> {
        std::io::Read::take(self, count)
    }
}

/// A KTX1 cube of 2 × 2 faces in either byte order; rows end at a multiple of four bytes.
fn ktx1(
    kind: u32,
    type_bytes: usize,
    format: u32,
    internal: u32,
    values: &[u8],
    is_swapped: bool,
) -> Vec<u8> {
    let word = |value: u32| if is_swapped { value.to_be_bytes() } else { value.to_le_bytes() };
    let mut bytes = vec![0xab, b'K', b'T', b'X', b' ', b'1', b'1', 0xbb, b'\r', b'\n', 0x1a, b'\n'];
    let row_bytes = values.len() / 12;
    let padded = row_bytes.next_multiple_of(4);
    for value in [
        0x0403_0201,
        kind,
        type_bytes as u32,
        format,
        internal,
        format,
        2,
        2,
        0,
        0,
        6,
        1,
        0,
        2 * padded as u32,
    ] {
        bytes.extend(word(value));
    }
    for row in values.chunks_exact(row_bytes) {
        let mut row = row.to_vec();
        if is_swapped {
            row.chunks_exact_mut(type_bytes).for_each(<[u8]>::reverse);
        }
        row.resize(padded, 0xee);
        bytes.extend(row);
    }
    bytes
}

#[test]
fn ktx1_cubes_are_exact_in_both_byte_orders_and_with_padded_rows() {
    for is_swapped in [false, true] {
        for (channels, format) in [(1, 0x1903), (2, 0x8227), (3, 0x1907), (4, 0x1908)] {
            let values = values(channels);
            let half = ktx1(0x140b, 2, format, 0, &halves(&values), is_swapped);
            assert_eq!(cube_rgb(&half), rgb_of(&values, channels), "half × {channels}, swapped {is_swapped}");
            let float = ktx1(0x1406, 4, format, 0, &floats(&values), is_swapped);
            assert_eq!(
                cube_rgb(&float),
                rgb_of(&values, channels),
                "float × {channels}, swapped {is_swapped}"
            );
        }
        let shared: Vec<u8> = words(&[256 | 1 << 9 | 511 << 18 | 20 << 27; 24]);
        assert_eq!(
            cube_rgb(&ktx1(0x8c3e, 4, 0x1907, 0x8c3d, &shared, is_swapped))[..3],
            [16.0, 0.0625, 31.9375]
        );
        let packed = words(&[15 << 6 | (14 << 6) << 11 | (16 << 5) << 22; 24]);
        assert_eq!(cube_rgb(&ktx1(0x8c3b, 4, 0x1907, 0x8c3a, &packed, is_swapped))[..3], [1.0, 0.5, 2.0]);
        let bytes: Vec<u8> = (0..72).collect();
        let srgb = cube_rgb(&ktx1(0x1401, 1, 0x1907, 0x8c41, &bytes, is_swapped));
        assert_eq!(srgb[71], srgb_to_linear(71.0 / 255.0) as f32);
    }
    let mut damaged = ktx1(0x1406, 4, 0x1908, 0, &floats(&values(4)), false);
    damaged[12] = 9;
    assert!(open(&damaged).expect_err("no byte order").to_string().contains("endianness"));
}

/// A DDS cube; each face has its two levels.
fn dds(dxgi: Option<u32>, four_cc: u32, faces: &[&[u8]], smaller: &[u8], caps2: u32) -> Vec<u8> {
    let mut header = [0_u32; 32];
    header[0] = u32::from_le_bytes(*b"DDS ");
    (header[1], header[3], header[4], header[7]) = (124, 2, 2, if smaller.is_empty() { 0 } else { 2 });
    (header[19], header[20], header[28]) = (32, 4, caps2);
    header[21] = if dxgi.is_some() { u32::from_le_bytes(*b"DX10") } else { four_cc };
    let mut bytes = words(&header);
    if let Some(format) = dxgi {
        bytes.extend(words(&[format, 3, if faces.len() == 6 { 4 } else { 0 }, 1, 0]));
    }
    for face in faces {
        bytes.extend_from_slice(face);
        bytes.extend_from_slice(smaller);
    }
    bytes
}

const ALL_FACES: u32 = 0xfe00;

#[test]
fn dds_cubes_are_exact_with_either_header_and_skip_smaller_levels() {
    let values = values(4);
    for (data, texel_bytes, dxgi, number) in [(halves(&values), 8, 10, 113), (floats(&values), 16, 2, 116)] {
        let faces: Vec<&[u8]> = data.chunks_exact(4 * texel_bytes).collect();
        for smaller in [Vec::new(), vec![0x77; texel_bytes]] {
            let wanted = rgb_of(&values, 4);
            assert_eq!(cube_rgb(&dds(Some(dxgi), 0, &faces, &smaller, ALL_FACES)), wanted);
            assert_eq!(cube_rgb(&dds(None, number, &faces, &smaller, ALL_FACES)), wanted);
        }
    }
    let shared = words(&[256 | 1 << 9 | 511 << 18 | 20 << 27; 4]);
    assert_eq!(cube_rgb(&dds(Some(67), 0, &[&shared[..]; 6], &[], ALL_FACES))[..3], [16.0, 0.0625, 31.9375]);
    let packed = words(&[15 << 6 | (14 << 6) << 11 | (16 << 5) << 22; 4]);
    assert_eq!(cube_rgb(&dds(Some(26), 0, &[&packed[..]; 6], &[], ALL_FACES))[..3], [1.0, 0.5, 2.0]);
    let block = bc6h_constant(512);
    assert_eq!(cube_rgb(&dds(Some(95), 0, &[&block[..]; 6], &[], ALL_FACES)).len(), 72);
}

#[test]
fn dds_without_all_faces_or_with_another_format_is_refused_by_name() {
    let face = [0_u8; 32];
    let faces = [&face[..]; 6];
    let refused = [
        (dds(None, 113, &faces, &[], 0x200 | 0x400), "1 of six faces"),
        (dds(Some(98), 0, &faces, &[], ALL_FACES), "DXGI format 98"),
        (dds(None, u32::from_le_bytes(*b"DXT5"), &faces, &[], ALL_FACES), "\"DXT5\""),
        (dds(None, 113, &faces, &[], 0x20_0000), "a volume"),
        (dds(None, 113, &faces[..5], &[], ALL_FACES), "the file ends in the texels"),
    ];
    for (file, reason) in refused {
        let error = open(&file).expect_err(reason).to_string();
        assert!(error.contains(reason), "{error}");
    }
    assert!(open(&dds(None, 113, &faces, &[], ALL_FACES)).is_ok(), "the check itself");
}

/// One sound file of each kind and format that is read.
pub(super) fn files() -> Vec<Vec<u8>> {
    let values = values(4);
    let data = halves(&values);
    let faces: Vec<&[u8]> = data.chunks_exact(32).collect();
    let packed = words(&[0x4321_1234; 24]);
    let blocks = bc6h_constant(300).repeat(6);
    let block_faces: Vec<&[u8]> = blocks.chunks_exact(16).collect();
    let mut files = vec![
        Ktx2 { is_compressed: true, ..Ktx2::cube(97, 2) }.bytes(&data),
        Ktx2 { key_values: vec![("KTXswizzle", "bgr1")], primaries: 10, ..Ktx2::cube(97, 2) }.bytes(&data),
        Ktx2 { levels: 2, ..Ktx2::cube(143, 2) }.bytes(&blocks),
        Ktx2 { size: [4, 2, 0], faces: 1, key_values: vec![("KTXorientation", "ru")], ..Ktx2::cube(97, 0) }
            .bytes(&data[..64]),
        ktx1(0x1401, 1, 0x1907, 0x8c41, &packed[..72], false),
        dds(Some(95), 0, &block_faces, &[], ALL_FACES),
        dds(None, 113, &faces, &[1; 8], ALL_FACES),
    ];
    for is_swapped in [false, true] {
        files.push(ktx1(0x140b, 2, 0x1908, 0x881a, &data, is_swapped));
        files.push(ktx1(0x8c3e, 4, 0x1907, 0x8c3d, &packed, is_swapped));
    }
    files.extend([122, 123, 37].map(|vk_format| Ktx2::cube(vk_format, 2).bytes(&packed)));
    files
}

#[test]
fn every_truncation_is_refused() {
    let values = values(4);
    let data = halves(&values);
    let faces: Vec<&[u8]> = data.chunks_exact(32).collect();
    let files = [
        Ktx2::cube(97, 2).bytes(&data),
        Ktx2 { is_compressed: true, ..Ktx2::cube(97, 2) }.bytes(&data),
        ktx1(0x140b, 2, 0x1908, 0x881a, &data, false),
        dds(Some(10), 0, &faces, &[], ALL_FACES),
    ];
    for file in files {
        assert!(open(&file).is_ok());
        for end in 0..file.len() {
            assert!(open(&file[..end]).is_err(), "{end} of {} bytes", file.len());
        }
    }
}
