//! Environments that hold what others choke on.

use kiln_bake::{Lobe, TexelFormat, decode_level, encode_level, irradiance_sh, scale_log2, sh, skybox};
use kiln_image::{Cancel, Cube, TexelPolicy, check_texels, repair_texels};

use crate::maps::{
    Random, baked, baked_error, check_radiance, flattened, of_texels, panorama, sky, with_sun,
};
use crate::record::{hold, relative, worst};

const GGX: Lobe = Lobe::Ggx { alpha: 0.25 };

/// Encodes as a bake does and reads it back; nothing may have been cut off on the way.
fn stored_error(cube: &Cube, format: TexelFormat) -> f64 {
    let max = cube.rgb.iter().copied().fold(0.0, f32::max);
    let scale = scale_log2(max);
    let encoded = encode_level(cube, format, scale, Cancel::NEVER).unwrap();
    assert_eq!(encoded.clamped_flux, 0.0, "{format:?} cut values off");
    let stored = decode_level(&encoded.bytes, cube.face_size, format, scale).unwrap();
    check_radiance(&stored);
    let brightest = f64::from(max);
    worst(
        flattened(&stored)
            .zip(flattened(cube))
            .map(|(stored, wanted)| relative(stored, wanted, 1e-3 * brightest)),
    )
}

#[test]
fn values_above_65504_are_scaled_and_never_infinite() {
    let mut random = Random(1);
    let mut errors = Vec::new();
    for value in [65504.0, 65505.0, 65519.9, 65520.0, 1e6, random.between(65504.0, 1e9) as f32] {
        let map = baked(&with_sun(32, value, sky), GGX, 8, 1e-3);
        check_radiance(&map.cube);
        let levels = skybox(&with_sun(32, value, sky), 16, Cancel::NEVER).unwrap();
        errors.push(stored_error(&levels[0], TexelFormat::Rgba16Float));
        assert!(half::f16::from_f32(65520.0).is_infinite(), "unscaled it would be");
    }
    hold("values_above_65504_are_scaled_and_never_infinite", "encoded", worst(errors));
}

#[test]
fn radiance_of_5_8e37_is_baked_and_stored() {
    let bright = with_sun(16, 5.8e37, |direction| sky(direction).map(|value| value * 1e37));
    let error =
        worst([GGX, Lobe::Lambert, Lobe::Charlie { alpha: 0.25 }].map(|lobe| baked_error(&bright, lobe, 8)));
    hold("radiance_of_5_8e37_is_baked_and_stored", "f64", error);
    let map = baked(&bright, GGX, 8, 1e-3);
    hold(
        "radiance_of_5_8e37_is_baked_and_stored",
        "encoded",
        stored_error(&map.cube, TexelFormat::Rgb9e5Ufloat),
    );
}

#[test]
fn denormal_radiance_is_neither_lost_nor_blown_up() {
    // 1e-40 is 71362 steps of the smallest f32.
    let dark = panorama(16, |direction| sky(direction).map(|value| value * 1e-40));
    assert!(dark.rgb().iter().all(|value| value.is_subnormal()));
    hold("denormal_radiance_is_neither_lost_nor_blown_up", "f64", baked_error(&dark, GGX, 8));
}

#[test]
fn nan_infinite_and_negative_texels_are_found_before_they_are_mended() {
    let mut random = Random(2);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, -1e-30] {
        let mut broken = panorama(16, sky);
        let at = random.bits() as usize % broken.rgb().len();
        broken.rgb_mut()[at] = value;
        let report = check_texels(&broken, Cancel::NEVER).unwrap();
        let counts = [report.nan.count, report.infinite.count, report.negative.count];
        let expected = [value.is_nan(), value.is_infinite(), value < 0.0].map(usize::from);
        assert_eq!(counts, expected, "{value} at {at}");
        assert!(TexelPolicy::Error.apply(&mut broken.clone(), Cancel::NEVER).is_err(), "{value}");
        let repair = repair_texels(&mut broken, Cancel::NEVER).unwrap();
        assert_eq!(repair.non_finite + repair.negative, 1, "{value}: nothing else is touched");
        assert!(broken.rgb()[at].is_finite() && broken.rgb()[at] >= 0.0);
        check_radiance(&baked(&broken, GGX, 4, 1e-3).cube);
    }
}

