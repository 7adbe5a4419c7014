//! Reports and repairs.

use super::{check_texels, check_within};
use crate::{Cancel, Image, Repair, TexelError, TexelPolicy};

fn repair_texels(image: &mut Image) -> Repair {
    crate::repair_texels(image, Cancel::NEVER).expect("nobody cancels")
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
