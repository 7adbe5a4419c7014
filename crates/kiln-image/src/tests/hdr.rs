//! Radiance pictures made by hand, each for one hard case.

use super::{Random, check_within, decode_default};
use crate::{DecodeError, Image, hdr};

/// A picture with the given header lines and resolution line.
fn picture(header: &str, resolution: &str, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\n{header}\n{resolution}\n").into_bytes();
    bytes.extend_from_slice(pixels);
    bytes
}

/// Exponent 136 makes the mantissas the values.
const UNIT: u8 = 136;

fn red_channel(bytes: &[u8]) -> Vec<f32> {
    decode_default(bytes).expect("a sound picture").image.rgb.into_iter().step_by(3).collect()
}

#[test]
fn all_eight_orientations_come_out_upright() {
    // The upright picture is 1 2 3 over 4 5 6.
    let cases = [
        ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
        ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
        ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
        ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
        ("+X 3 -Y 2", [1, 4, 2, 5, 3, 6]),
        ("+X 3 +Y 2", [4, 1, 5, 2, 6, 3]),
        ("-X 3 -Y 2", [3, 6, 2, 5, 1, 4]),
        ("-X 3 +Y 2", [6, 3, 5, 2, 4, 1]),
    ];
    for (resolution, stored) in cases {
        // Mantissas of 128 and more, so that none reads as a repetition.
        let pixels: Vec<u8> = stored.iter().flat_map(|&value| [127 + value, 0, 0, UNIT]).collect();
        let bytes = picture("", resolution, &pixels);
        let image = decode_default(&bytes).expect("a sound picture").image;
        assert_eq!((image.width, image.height), (3, 2), "{resolution}");
        assert_eq!(red_channel(&bytes), [128.0, 129.0, 130.0, 131.0, 132.0, 133.0], "{resolution}");
    }
}

#[test]
fn resolution_lines_that_are_none_are_refused() {
    let lines = [
        "",
        "-Y 2",
        "-Y 2 -Y 2",
        "-Y 2 +X 0",
        "-Y 2 +X -3",
        "-Y +2 +X 2",
        "Y 2 X 2",
        "-Y 2 +X 2 3",
        "-Y 99999999999999999999 +X 2",
        "-Y4 +X8888888A'8",
    ];
    for line in lines {
        let error = decode_default(&picture("", line, &[0; 16])).expect_err(line);
        assert!(matches!(error, DecodeError::Invalid { .. }), "{line}: {error}");
    }
}

#[test]
fn value_is_the_mantissa_without_half_a_step() {
    let bytes = picture("", "-Y 1 +X 3", &[128, 64, 255, 129, 200, 100, 50, 1, 128, 128, 128, 0]);
    let image = decode_default(&bytes).expect("a sound picture").image;
    assert_eq!(image.texel(0, 0), [1.0, 0.5, 255.0 / 128.0]);
    let smallest = f64::from(image.texel(1, 0)[2]);
    assert_eq!(smallest, 50.0 * 2.0_f64.powi(-135), "subnormal numbers are exact");
    assert_eq!(image.texel(2, 0), [0.0; 3], "exponent 0 is black whatever the mantissas");
}

#[test]
fn largest_exponent_stays_finite() {
    let bytes = picture("", "-Y 1 +X 1", &[255, 255, 255, 255]);
    assert_eq!(red_channel(&bytes), [(255.0 * 2.0_f64.powi(119)) as f32]);
}

#[test]
fn exposures_multiply_and_are_undone_and_colour_correction_too() {
    let header = "EXPOSURE=4\nEXPOSURE= 0.5\nCOLORCORR=1 2 4\n";
    let decoded = decode_default(&picture(header, "-Y 1 +X 1", &[128, 128, 128, UNIT])).expect("sound");
    assert_eq!(decoded.image.texel(0, 0), [64.0, 32.0, 16.0]);
    assert!(decoded.notes[0].contains("EXPOSURE 2"), "{:?}", decoded.notes);
}

