//! Our containers, read by ourselves and by crate `ktx2`.

use super::{Random, corpus};
use crate::ktx2::{Format, KtxError, Texture, read, write};

const FORMATS: [Format; 10] = [
    Format::R8G8B8A8_UNORM,
    Format::R16G16_SFLOAT,
    Format::R16G16B16_SFLOAT,
    Format::R16G16B16A16_SFLOAT,
    Format::R32G32_SFLOAT,
    Format::R32G32B32_SFLOAT,
    Format::R32G32B32A32_SFLOAT,
    Format::B10G11R11_UFLOAT_PACK32,
    Format::E5B9G9R9_UFLOAT_PACK32,
    Format::BC6H_UFLOAT_BLOCK,
];

fn level_data(format: Format, size: usize, faces: usize) -> Vec<Vec<u8>> {
    let mut random = Random(5);
    let bytes = |level| format.level_bytes(size, size, faces, level).expect("small");
    let mut byte = |_| (random.next() & 0x3f) as u8;
    (0..=size.ilog2() as usize).map(|level| (0..bytes(level)).map(&mut byte).collect()).collect()
}

fn texture(format: Format, size: usize, faces: usize, levels: &[Vec<u8>]) -> Texture<'_> {
    Texture {
        format,
        width: size,
        height: size,
        faces,
        levels: levels.iter().map(Vec::as_slice).collect(),
        key_values: vec![("kilnSource".to_owned(), "a.hdr".to_owned()), ("Akey".to_owned(), String::new())],
    }
}

#[test]
fn every_format_comes_back_and_the_crate_agrees() {
    for format in FORMATS {
        for (size, faces) in [(1, 6), (16, 6), (8, 1)] {
            let levels = level_data(format, size, faces);
            let bytes = write(&texture(format, size, faces, &levels));
            let own = read(&bytes).expect("our own file");
            assert_eq!((own.format, own.width, own.height, own.faces), (format, size, size, faces));
            assert_eq!(own.levels, levels);

            let reader = ktx2::Reader::new(&bytes).expect("the crate reads it");
            let header = reader.header();
            assert_eq!(
                header.format.map(|f| f.value()),
                std::num::NonZeroU32::new(format.vk_format()).map(|v| v.get())
            );
            assert_eq!((header.pixel_width, header.face_count as usize), (size as u32, faces));
            assert_eq!(header.type_size as usize, format.type_size());
            assert!(reader.levels().map(|level| level.data.to_vec()).eq(levels));
        }
    }
}

#[test]
fn format_numbers_are_those_that_vulkan_gives_the_names() {
    // The crate's constants come from Vulkan's registry.
    let named = [
        (Format::R8G8B8A8_UNORM, ktx2::Format::R8G8B8A8_UNORM),
        (Format::R16G16_SFLOAT, ktx2::Format::R16G16_SFLOAT),
        (Format::R16G16B16_SFLOAT, ktx2::Format::R16G16B16_SFLOAT),
        (Format::R16G16B16A16_SFLOAT, ktx2::Format::R16G16B16A16_SFLOAT),
        (Format::R32G32_SFLOAT, ktx2::Format::R32G32_SFLOAT),
        (Format::R32G32B32_SFLOAT, ktx2::Format::R32G32B32_SFLOAT),
        (Format::R32G32B32A32_SFLOAT, ktx2::Format::R32G32B32A32_SFLOAT),
        (Format::B10G11R11_UFLOAT_PACK32, ktx2::Format::B10G11R11_UFLOAT_PACK32),
        (Format::E5B9G9R9_UFLOAT_PACK32, ktx2::Format::E5B9G9R9_UFLOAT_PACK32),
        (Format::BC6H_UFLOAT_BLOCK, ktx2::Format::BC6H_UFLOAT_BLOCK),
    ];
    assert_eq!(named.map(|(ours, _)| ours), FORMATS);
    for (ours, theirs) in named {
        assert_eq!(ours.vk_format(), theirs.value(), "{ours:?}");
        assert_eq!(Format::from_vk_format(theirs.value()), Some(ours));
    }
    assert_eq!(Format::from_vk_format(ktx2::Format::BC1_RGB_UNORM_BLOCK.value()), None, "the check itself");
}

