//! Texels that hold little, and displays that hold less.

use half::f16;
use kiln_bake::{TexelFormat, decode_level, encode_level, scale_log2};
use kiln_image::sheet::khronos_neutral;
use kiln_image::texel::{bc6h, r11g11b10, rgb9e5};
use kiln_image::{Cancel, Cube};

use crate::maps::Random;
use crate::record::{hold, relative, worst};
use crate::support::{evaluate, first_infinite, gpu, grid};

/// A cube of one texel a face with these values.
fn texels(values: [f32; 18]) -> Cube {
    Cube::new(1, values.to_vec()).unwrap()
}

#[test]
fn halves_keep_subnormals_and_never_overflow() {
    let mut random = Random(13);
    let mut errors = Vec::new();
    for _ in 0..500 {
        // From the smallest subnormal half to the largest value that is stored without a scale.
        let values: [f32; 18] = std::array::from_fn(|_| random.between(6e-8, 65000.0) as f32);
        let encoded = encode_level(&texels(values), TexelFormat::Rgba16Float, 0, Cancel::NEVER).unwrap();
        let stored = decode_level(&encoded.bytes, 1, TexelFormat::Rgba16Float, 0).unwrap();
        assert_eq!(encoded.clamped_flux, 0.0);
        // A subnormal's step is 2⁻²⁴; half of it is all that may be lost.
        errors.extend(stored.rgb.iter().zip(values).map(|(stored, value)| {
            let step = f64::from(value).log2().floor().max(-14.0) - 10.0;
            (f64::from(*stored) - f64::from(value)).abs() / step.exp2()
        }));
    }
    // In steps: rounding to nearest is half of one.
    hold("halves_keep_subnormals_and_never_overflow", "encoded", worst(errors));
    for value in [65504.0, 65519.0, 65520.0, 1e30, f32::INFINITY] {
        let encoded = encode_level(&texels([value; 18]), TexelFormat::Rgba16Float, 0, Cancel::NEVER).unwrap();
        let stored = decode_level(&encoded.bytes, 1, TexelFormat::Rgba16Float, 0).unwrap();
        assert!(stored.rgb.iter().all(|value| value.is_finite()), "{value}");
        assert_eq!(encoded.clamped_flux > 0.0, value > 65504.0, "{value}: what is cut off is said");
        assert!(f16::from_f32(65520.0).is_infinite());
    }
    for value in [0.0, 65000.0, 65000.1, 1e30, f32::MAX, f32::NAN] {
        let scale = scale_log2(value);
        assert!(
            (0..=128).contains(&scale) && (value * (-f64::from(scale)).exp2() as f32).max(0.0) <= 65504.0,
            "{value}: {scale}"
        );
    }
}

