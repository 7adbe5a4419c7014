//! Seeded damage: decoders answer, they never panic, hang or return what was not asked for.

use super::Random;
use crate::{Cancel, Image, Limits, decode, hdr, ktx2, png};
use exr::prelude::*;
use std::time::{Duration, Instant};

/// Mutants per file; the suite stays fast and a longer run is one number away.
const MUTANTS: usize = 1500;

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
    let mut random = Random(20_261_121);
    let (mut decoded, mut refused) = (0, 0);
    let mut slowest = Duration::ZERO;
    for file in files() {
        assert!(decode(&file, &LIMITS, Cancel::NEVER).is_ok(), "the sound file decodes");
        for _ in 0..MUTANTS {
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
    assert!(decoded > 500 && refused > 500, "{decoded} decoded, {refused} refused: the damage must matter");
    assert!(slowest <= Duration::from_secs(1), "slowest {slowest:?}");
}

#[test]
fn mutants_of_ktx2_are_read_or_refused() {
    let mut random = Random(11);
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
    let refused = (0..20_000).filter(|_| ktx2::read(&mutate(&file, &mut random)).is_err()).count();
    assert!(refused > 5000, "{refused} refused");
}
