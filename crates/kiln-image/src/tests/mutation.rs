//! Seeded damage: decoders answer, they never panic, hang or return what was not asked for.
//!
//! `cargo xtask fuzz 1000000 7` makes a long run of it, with another seed (`KILN_FUZZ_COUNT`, `KILN_FUZZ_SEED`).

use super::{Random, containers, exr_files::half_size_chroma};
use crate::{
    Cancel, DecodeError, Image, Layout, Limits, Texels, decode, decode_environment, environment_from_faces,
    hdr, ktx2, png,
};
use exr::prelude::*;
use std::time::{Duration, Instant};

/// Mutants per file, unless `KILN_FUZZ_COUNT` says otherwise.
const MUTANTS: u64 = 1500;

fn number(variable: &str, otherwise: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")),
        Err(_) => otherwise,
    }
}

fn mutant_count() -> u64 {
    number("KILN_FUZZ_COUNT", MUTANTS)
}

fn random(seed: u64) -> Random {
    Random(number("KILN_FUZZ_SEED", 20_261_121).wrapping_add(seed << 32))
}

/// How long a mutant may take; a machine shared with others is slow at times.
const TIME_MAX: Duration = Duration::from_secs(1);

const LIMITS: Limits =
    Limits { width_max: 512, height_max: 512, texels_max: 1 << 16, channels_max: 16, parts_max: 8 };

fn gradient(width: usize, height: usize) -> Image {
    let texels = (0..width * height).flat_map(|i| [i as f32, (i * i % 97) as f32, 0.5]);
    Image::new(width, height, texels.collect()).expect("values fit")
}

/// An EXR with the given compression, in scan lines or tiles, written by the crate.
fn exr_file(compression: Compression, blocks: Blocks) -> Vec<u8> {
    let channels = SpecificChannels::rgb(|p: Vec2<usize>| {
        (p.0 as f32, f16::from_f32(p.1 as f32), (p.0 * p.1 % 7) as f32)
    });
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let layer = Layer::new((40, 20), LayerAttributes::named("main"), encoding, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    exr::image::Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .expect("written to memory");
    bytes.into_inner()
}

fn files() -> Vec<Vec<u8>> {
    let mut files =
        vec![hdr::encode(&gradient(40, 20)), hdr::encode(&gradient(6, 4)), png::encode_rgb8(8, 4, &[7; 96])];
    use Compression::{B44, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
    for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44] {
        files.push(exr_file(compression, Blocks::ScanLines));
    }
    files.push(exr_file(ZIP16, Blocks::Tiles(Vec2(16, 16))));
    files.push(half_size_chroma());
    files
}

/// Changes one to four bytes, cuts, doubles or swaps a piece.
fn mutate(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut mutant = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        // Headers are where sizes stand: half of the damage goes there.
        let range = if random.below(2) == 0 { mutant.len() } else { mutant.len().min(400) };
        let position = random.below(range);
        match random.below(6) {
            0 => mutant.truncate(position.max(1)),
            1 => mutant[position] ^= 1 << random.below(8),
            2 => mutant[position] = [0, 1, 0x7f, 0x80, 0xff][random.below(5)],
            3 => mutant.insert(position, random.next() as u8),
            4 => {
                mutant.remove(position);
                mutant.resize(mutant.len().max(1), 0);
            }
            _ => {
                let other = random.below(mutant.len());
                mutant.swap(position, other);
            }
        }
    }
    mutant
}