#[test]
fn exposure_of_zero_or_nan_is_refused() {
    for line in [
        "EXPOSURE=0",
        "EXPOSURE=-1",
        "EXPOSURE=nan",
        "EXPOSURE=x",
        "EXPOSURE=",
        "COLORCORR=1 1",
        "PRIMARIES=1",
    ] {
        let error = decode_default(&picture(&format!("{line}\n"), "-Y 1 +X 1", &[128; 4])).expect_err(line);
        assert!(error.to_string().contains("header line 2"), "{error}");
    }
}

#[test]
fn primaries_of_zeros_are_absent_and_others_convert() {
    let pixels = [200, 100, 50, UNIT];
    let decode_with = |header: &str| decode_default(&picture(header, "-Y 1 +X 1", &pixels)).expect("sound");
    let plain = decode_with("");
    let zeros = decode_with("PRIMARIES=0 0 0 0 0 0 0 0\n");
    assert_eq!((&plain.image, &plain.notes), (&zeros.image, &zeros.notes));
    let rec_709 = decode_with("PRIMARIES=.64 .33 .30 .60 .15 .06 .3127 .3290\n");
    assert_eq!(plain.image, rec_709.image);
    // Rec. 2020 red lies outside Rec. 709: its green goes negative for a pure red.
    let wide = decode_with("PRIMARIES=.708 .292 .170 .797 .131 .046 .3127 .3290\n");
    assert!(wide.image.texel(0, 0)[0] > plain.image.texel(0, 0)[0] && wide.notes.len() == 1);
    let line = "PRIMARIES=.3 .3 .3 .3 .3 .3 .3 .3\n";
    assert!(decode_default(&picture(line, "-Y 1 +X 1", &pixels)).is_err(), "they span no space");
}

#[test]
fn xyze_white_becomes_white() {
    let decoded = decode_default(&picture("FORMAT=32-bit_rle_xyze\n", "-Y 1 +X 1", &[179, 179, 179, UNIT]))
        .expect("sound");
    for value in decoded.image.texel(0, 0) {
        check_within("white of equal energy", value.into(), 1.0, 1e-6);
    }
}

#[test]
fn pixaspect_and_gamma_are_noted_unless_one() {
    let decode_with = |header: &str| decode_default(&picture(header, "-Y 1 +X 1", &[128; 4])).expect("sound");
    assert_eq!(decode_with("PIXASPECT=2\nGAMMA=2.2\n").notes.len(), 2);
    assert_eq!(decode_with("PIXASPECT=1.0\nGAMMA=1\n").notes.len(), 0);
}

#[test]
fn unknown_format_is_refused() {
    assert!(decode_default(&picture("FORMAT=32-bit_rle_rgb9\n", "-Y 1 +X 1", &[128; 4])).is_err());
}

#[test]
fn old_runs_multiply_by_256_when_they_follow_each_other() {
    // One texel, repeated 2 + 1·256 times; then another.
    let pixels = [200, 0, 0, UNIT, 1, 1, 1, 2, 1, 1, 1, 1, 150, 0, 0, UNIT];
    let values = red_channel(&picture("", "-Y 1 +X 260", &pixels));
    assert_eq!(values[..259], [200.0; 259]);
    assert_eq!(values[259], 150.0);
}

#[test]
fn old_runs_that_overrun_or_repeat_nothing_are_refused() {
    let overrun = [200, 0, 0, UNIT, 1, 1, 1, 9];
    let nothing = [1, 1, 1, 3, 200, 0, 0, UNIT];
    let many = [&[200, 0, 0, UNIT][..], &[1, 1, 1, 0].repeat(20), &[1, 1, 1, 255]].concat();
    for pixels in [&overrun[..], &nothing, &many] {
        let error = decode_default(&picture("", "-Y 1 +X 4", pixels)).expect_err("a damaged run");
        assert!(error.to_string().contains("scanline 0"), "{error}");
    }
}