#[test]
fn shared_exponent_beside_a_huge_channel_loses_what_it_must_and_no_more() {
    let mut random = Random(14);
    let mut errors = Vec::new();
    for _ in 0..2000 {
        let huge = random.between(1e-3, 65408.0);
        let rgb = [huge, random.between(1e-9, huge), random.between(1e-3 * huge, huge)];
        let stored = rgb9e5::decode(rgb9e5::encode(rgb));
        errors.extend(rgb.iter().zip(stored).map(|(value, stored)| (value - f64::from(stored)).abs() / huge));
    }
    for (rgb, expected) in [
        ([65408.0, 0.0, 0.0], [65408.0, 0.0, 0.0]),
        ([1e9, 1.0, 0.0], [65408.0, 0.0, 0.0]),
        ([f64::NAN, -1.0, f64::INFINITY], [0.0, 0.0, 65408.0]),
        ([1e-12, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ] {
        assert_eq!(rgb9e5::decode(rgb9e5::encode(rgb)), expected, "{rgb:?}");
        let packed = r11g11b10::decode(r11g11b10::encode(rgb));
        assert!(packed.iter().all(|value| value.is_finite() && *value >= 0.0), "{rgb:?}: {packed:?}");
    }
    hold("shared_exponent_beside_a_huge_channel_loses_what_it_must_and_no_more", "encoded", worst(errors));
}

#[test]
fn blocks_of_mixed_magnitude_stay_of_their_magnitude() {
    let mut random = Random(15);
    let mut errors = Vec::new();
    for case in 0..200 {
        let mut rgb: Vec<f32> = (0..48).map(|_| random.between(1e-3, 1.0) as f32).collect();
        let sun = random.between(1.0, 65000.0) as f32;
        let at = random.bits() as usize % 16;
        if case % 2 == 0 {
            rgb[3 * at..3 * at + 3].fill(sun);
        }
        let blocks = bc6h::encode(4, 4, &rgb, Cancel::NEVER).unwrap();
        let stored = bc6h::decode(4, 4, &blocks).unwrap();
        let most = rgb.iter().copied().fold(0.0, f32::max);
        // A line through noise of ten stops, straight in half-float bits, may end a stop or two above it: no more.
        assert!(
            stored.iter().all(|value| value.is_finite() && (0.0..=4.0 * most).contains(value)),
            "{case}: {stored:?}"
        );
        errors
            .extend(stored.iter().zip(&rgb).map(|(stored, value)| f64::from((stored - value).abs() / most)));
    }
    hold("blocks_of_mixed_magnitude_stay_of_their_magnitude", "encoded", worst(errors));
    for value in [f32::NAN, f32::INFINITY, -1.0, 1e30] {
        let blocks = bc6h::encode(4, 4, &[value; 48], Cancel::NEVER).unwrap();
        assert!(
            bc6h::decode(4, 4, &blocks).unwrap().iter().all(|it| it.is_finite() && *it >= 0.0),
            "{value}"
        );
    }
}

#[test]
fn tone_mapping_of_anything_is_a_display_value() {
    for value in [0.0, 1e-300, 0.08, 0.8, 1.0, 1e30, 1e300] {
        let mapped = khronos_neutral([value, 0.5 * value, 0.0]);
        assert!(mapped.iter().all(|x| (0.0..=1.0).contains(x)), "{value}: {mapped:?}");
    }
    let Some(gpu) = gpu() else { return };
    let values = [0.0, 1e-38, 1e-7, 0.08, 1.0, 100.0, 65504.0, 3e38];
    let light = grid(&[&values, &values, &[0.0, 0.5, 3e38]]);
    let mappers = [
        ("lib::colour::tone_map_pbr_neutral", "vec4f(tone_map_pbr_neutral(a.xyz), 0.0)"),
        ("lib::colour::tone_map_aces_fitted", "vec4f(tone_map_aces_fitted(a.xyz), 0.0)"),
        ("lib::colour::tone_map_aces_narkowicz", "vec4f(tone_map_aces_narkowicz(a.xyz), 0.0)"),
        ("lib::colour::tone_map_reinhard", "vec4f(tone_map_reinhard(a.xyz), 0.0)"),
        ("lib::colour::tone_map_agx", "vec4f(tone_map_agx(a.xyz), 0.0)"),
    ];
    for (function, call) in mappers {
        assert_eq!(first_infinite(gpu, function, call, &light), None);
    }
    // A sun is white, and no NaN that the clamp to the display's range makes black.
    let sun = "vec4f(tone_map_aces_fitted(a.xyz).x, tone_map_aces_narkowicz(a.xyz).x, tone_map_reinhard(a.xyz).x, tone_map_agx(a.xyz).x)";
    let mappers =
        "lib::colour::{tone_map_aces_fitted, tone_map_aces_narkowicz, tone_map_agx, tone_map_reinhard}";
    let white = evaluate(gpu, mappers, sun, &[[3e38; 8], [1e30; 8], [65504.0; 8]]);
    assert!(white.iter().flatten().all(|value| (0.8..=1.0).contains(value)), "{white:?}");
    let wild = grid(&[
        &[-1.0, -0.0, 0.0, 1e30, f32::INFINITY, f32::NEG_INFINITY],
        &[0.0, f32::INFINITY],
        &[-3e38, 1.0],
    ]);
    assert_eq!(first_infinite(gpu, "lib::colour::within_f16", "vec4f(within_f16(a.xyz), 0.0)", &wild), None);
    assert_eq!(first_infinite(gpu, "lib::colour::to_srgb", "vec4f(to_srgb(a.xyz), 0.0)", &wild), None);
    let unguarded = first_infinite(gpu, "lib::colour::luminance", "vec4f(luminance(a.xyz))", &wild);
    assert!(unguarded.is_some(), "the check sees an infinity");
}

#[test]
fn rounding_of_every_format_is_what_it_says() {
    let mut random = Random(16);
    let values: [f32; 18] = std::array::from_fn(|_| random.between(0.1, 10.0) as f32);
    for format in TexelFormat::ALL {
        let encoded = encode_level(&texels(values), format, 0, Cancel::NEVER).unwrap();
        let stored = decode_level(&encoded.bytes, 1, format, 0).unwrap();
        let change2: f64 = stored.rgb.iter().zip(values).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let size2: f64 = values.iter().map(|value| f64::from(*value).powi(2)).sum();
        let actual = (change2 / size2).sqrt();
        assert!(
            relative(encoded.rounding_rms, actual, 1e-9) <= 1e-6,
            "{format:?}: {} for {actual}",
            encoded.rounding_rms
        );
    }
}
