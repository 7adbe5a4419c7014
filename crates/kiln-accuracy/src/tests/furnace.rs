//! A constant environment gives constant maps.

use kiln_bake::RoughnessLaw;
use kiln_image::{Cancel, Image, Panorama};

use crate::passes::irradiance::irradiance_grid;
use crate::{Estimator, LobeKind, Source, chain, convolve, sampled_map};

const RADIANCE: f32 = 0.75;

fn panorama(texel: impl Fn(usize) -> f32) -> Panorama {
    let rgb = (0..64 * 32).flat_map(|index| [texel(index); 3]).collect();
    Panorama::new(Image::new(64, 32, rgb).unwrap()).unwrap()
}

/// Largest deviation of a map from the constant, relative.
fn deviation(rgb: &[f32]) -> f64 {
    let off = |value: &f32| f64::from((value / RADIANCE - 1.0).abs());
    rgb.iter().map(off).fold(0.0, |worst: f64, off| if off.is_nan() { f64::INFINITY } else { worst.max(off) })
}

/// What an estimator may make of a constant: those that divide by their weights rounding alone, the grid its rectangle rule.
fn bound(estimator: Estimator) -> f64 {
    if estimator == Estimator::Grid { 1.3 * estimator.usual_knob() } else { 1e-6 }
}

/// Deviation of all maps of all estimators, the worst of each.
fn worst(panorama: &Panorama) -> Vec<(Estimator, f64)> {
    let source = Source::new(panorama, 32, Cancel::NEVER).unwrap();
    let mut found = Vec::new();
    for estimator in Estimator::ALL {
        let mut worst = 0.0_f64;
        for kind in LobeKind::ALL.into_iter().filter(|kind| estimator.estimates(*kind)) {
            let levels = chain(kind, 32, &RoughnessLaw::Linear);
            if estimator == Estimator::Convolution {
                let (maps, _) = convolve(panorama, &levels, 1e-6, Cancel::NEVER).unwrap();
                worst = maps.iter().map(|map| deviation(&map.cube.rgb)).fold(worst, f64::max);
                continue;
            }
            for level in &levels {
                let knob = estimator.usual_knob();
                let map = sampled_map(estimator, &source, level, knob, Cancel::NEVER).unwrap().unwrap();
                worst = worst.max(deviation(&map.rgb));
            }
        }
        found.push((estimator, worst));
    }
    found
}

#[test]
fn constant_environment_gives_constant_maps() {
    for (estimator, worst) in worst(&panorama(|_| RADIANCE)) {
        assert!(worst <= bound(estimator), "{estimator:?}: {worst}");
    }
}

#[test]
fn furnace_sees_one_texel_that_is_brighter() {
    for (estimator, worst) in worst(&panorama(|index| if index == 700 { 100.0 * RADIANCE } else { RADIANCE }))
    {
        assert!(worst > bound(estimator), "{estimator:?}: {worst}");
    }
}

#[test]
fn grid_is_off_by_less_than_its_stated_bound_at_every_step() {
    let constant = |step: f64| irradiance_grid(step).taps.iter().map(|tap| tap.weight).sum::<f64>();
    for &step in Estimator::Grid.knobs() {
        let off = (constant(step) - 1.0).abs();
        assert!(off <= 1.3 * step, "step {step}: {off}");
    }
    assert!((constant(0.4) - 1.0).abs() > 1.3 * 0.0125, "the bound is not wide enough for anything");
}