#[test]
fn black_environment_gives_black_maps() {
    let black = panorama(16, |_| [0.0; 3]);
    for lobe in [GGX, Lobe::Lambert, Lobe::Charlie { alpha: 0.25 }] {
        let map = baked(&black, lobe, 4, 1e-3);
        assert!(map.cube.rgb.iter().all(|value| *value == 0.0), "{lobe:?}");
        assert_eq!([map.accuracy.rms_bound, map.accuracy.clamped_flux].map(|it| it.is_finite()), [true; 2]);
        for format in TexelFormat::ALL {
            let encoded = encode_level(&map.cube, format, 0, Cancel::NEVER).unwrap();
            assert_eq!(
                [encoded.rounding_rms, encoded.rounding_max, encoded.clamped_flux],
                [0.0; 3],
                "{format:?}"
            );
        }
    }
}

#[test]
fn single_texels_and_images_of_one_row_light_from_everywhere() {
    // Two texels, one row: the smallest panorama; and a cube of one texel a face.
    let smallest = of_texels(1, vec![3.0; 6]);
    let error = |cube: &Cube| worst(flattened(cube).map(|value| relative(value, 3.0, 1.0)));
    let mut errors = vec![];
    for lobe in [GGX, Lobe::Lambert, Lobe::Charlie { alpha: 0.25 }] {
        errors.push(error(&baked(&smallest, lobe, 4, 1e-3).cube));
    }
    let cube = Cube::new(1, vec![3.0; 18]).unwrap();
    let from_cube = kiln_bake::panorama_of_cube(&cube, Cancel::NEVER).unwrap();
    errors.push(error(&baked(&from_cube, GGX, 1, 1e-3).cube));
    errors.push(error(&skybox(&smallest, 1, Cancel::NEVER).unwrap()[0]));
    hold("single_texels_and_images_of_one_row_light_from_everywhere", "f64", worst(errors));
}

#[test]
fn sun_of_1e7_on_black_is_exact_at_every_roughness() {
    let sun = with_sun(64, 1e7, |_| [0.0; 3]);
    let errors = [0.004, 0.02, 0.1, 0.5, 1.0].map(|alpha| baked_error(&sun, Lobe::Ggx { alpha }, 16));
    hold("sun_of_1e7_on_black_is_exact_at_every_roughness", "f64", worst(errors));
    let map = baked(&sun, Lobe::Ggx { alpha: 0.1 }, 16, 1e-3);
    assert!(map.accuracy.bright_texels > 0, "the sun leaves through its own door");
}

#[test]
fn sizes_that_are_no_power_of_two_are_as_good_as_others() {
    let errors = [3, 7, 37, 61].map(|height| baked_error(&panorama(height, sky), GGX, 12));
    hold("sizes_that_are_no_power_of_two_are_as_good_as_others", "f64", worst(errors));
}

#[test]
fn harmonics_of_extreme_light_are_finite() {
    for value in [1e7, 5.8e37, f32::MAX] {
        let bright = with_sun(16, value, |_| [0.0; 3]);
        let request = kiln_bake::AnalysisRequest { alpha_min: 0.5, sheen_alpha_min: None, error: 1e-3 };
        let analysis = kiln_bake::analyse(&bright, &request, Cancel::NEVER).unwrap();
        for harmonics in [sh(&analysis, 2), irradiance_sh(&analysis)] {
            assert!(harmonics.coefficients.iter().flatten().all(|c| c.is_finite()), "{value}: {harmonics:?}");
            assert!(harmonics.coefficients[0][0] > 0.0);
        }
    }
}