#[test]
fn new_runs_that_overrun_or_lie_about_the_width_are_refused() {
    let overrun = [2, 2, 0, 8, 128 + 9, 1];
    let literal_overrun = [2, 2, 0, 8, 9, 1, 2, 3, 4, 5, 6, 7, 8, 9];
    let width = [2, 2, 0, 9, 128 + 9, 1];
    for pixels in [&overrun[..], &literal_overrun, &width] {
        let error = decode_default(&picture("", "-Y 1 +X 8", pixels)).expect_err("a damaged run");
        assert!(matches!(error, DecodeError::Invalid { .. }), "{error}");
    }
}

#[test]
fn every_truncation_is_an_error_that_says_where() {
    let image = random_image(9, 3);
    let bytes = hdr::encode(&image);
    for end in 2..bytes.len() {
        let error = decode_default(&bytes[..end]).expect_err("a truncated picture");
        assert!(matches!(error, DecodeError::Truncated { byte, .. } if byte == end), "{end}: {error}");
    }
}

fn random_image(width: usize, height: usize) -> Image {
    let mut random = Random(7);
    let mut value = || {
        let magnitude = 2.0_f64.powi(random.below(60) as i32 - 30);
        (random.unit() * magnitude) as f32
    };
    Image::new(width, height, (0..width * height * 3).map(|_| value()).collect()).expect("values fit")
}

#[test]
fn encoding_keeps_every_texel_within_half_a_step() {
    for (width, height) in [(1, 1), (7, 2), (8, 2), (130, 3), (500, 2)] {
        let image = random_image(width, height);
        let decoded = decode_default(&hdr::encode(&image)).expect("just written").image;
        for (wanted, actual) in image.rgb.chunks_exact(3).zip(decoded.rgb.chunks_exact(3)) {
            let brightest = f64::from(wanted.iter().copied().fold(0.0, f32::max));
            for (&w, &a) in wanted.iter().zip(actual) {
                // Steps are 1/128 to 1/256 of the brightest channel's power of two.
                check_within("channel", a.into(), w.into(), brightest / 256.0);
            }
        }
    }
}

#[test]
fn encoding_what_was_decoded_changes_nothing() {
    let first = decode_default(&hdr::encode(&random_image(300, 4))).expect("just written").image;
    let second = decode_default(&hdr::encode(&first)).expect("just written").image;
    assert_eq!(first, second);
}

#[test]
fn encoder_survives_what_the_format_cannot_hold() {
    let hostile = [f32::NAN, -1.0, f32::INFINITY, f32::MAX, f32::MIN_POSITIVE, 0.0, 1e-45, 1.996_1, -0.0];
    let image = Image::new(3, 1, hostile.to_vec()).expect("nine values");
    let decoded = decode_default(&hdr::encode(&image)).expect("just written").image;
    assert!(decoded.rgb.iter().all(|value| value.is_finite() && *value >= 0.0), "{:?}", decoded.rgb);
    // 1.9961 rounds to 256/128: the mantissa overflows into the next exponent.
    check_within("mantissa overflow", decoded.texel(2, 0)[1].into(), 2.0, 0.0);
}

#[test]
fn runs_and_literals_of_every_length_come_back() {
    let mut random = Random(3);
    for _ in 0..200 {
        let width = 8 + random.below(400);
        let mut values = Vec::new();
        while values.len() < width {
            let value = 128.0 + random.below(100) as f32;
            let length_max = if random.below(3) == 0 { 200 } else { 3 };
            values.extend(std::iter::repeat_n([value, 200.0, value], 1 + random.below(length_max)));
        }
        values.truncate(width);
        let image = Image::new(width, 1, values.concat()).expect("values fit");
        assert_eq!(decode_default(&hdr::encode(&image)).expect("just written").image, image);
    }
}
