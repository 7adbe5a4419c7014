//! Packed texels against their specifications, and BC6H against crate `bcdec_rs`.

use super::{Random, check_within};
use crate::texel::{bc6h, r11g11b10, rgb9e5};
use crate::{Cancel, Cancelled};
use std::sync::atomic::AtomicI64;

/// The RGB9E5 word by trying every exponent: the smallest one at which no mantissa overflows.
fn rgb9e5_by_search(rgb: [f64; 3]) -> u32 {
    let rgb = rgb.map(|value| value.clamp(0.0, 65408.0));
    let mantissas =
        |exponent: i32| rgb.map(|value| libm::floor(value * libm::exp2(f64::from(24 - exponent)) + 0.5));
    let exponent = (0..32).find(|&e| mantissas(e).iter().all(|&m| m <= 511.0)).expect("clamped");
    let [r, g, b] = mantissas(exponent).map(|m| m as u32);
    (exponent as u32) << 27 | b << 18 | g << 9 | r
}

fn random_value(random: &mut Random) -> f64 {
    libm::exp2(random.unit() * 36.0 - 19.0)
}

#[test]
fn rgb9e5_follows_the_formula_of_the_extension() {
    let mut random = Random(1);
    for _ in 0..20_000 {
        let rgb = std::array::from_fn(|_| random_value(&mut random));
        assert_eq!(u32::from_le_bytes(rgb9e5::encode(rgb)), rgb9e5_by_search(rgb), "{rgb:?}");
        let (back, brightest) =
            (rgb9e5::decode(rgb9e5::encode(rgb)), rgb.into_iter().fold(0.0, f64::max).min(65408.0));
        for (back, value) in back.into_iter().zip(rgb) {
            let tolerance = (brightest / 511.0).max(libm::exp2(-25.0));
            check_within("channel", f64::from(back), value.min(65408.0), tolerance);
        }
    }
}

#[test]
fn every_rgb9e5_word_with_a_full_mantissa_comes_back() {
    for exponent in 0..32_u32 {
        for mantissa in 256..512_u32 {
            let word = exponent << 27 | (mantissa / 3) << 18 | (mantissa - 200) << 9 | mantissa;
            let rgb = rgb9e5::decode(word.to_le_bytes()).map(f64::from);
            assert_eq!(u32::from_le_bytes(rgb9e5::encode(rgb)), word);
        }
    }
}

#[test]
fn packed_floats_hold_no_negatives_no_nan_and_saturate() {
    for codec in [|rgb| rgb9e5::decode(rgb9e5::encode(rgb)), |rgb| r11g11b10::decode(r11g11b10::encode(rgb))]
    {
        assert_eq!(codec([-1.0, f64::NAN, 0.0]), [0.0; 3]);
        let top = codec([f64::INFINITY, 1e9, 65504.0]);
        assert!(top.iter().all(|&value| (64512.0..=65408.0).contains(&value)), "{top:?}");
        assert_eq!(codec([1.0, 0.5, 2.0]), [1.0, 0.5, 2.0]);
    }
}

#[test]
fn every_finite_r11g11b10_channel_comes_back_and_others_go_to_the_nearest() {
    for bits in 0..(31_u32 << 6) {
        let rgb = r11g11b10::decode((bits << 11 | bits).to_le_bytes()).map(f64::from);
        assert_eq!(u32::from_le_bytes(r11g11b10::encode(rgb)), bits << 11 | bits);
        let above = r11g11b10::decode((bits + 1).to_le_bytes())[0];
        if above.is_finite() {
            let third = rgb[0] + (f64::from(above) - rgb[0]) / 3.0;
            assert_eq!(
                u32::from_le_bytes(r11g11b10::encode([third, 0.0, 0.0])),
                bits,
                "a third of a step up"
            );
            let two_thirds = rgb[0] + (f64::from(above) - rgb[0]) * 2.0 / 3.0;
            assert_eq!(u32::from_le_bytes(r11g11b10::encode([two_thirds, 0.0, 0.0])), bits + 1);
        }
    }
}

fn second_reader(block: [u8; 16], is_signed: bool) -> bc6h::Texels {
    let mut rgb = [0.0_f32; 48];
    bcdec_rs::bc6h_float(&block, &mut rgb, 12, is_signed);
    std::array::from_fn(|texel| [rgb[3 * texel], rgb[3 * texel + 1], rgb[3 * texel + 2]])
}

