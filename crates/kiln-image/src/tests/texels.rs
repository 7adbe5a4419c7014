//! Reports and repairs.

use super::{check_texels, check_within};
use crate::{
    Cancel, Cube, DecodedEnvironment, Environment, Image, Layout, LimitReport, Panorama, Repair, Shape,
    TexelError, TexelPolicy, Texels,
    colour::{Chromaticities, Gamut, REC_709, to_rec_709},
};
use std::f64::consts::PI;

fn repair_texels<T: Texels>(texels: &mut T) -> Repair {
    crate::repair_texels(texels, Cancel::NEVER).expect("nobody cancels")
}

fn limit_radiance<T: Texels>(texels: &mut T, max: f32) -> LimitReport {
    crate::limit_radiance(texels, max, Cancel::NEVER).expect("nobody cancels")
}

/// BT.2020's primaries.
const WIDE: Chromaticities =
    Chromaticities { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: REC_709.white };

/// A panorama of 4 × 2 texels stored in [`WIDE`].
fn wide(stored: [[f64; 3]; 8]) -> DecodedEnvironment {
    let gamut = Gamut::new(to_rec_709(WIDE).expect("a colour space")).expect("an inverse");
    let rgb = stored.iter().flat_map(|&texel| gamut.converted(texel).map(|value| value as f32)).collect();
    let panorama = Panorama::new(Image::new(4, 2, rgb).expect("values fit")).expect("2:1");
    let environment = Environment::Panorama(panorama);
    DecodedEnvironment {
        environment,
        layout: Layout::Equirect,
        format: "",
        notes: Vec::new(),
        gamut: Some(gamut),
    }
}

fn grey(width: usize, height: usize, value: f32) -> Image {
    Image::new(width, height, vec![value; width * height * 3]).expect("values fit")
}

#[test]
fn report_counts_channels_and_finds_the_worst() {
    let mut image = grey(4, 2, 1.0);
    image.rgb[0] = f32::NAN;
    image.rgb[4] = -2.0;
    image.rgb[7] = -5.0;
    image.rgb[9] = f32::NEG_INFINITY;
    image.rgb[14] = 70000.0;
    image.rgb[17] = 65504.0;
    let report = check_texels(&image);
    assert_eq!(
        [report.nan.count, report.infinite.count, report.negative.count, report.above_f16.count],
        [1, 1, 3, 1]
    );
    let worst = report.negative.worst.expect("three are negative");
    assert_eq!((worst.x, worst.y, worst.channel), (3, 0, 0), "−∞ is the worst");
    let above = report.above_f16.worst.expect("one is above");
    assert_eq!((above.x, above.y, above.channel, above.value), (0, 1, 2, 70000.0));
    assert_eq!((report.min, report.max), (-5.0, 70000.0));
    assert!(report.mean_luminance.is_finite() && !report.is_radiance());
}

#[test]
fn sound_image_is_radiance_and_no_policy_changes_it() {
    let image = grey(4, 2, 0.25);
    assert!(check_texels(&image).is_radiance());
    check_within("mean luminance", check_texels(&image).mean_luminance, 0.25, 1e-12);
    for policy in [TexelPolicy::Repair, TexelPolicy::Error, TexelPolicy::Keep] {
        let mut copy = image.clone();
        assert_eq!(policy.apply(&mut copy, Cancel::NEVER).expect("nothing is wrong").flux_moved, 0.0);
        assert_eq!(copy, image);
    }
}

#[test]
fn error_policy_names_the_texel_and_keep_keeps() {
    let mut image = grey(4, 2, 1.0);
    image.rgb[3 * 5 + 1] = f32::NAN;
    let error = TexelPolicy::Error.apply(&mut image, Cancel::NEVER).expect_err("a NaN");
    let TexelError::NoRadiance { place, .. } = error else { panic!("{error}") };
    assert_eq!((place.x, place.y, place.channel), (1, 1, 1));
    assert!(error.to_string().contains("(1, 1)"), "{error}");
    TexelPolicy::Keep.apply(&mut image, Cancel::NEVER).expect("keeping never fails");
    assert!(image.rgb[16].is_nan());
}

#[test]
fn repair_fills_from_finite_neighbours_and_reports_the_flux() {
    let mut image = grey(6, 5, 2.0);
    image.rgb[3 * 14] = f32::INFINITY;
    image.rgb[3 * 20 + 2] = -3.0;
    let repair = repair_texels(&mut image);
    assert_eq!((repair.non_finite, repair.negative), (1, 1));
    assert_eq!((image.rgb[3 * 14], image.rgb[3 * 20 + 2]), (2.0, 0.0));
    // Filled 2, lifted 3, of a total of 89 · 2.
    check_within("flux moved", repair.flux_moved, 5.0 / 178.0, 1e-12);
}