#[test]
fn descriptor_says_linear_rec_709_signed_floats() {
    let levels = level_data(Format::R16G16B16A16_SFLOAT, 4, 6);
    let bytes = write(&texture(Format::R16G16B16A16_SFLOAT, 4, 6, &levels));
    let reader = ktx2::Reader::new(&bytes).expect("the crate reads it");
    assert_eq!(reader.color_model(), Some(ktx2::ColorModel::RGBSDA));
    assert_eq!(reader.color_primaries(), Some(ktx2::ColorPrimaries::BT709));
    assert_eq!(reader.transfer_function(), Some(ktx2::TransferFunction::Linear));
    let samples = &reader.basic_dfd().expect("a basic block").sample_information;
    assert_eq!(samples.len(), 4);
    let offsets: Vec<u16> = samples.iter().map(|sample| sample.bit_offset).collect();
    assert_eq!(offsets, [0, 16, 32, 48]);
}

#[test]
fn keys_are_sorted_and_standard_ones_added() {
    let levels = level_data(Format::R32G32_SFLOAT, 2, 1);
    let bytes = write(&texture(Format::R32G32_SFLOAT, 2, 1, &levels));
    let keys: Vec<String> =
        read(&bytes).expect("our own file").key_values.into_iter().map(|(key, _)| key).collect();
    assert_eq!(keys, ["Akey", "KTXorientation", "KTXwriter", "kilnSource"]);
    let reader = ktx2::Reader::new(&bytes).expect("the crate reads it");
    assert_eq!(reader.writer(), Some("Kiln\0"));
}

#[test]
fn levels_are_aligned_and_the_smallest_stands_first() {
    for format in FORMATS {
        let levels = level_data(format, 8, 6);
        let bytes = write(&texture(format, 8, 6, &levels));
        let offset = |level: usize| {
            let start = 80 + 24 * level;
            u64::from_le_bytes(bytes[start..start + 8].try_into().expect("eight bytes")) as usize
        };
        for level in 0..levels.len() {
            assert!(offset(level).is_multiple_of(format.block_bytes()) && offset(level).is_multiple_of(4));
            assert!(level == 0 || offset(level) < offset(level - 1));
        }
    }
}

#[test]
fn cube_keeps_faces_and_drops_alpha() {
    let rgb: Vec<f32> = (0..6 * 3).map(|index| index as f32).collect();
    let level = Format::R16G16B16A16_SFLOAT.encode(&rgb, 3);
    let bytes = write(&texture(Format::R16G16B16A16_SFLOAT, 1, 6, &[level]));
    let back = read(&bytes).expect("our own file");
    assert_eq!(back.cube(0).expect("a cube").rgb, rgb);
    assert_eq!(Format::R16G16B16A16_SFLOAT.decode(&back.levels[0])[3], 1.0, "alpha is opaque");
    assert_eq!(back.image(0), Err(KtxError::NoSuchLevel { level: 0, faces: 1 }));
    assert_eq!(back.cube(1), Err(KtxError::NoSuchLevel { level: 1, faces: 6 }));
}

#[test]
fn every_truncation_and_every_changed_header_byte_is_survived() {
    let levels = level_data(Format::R16G16_SFLOAT, 4, 1);
    let bytes = write(&texture(Format::R16G16_SFLOAT, 4, 1, &levels));
    for end in 0..bytes.len() {
        assert!(read(&bytes[..end]).is_err(), "{end} bytes");
    }
    for position in 0..80 + 24 * 3 {
        for value in [0, 1, 0x7f, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[position] = value;
            if let Ok(texture) = read(&damaged) {
                assert!(texture.levels.iter().map(Vec::len).sum::<usize>() <= bytes.len());
            }
        }
    }
}

#[test]
fn files_of_others_are_read_or_named() {
    let Some(folder) = corpus("files_of_others_are_read_or_named") else { return };
    let load =
        |name: &str| read(&std::fs::read(folder.join("cube/magnum-dds-ktx2").join(name)).expect("a file"));
    let image = load("KtxImporter/Test/2d-rgbf32.ktx2").expect("three channels of binary32");
    assert_eq!((image.format, image.faces), (Format::R32G32B32_SFLOAT, 1));
    assert_eq!(load("KtxImporter/Test/cubemap.ktx2"), Err(KtxError::Format(29)));
    assert!(load("KtxImporter/Test/3d.ktx2").is_err());
    assert!(load("KtxImporter/Test/version1.ktx").is_err());
}
