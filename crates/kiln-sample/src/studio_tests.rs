use super::{LIGHTS, soft_boxes};
use kiln_image::{Cancel, check_texels};

#[test]
fn studio_is_radiance_with_a_peak_worth_the_dynamic_range() {
    for width in [2, 64, 512] {
        let report = check_texels(soft_boxes(width).image(), Cancel::NEVER).expect("nobody cancels");
        assert!(report.is_radiance(), "{width}: {report:?}");
    }
    let peak = soft_boxes(512).max_value();
    assert!((20.0..=40.0).contains(&peak), "{peak}");
}

#[test]
fn every_light_is_seen_at_its_place() {
    let panorama = soft_boxes(512);
    for light in LIGHTS {
        let (x, y) = crate::panorama::texel_of(crate::panorama::normalize(light.position), 512, 256);
        let centre = f64::from(panorama.texel(x, y)[1]);
        assert!(centre > 0.8 * light.peak, "{:?}: {centre} of {}", light.position, light.peak);
    }
}

#[test]
fn key_light_falls_off_towards_its_edge_without_a_step() {
    let panorama = soft_boxes(1024);
    let key = crate::panorama::normalize(LIGHTS[0].position);
    let (x, y) = crate::panorama::texel_of(key, 1024, 512);
    let values: Vec<f32> = (0..60).map(|i| panorama.texel(x + i, y)[1]).collect();
    assert!(values[0] > values[30] && values[30] > values[50], "{values:?}");
    assert!(values.windows(2).all(|pair| (pair[0] - pair[1]).abs() <= 6.0), "{values:?}");
}

#[test]
fn mean_does_not_depend_on_the_resolution() {
    let mean = |width| {
        check_texels(soft_boxes(width).image(), Cancel::NEVER).expect("nobody cancels").mean_luminance
    };
    assert!((mean(256) / mean(1024) - 1.0).abs() <= 0.01);
}