#[test]
fn repair_wraps_around_a_panorama_but_not_a_picture() {
    let repaired = |width: usize, height: usize| {
        let mut image = grey(width, height, 1.0);
        image.rgb[3 * (width - 1)] = 9.0; // right end of the top row
        image.rgb[0] = f32::NAN;
        repair_texels(&mut image);
        image.rgb[0]
    };
    check_within("panorama", repaired(8, 4).into(), (9.0 + 4.0) / 5.0, 1e-6);
    check_within("picture", repaired(9, 4).into(), 1.0, 1e-6);
}

#[test]
fn large_holes_close_and_an_image_of_nan_becomes_black() {
    let mut image = grey(600, 300, f32::NAN);
    image.rgb[..3].fill(4.0);
    let repair = repair_texels(&mut image);
    assert_eq!(repair.non_finite, 600 * 300 * 3 - 3);
    assert!(image.rgb.iter().all(|&value| value == 4.0));

    let mut image = grey(5, 5, f32::NAN);
    let repair = repair_texels(&mut image);
    assert!(image.rgb.iter().all(|&value| value == 0.0));
    assert_eq!(repair.flux_moved, 0.0);
}

#[test]
fn colours_outside_rec_709_are_told_from_ringing_and_kept() {
    let grey = [1.0; 3];
    let (green, dark_green) = ([0.0, 1.0, 0.0], [0.0, 1e-4, 1e-9]);
    let ringing = [-0.1, 1.0, 0.5];
    let mut image = wide([grey, green, grey, dark_green, grey, ringing, grey, grey]);
    let report = crate::check_texels(&image, Cancel::NEVER).expect("nobody cancels");
    // BT.2020's green has negative red and blue in Rec. 709; what rang has at least negative red.
    assert_eq!((report.out_of_gamut.count, report.negative.count), (4, 1));
    let worst = report.out_of_gamut.worst.expect("four are outside");
    assert_eq!((worst.face, worst.x, worst.y, worst.channel), (None, 1, 0, 0));
    assert!(TexelPolicy::Error.apply(&mut image.clone(), Cancel::NEVER).is_err());

    let before = image.clone();
    let repair = repair_texels(&mut image);
    assert_eq!((repair.negative, repair.out_of_gamut, repair.non_finite), (1, 4, 0));
    let texel = |image: &DecodedEnvironment, index: usize| [0, 1, 2].map(|c| image.rgb()[3 * index + c]);
    for index in [0, 1, 2, 3, 4, 6, 7] {
        assert_eq!(texel(&image, index), texel(&before, index), "texel {index} is as it was");
    }
    let stored = image.gamut.expect("one").stored(texel(&image, 5));
    for (value, wanted) in stored.into_iter().zip([0.0, 1.0, 0.5]) {
        check_within("stored value", value, wanted, 1e-6);
    }
    assert!(repair.flux_moved > 0.0);

    // Repaired is sound, and stays as it is.
    let again = image.clone();
    let second = repair_texels(&mut image);
    assert_eq!((second.negative, second.flux_moved), (0, 0.0));
    assert_eq!(image, again);
    assert!(crate::check_texels(&image, Cancel::NEVER).expect("nobody cancels").is_radiance());
    assert!(TexelPolicy::Error.apply(&mut image, Cancel::NEVER).is_ok());
}

/// The twin: with nothing converted, the same values are ringing.
#[test]
fn without_a_conversion_every_negative_is_ringing() {
    let mut image = wide([[0.0, 1.0, 0.0]; 8]);
    image.gamut = None;
    let report = crate::check_texels(&image, Cancel::NEVER).expect("nobody cancels");
    assert_eq!((report.out_of_gamut.count, report.negative.count), (0, 16));
    let repair = repair_texels(&mut image);
    assert_eq!((repair.out_of_gamut, repair.negative), (0, 16));
    assert!(image.rgb().iter().all(|&value| value >= 0.0));
}

#[test]
fn rounding_of_a_stored_zero_is_no_ringing_at_any_size() {
    for scale in [1e-30, 1.0, 1e30] {
        for stored in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1e-7]] {
            let image = wide([stored.map(|value| value * scale); 8]);
            let report = crate::check_texels(&image, Cancel::NEVER).expect("nobody cancels");
            assert_eq!(report.negative.count, 0, "{stored:?} times {scale}");
        }
    }
}

fn cube(face_size: usize, value: f32) -> Cube {
    Cube::new(face_size, vec![value; 18 * face_size * face_size]).expect("values fit")
}