#[test]
fn any_bc6h_block_reads_as_another_decoder_reads_it() {
    let mut random = Random(2);
    let (mut modes, mut differing) = ([0; 32], 0);
    for _ in 0..50_000 {
        let block: [u8; 16] = std::array::from_fn(|_| random.next() as u8);
        modes[usize::from(block[0] & 31)] += 1;
        let [unsigned, signed] = [false, true].map(|is_signed| {
            let bits = |texels: bc6h::Texels| texels.map(|texel| texel.map(f32::to_bits));
            let ours = bits(bc6h::decode_block(block, is_signed));
            assert_eq!(ours, bits(second_reader(block, is_signed)), "{is_signed}: {block:02x?}");
            ours
        });
        differing += usize::from(unsigned != signed);
    }
    assert!(modes.iter().all(|&count| count > 1000), "every mode was met");
    assert!(differing > 25_000, "the check itself: signs matter");
}

/// Relative RMS and largest error, relative to value + mean.
fn bc6h_error(texels: &bc6h::Texels) -> f64 {
    let block = bc6h::encode_block(texels);
    let back = second_reader(block, false);
    assert_eq!(back, bc6h::decode_block(block, false));
    let (back, texels) = (back.as_flattened(), texels.as_flattened());
    let change2: f64 = back.iter().zip(texels).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let size2: f64 = texels.iter().map(|&v| f64::from(v).powi(2)).sum();
    (change2 / size2.max(f64::MIN_POSITIVE)).sqrt()
}

#[test]
fn smooth_blocks_are_nearly_exact_and_two_colours_cost_little() {
    let grey = |value: f32| [[value; 3]; 16];
    for value in [0.0, 1e-4, 0.18, 1.0, 300.0, 65504.0] {
        assert!(bc6h_error(&grey(value)) <= 1e-3, "{value}");
    }
    let gradient = std::array::from_fn(|i| [1.0 + i as f32 * 0.01, 0.5 + i as f32 * 0.005, 0.2]);
    assert!(bc6h_error(&gradient) <= 3e-3, "{}", bc6h_error(&gradient));
    let edge = std::array::from_fn(|i| if i % 4 < 2 { [8.0, 1.0, 0.5] } else { [0.05, 0.4, 3.0] });
    assert!(bc6h_error(&edge) <= 2e-2, "{}", bc6h_error(&edge));
    // Two lines far from each other: two regions hold them, with ends of 7 bits.
    let two_lines = std::array::from_fn(|i| {
        let t = (i / 4) as f32 * 0.05;
        if i % 4 < 2 { [1.0 + t, 1.0, 0.1] } else { [0.1, 0.3 + t, 1.0] }
    });
    assert!(bc6h_error(&two_lines) <= 5e-2, "{}", bc6h_error(&two_lines));
    let noise = Random(3).next();
    let mut random = Random(noise);
    let noise = std::array::from_fn(|_| std::array::from_fn(|_| random.unit() as f32));
    assert!(bc6h_error(&noise) > 0.02, "the check itself: noise in three channels does not fit");
}

#[test]
fn bc6h_never_panics_and_every_result_decodes_to_finite_values() {
    let mut random = Random(4);
    for round in 0..4000 {
        let texels: bc6h::Texels = std::array::from_fn(|_| {
            std::array::from_fn(|_| match random.below(8) {
                0 => f32::from_bits(random.next() as u32),
                1 => -1.0,
                2 => f32::INFINITY,
                _ => random_value(&mut random) as f32 * if round % 2 == 0 { 1.0 } else { 1e-6 },
            })
        });
        let block = bc6h::encode_block(&texels);
        assert!(bc6h::decode_block(block, false).as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0));
        assert_eq!(bc6h::decode_block(block, false), second_reader(block, false));
    }
}

#[test]
fn bc6h_pads_small_images_and_refuses_other_lengths() {
    for (width, height) in [(1, 1), (2, 2), (5, 3), (8, 8)] {
        let rgb: Vec<f32> =
            (0..width * height).flat_map(|i| [1.0 + (i % 5) as f32 * 0.01, 2.0, 0.5]).collect();
        let bytes = bc6h::encode(width, height, &rgb, Cancel::NEVER).expect("nobody cancels");
        let back = bc6h::decode(width, height, &bytes).expect("our own blocks");
        for (a, b) in back.iter().zip(&rgb) {
            check_within("texel", f64::from(*a), f64::from(*b), 0.02);
        }
        assert_eq!(bc6h::decode(width, height, &bytes[1..]), None);
        assert_eq!(bc6h::decode(width + 4, height, &bytes), None);
    }
    assert_eq!(bc6h::encode(4, 8, &[0.0; 96], Cancel::countdown(&AtomicI64::new(1))), Err(Cancelled));
}