#[test]
fn mutants_decode_within_limits_or_are_refused() {
    let mut random = random(0);
    let (mut decoded, mut refused) = (0, 0);
    let mut slowest = Duration::ZERO;
    for file in files() {
        assert!(decode(&file, &LIMITS, Cancel::NEVER).is_ok(), "the sound file decodes");
        for _ in 0..mutant_count() {
            let mutant = mutate(&file, &mut random);
            let start = Instant::now();
            match decode(&mutant, &LIMITS, Cancel::NEVER) {
                Err(_) => refused += 1,
                Ok(result) => {
                    let image = result.image;
                    assert!(image.width <= 512 && image.height <= 512);
                    assert_eq!(image.rgb.len(), image.width * image.height * 3);
                    decoded += 1;
                }
            }
            slowest = slowest.max(start.elapsed());
        }
    }
    let least = mutant_count() / 3;
    assert!(
        decoded > least && refused > least,
        "{decoded} decoded, {refused} refused: the damage must matter"
    );
    assert!(slowest <= TIME_MAX, "slowest {slowest:?}");
}

#[test]
fn mutants_of_ktx2_are_read_or_refused() {
    let mut random = random(1);
    let level = ktx2::Format::R16G16B16A16_SFLOAT.encode(&gradient(4, 24).rgb, 3);
    let texture = ktx2::Texture {
        format: ktx2::Format::R16G16B16A16_SFLOAT,
        width: 4,
        height: 4,
        faces: 6,
        levels: vec![&level],
        key_values: Vec::new(),
    };
    let file = ktx2::write(&texture);
    let count = 4 * mutant_count();
    let refused = (0..count).filter(|_| ktx2::read(&mutate(&file, &mut random)).is_err()).count();
    assert!(refused as u64 > count / 4, "{refused} of {count} refused");
}

/// Containers in every format that is read, and flat files of each layout.
fn environments() -> Vec<(Vec<u8>, Option<Layout>)> {
    let hdr = |width: usize, height: usize| hdr::encode(&gradient(width, height));
    let flat = [
        (hdr(40, 20), None),
        (hdr(30, 5), None),
        (hdr(12, 9), None),
        (hdr(9, 12), None),
        (hdr(16, 16), Some(Layout::Octahedral)),
        (exr_file(Compression::ZIP16, Blocks::ScanLines), None),
    ];
    containers::files().into_iter().map(|file| (file, None)).chain(flat).collect()
}

#[test]
fn mutants_of_environments_decode_within_limits_or_are_refused() {
    let mut random = random(2);
    let (mut decoded, mut refused) = (0, 0);
    for (file, layout) in environments() {
        let read = |bytes: &[u8]| decode_environment(bytes, layout, &LIMITS, Cancel::NEVER);
        read(&file).expect("the sound file decodes");
        for _ in 0..mutant_count() {
            let mutant = mutate(&file, &mut random);
            let start = Instant::now();
            match read(&mutant) {
                Err(_) => refused += 1,
                Ok(mut result) => {
                    assert!(result.rgb().len() <= 3 * LIMITS.texels_max);
                    crate::repair_texels(&mut result, Cancel::NEVER).expect("nobody cancels");
                    assert!(result.rgb().iter().all(|value| value.is_finite()));
                    decoded += 1;
                }
            }
            let elapsed = start.elapsed();
            assert!(elapsed <= TIME_MAX, "{elapsed:?}");
        }
    }
    let least = mutant_count();
    assert!(
        decoded > least && refused > least,
        "{decoded} decoded, {refused} refused: the damage must matter"
    );
}

#[test]
fn damaged_face_among_six_is_named() {
    let mut random = random(3);
    let face = hdr::encode(&gradient(5, 5));
    let mut refused = 0;
    for _ in 0..mutant_count() {
        let damaged = random.below(6);
        let mut files = [(); 6].map(|()| face.clone());
        files[damaged] = mutate(&face, &mut random);
        match environment_from_faces(files.each_ref().map(Vec::as_slice), &LIMITS, Cancel::NEVER) {
            Ok(result) => assert_eq!(result.rgb().len(), 450),
            // A first face of another size makes the second one wrong.
            Err(DecodeError::Face { face, .. }) => {
                let named = crate::FACE_NAMES.iter().position(|name| *name == face);
                assert!(named == Some(damaged) || damaged == 0 && named == Some(1), "{face} for {damaged}");
                refused += 1;
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(refused > mutant_count() / 4, "{refused} refused");
}