#[test]
fn defects_of_a_cube_are_placed_on_their_face() {
    let mut cube = cube(4, 1.0);
    cube.rgb[((3 * 4 + 2) * 4 + 1) * 3 + 2] = -7.0;
    let report = crate::check_texels(&cube, Cancel::NEVER).expect("nobody cancels");
    let place = report.negative.worst.expect("one is negative");
    assert_eq!((place.face, place.x, place.y, place.channel), (Some(3), 1, 2, 2));
    let error = TexelPolicy::Error.apply(&mut cube, Cancel::NEVER).expect_err("one is negative").to_string();
    assert!(error.starts_with("texel (1, 2) of face -Y holds -7 in channel 2"), "{error}");
}

#[test]
fn hole_at_a_cubes_edge_is_filled_from_the_next_face() {
    // Texel (3, 1) of +Z lies beside texel (0, 1) of +X.
    let index = |face: usize, x: usize, y: usize| ((face * 4 + y) * 4 + x) * 3;
    let mut image = cube(4, 1.0);
    image.rgb[index(4, 3, 1)] = f32::NAN;
    for y in 0..3 {
        image.rgb[index(0, 0, y)] = 9.0;
    }
    repair_texels(&mut image);
    check_within("filled", image.rgb[index(4, 3, 1)].into(), (5.0 + 3.0 * 9.0) / 8.0, 1e-6);
    let mut far = cube(4, 1.0);
    far.rgb[index(4, 3, 1)] = f32::NAN;
    far.rgb[index(1, 0, 1)] = 9.0;
    repair_texels(&mut far);
    check_within("the other side does not count", far.rgb[index(4, 3, 1)].into(), 1.0, 1e-6);
    for size in [1, 2, 3] {
        let mut image = cube(size, 2.0);
        image.rgb[0] = f32::INFINITY;
        repair_texels(&mut image);
        assert!(image.rgb.iter().all(|&value| value == 2.0), "{size}");
    }
}

/// A light of one texel weighs what its solid angle is: the sum over a sphere of radiance 1 is 4π in every shape.
#[test]
fn flux_is_weighted_by_solid_angle() {
    let panorama = Panorama::new(grey(16, 8, 1.0)).expect("2:1");
    for (shape, before) in [
        (panorama.shape(), limit_radiance(&mut panorama.clone(), 2.0).flux_before),
        (cube(1, 1.0).shape(), limit_radiance(&mut cube(1, 1.0), 2.0).flux_before),
        (cube(5, 1.0).shape(), limit_radiance(&mut cube(5, 1.0), 2.0).flux_before),
        (grey(5, 4, 1.0).shape(), limit_radiance(&mut grey(5, 4, 1.0), 2.0).flux_before),
    ] {
        before.into_iter().for_each(|flux| check_within(&format!("{shape:?}"), flux, 4.0 * PI, 1e-12));
    }
    // A pole's texel weighs less than one at the equator, a corner's less than a centre's.
    let lost = |mut image: Panorama, y: usize| {
        image.rgb_mut()[3 * 16 * y] = 3.0;
        limit_radiance(&mut image, 1.0).flux_lost[0]
    };
    let ratio = lost(panorama.clone(), 3) / lost(panorama, 0);
    check_within("equator over pole", ratio, (3.5 * PI / 8.0).sin() / (0.5 * PI / 8.0).sin(), 1e-9);
    assert_eq!(Shape::Cube { face_size: 5 }, cube(5, 1.0).shape());
}

#[test]
fn limit_keeps_hue_and_says_what_it_took() {
    let mut image = grey(5, 4, 1.0);
    image.rgb[3 * 7..3 * 8].copy_from_slice(&[400.0, 100.0, 50.0]);
    image.rgb[3 * 9 + 1] = f32::NAN;
    let report = limit_radiance(&mut image, 100.0);
    assert_eq!(image.texel(2, 1), [100.0, 25.0, 12.5]);
    assert_eq!((report.limited.count, report.non_finite), (1, 1));
    let worst = report.limited.worst.expect("one");
    assert_eq!((worst.x, worst.y, worst.channel, worst.value), (2, 1, 0, 400.0));
    let weight = 4.0 * PI / 20.0;
    for (lost, wanted) in report.flux_lost.into_iter().zip([300.0, 75.0, 37.5]) {
        check_within("flux lost", lost, wanted * weight, 1e-9);
    }
    check_within("fraction", report.fraction_lost(), 412.5 / (550.0 + 18.0 * 3.0), 1e-9);
    let again = limit_radiance(&mut image, 100.0);
    assert_eq!((again.limited.count, again.fraction_lost()), (0, 0.0));
}
