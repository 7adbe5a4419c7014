//! The measure against the slow reference, and against maps that are wrong.

use super::environments::{analyse, random, specular_level, sun};
use crate::{AnalysisRequest, BruteForce, Cancel, Lobe, reference_radiance};

#[test]
fn brute_force_agrees_with_the_slow_reference() {
    let lobes = [
        Lobe::Lambert,
        Lobe::Ggx { alpha: 1.0 / 64.0 },
        Lobe::Ggx { alpha: 0.25 },
        Lobe::Charlie { alpha: 0.25 },
    ];
    for map in [random(256, 128, 1), sun(256, 128, 60 * 256 + 255), random(10, 5, 3)] {
        let fast = BruteForce::new(&map, Cancel::NEVER).expect("nobody cancels");
        let axes = [
            [0.0, 1.0, 0.0],
            [0.6, 0.0, 0.8],
            fast.brightest(),
            kiln_sphere::panorama_direction(0.24, 60.5 / 128.0),
        ];
        for (lobe, axis) in lobes.iter().flat_map(|lobe| axes.iter().map(move |axis| (*lobe, *axis))) {
            let exact = reference_radiance(&map, lobe, axis);
            let found = fast.radiance(lobe, axis, Cancel::NEVER).expect("nobody cancels");
            for channel in 0..3 {
                let local = exact[channel] + 0.01 * fast.mean()[channel];
                let error = (found[channel] - exact[channel]).abs() / local;
                assert!(error <= 2e-4, "{lobe:?}, axis {axis:?}, width {}: {error}", map.width());
            }
        }
    }
}

#[test]
fn measure_sees_a_good_map_as_good_and_one_of_another_alpha_as_bad() {
    let map = random(256, 128, 5);
    let request = AnalysisRequest { alpha_min: 0.1, sheen_alpha_min: None, error: 1e-4 };
    let level = specular_level(&analyse(&map, &request), 0.1, 16);
    let fast = BruteForce::new(&map, Cancel::NEVER).expect("nobody cancels");
    let measure = |alpha: f64| fast.measure(&level.cube, Lobe::Ggx { alpha }, Cancel::NEVER).expect("runs");
    assert!(measure(0.1).rms <= 1e-4, "{:?}", measure(0.1));
    assert!(measure(0.101).rms > 1e-3, "{:?}", measure(0.101));
    assert!(measure(0.1).probes >= 8);
}

#[test]
fn measure_counts_a_nan_texel_as_the_worst() {
    let map = random(32, 16, 5);
    let request = AnalysisRequest { alpha_min: 0.25, sheen_alpha_min: None, error: 1e-3 };
    let mut cube = specular_level(&analyse(&map, &request), 0.25, 1).cube;
    cube.rgb[7] = f32::NAN;
    let fast = BruteForce::new(&map, Cancel::NEVER).expect("nobody cancels");
    let measured = fast.measure(&cube, Lobe::Ggx { alpha: 0.25 }, Cancel::NEVER).expect("runs");
    assert!(measured.rms.is_nan() && measured.largest.is_nan(), "{measured:?}");
}
