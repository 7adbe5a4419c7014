//! Spherical harmonics of higher orders, and the window against their negative lobes.

use super::cancelled_step_ends_soon::check;
use super::environments::{analyse, check_within, panorama, random, sun};
use crate::patch::Patch;
use crate::{AnalysisRequest, Cancel, Deringed, ShCoefficients, dering, sh};
use kiln_image::Panorama;
use kiln_sphere::{panorama_direction, real_harmonics};
use std::f64::consts::PI;

const REQUEST: AnalysisRequest = AnalysisRequest { alpha_min: 1.0, sheen_alpha_min: None, error: 1e-2 };

fn radiance(map: &Panorama, order: usize) -> ShCoefficients {
    sh(&analyse(map, &REQUEST), order)
}

fn deringed(sh: &ShCoefficients) -> Deringed {
    dering(sh, Cancel::NEVER).expect("nobody cancels")
}

/// A sun of one texel, `peak` over `floor`, of its own hue.
fn sun_over(peak: f32, floor: f32, index: usize) -> Panorama {
    panorama(64, 32, |i| if i == index { [peak, 0.8 * peak, 0.5 * peak] } else { [floor; 3] })
}

/// Least value of any channel over its mean on a grid that shares no point with the search's.
fn lowest_over_mean(sh: &ShCoefficients) -> f64 {
    let mean = sh.coefficients[0].map(|c| c / (4.0 * PI).sqrt());
    let mut lowest = f64::INFINITY;
    for row in 0..=180 {
        for column in 0..360 {
            let value = sh.evaluate(panorama_direction(f64::from(column) / 360.0, f64::from(row) / 180.0));
            for channel in 0..3 {
                lowest = lowest.min(value[channel] / mean[channel]);
            }
        }
    }
    lowest
}

#[test]
fn irradiance_of_a_sun_is_nowhere_negative_after_the_window() {
    for floor in [0.0, 1.0] {
        for index in [0, 9 * 64 + 13, 20 * 64 + 63] {
            for order in [2, 3, 4, 6, 8] {
                let irradiance = radiance(&sun_over(1e7, floor, index), order).to_irradiance();
                let result = deringed(&irradiance);
                let what = format!("floor {floor}, texel {index}, order {order}");
                assert!(lowest_over_mean(&irradiance) < -1e-3, "{what}: it needs the window");
                assert!(lowest_over_mean(&result.sh) >= -2e-9, "{what}: {result:?}");
                assert!(result.strength > 0.0 && result.minimum_before[0] < 0.0, "{what}");
                assert_eq!(result.sh.coefficients[0], irradiance.coefficients[0], "{what}: flux");
                let mean = irradiance.coefficients[0].map(|c| c / (4.0 * PI).sqrt());
                let touches = (0..3).any(|c| result.minimum_after[c] <= 1e-6 * mean[c]);
                assert!(touches, "{what}: no stronger than needed, {:?}", result.minimum_after);
            }
        }
    }
}

#[test]
fn half_the_window_is_not_enough() {
    let irradiance = radiance(&sun_over(1e7, 1.0, 9 * 64 + 13), 2).to_irradiance();
    let strength = 0.5 * deringed(&irradiance).strength;
    let factors: Vec<f64> = [0.0, 2.0, 6.0].iter().map(|l| 1.0 / (1.0 + strength * l * l)).collect();
    assert!(lowest_over_mean(&irradiance.scaled_by_degree(&factors)) < -1e-3);
}

#[test]
fn radiance_of_a_sun_is_derung_too() {
    let result = deringed(&radiance(&sun_over(1e5, 1.0, 700), 4));
    assert!(lowest_over_mean(&result.sh) >= -2e-9);
    assert!(result.strength > deringed(&radiance(&sun_over(1e5, 1.0, 700), 4).to_irradiance()).strength);
}

#[test]
fn nothing_negative_means_no_window_and_the_same_bits() {
    for map in [panorama(16, 8, |_| [1.0; 3]), random(16, 8, 3)] {
        let irradiance = radiance(&map, 2).to_irradiance();
        let result = deringed(&irradiance);
        assert_eq!((result.strength, &result.sh), (0.0, &irradiance));
        assert!(result.minimum_before.iter().all(|&value| value > 0.0));
    }
}

#[test]
fn stated_minimum_is_the_least_value_on_the_sphere() {
    let irradiance = radiance(&sun(64, 32, 700), 5).to_irradiance();
    let mean = irradiance.coefficients[0].map(|c| c / (4.0 * PI).sqrt());
    let stated =
        (0..3).map(|c| deringed(&irradiance).minimum_before[c] / mean[c]).fold(f64::INFINITY, f64::min);
    let on_grid = lowest_over_mean(&irradiance);
    assert!(stated <= on_grid && stated >= on_grid - 1e-3, "{stated} {on_grid}");
}

#[test]
fn black_light_and_negative_light_need_no_window() {
    for value in [0.0, -1.0] {
        let mut irradiance = radiance(&panorama(8, 4, |_| [1.0; 3]), 2);
        irradiance.coefficients.fill([value; 3]);
        let result = deringed(&irradiance);
        assert_eq!((result.strength, &result.sh), (0.0, &irradiance));
    }
}

/// ∫ f Y_lm dω over constant patches, each by a product Gauss rule.
fn brute_force(map: &Panorama, order: usize, nodes: usize) -> Vec<[f64; 3]> {
    let mut sum = vec![[0.0; 3]; (order + 1) * (order + 1)];
    for index in 0..map.width() * map.height() {
        let texel = map.texel(index % map.width(), index / map.width());
        for node in Patch::of_texel(map.width(), map.height(), index).nodes(nodes) {
            for (sum, basis) in sum.iter_mut().zip(real_harmonics(node.direction, order)) {
                for channel in 0..3 {
                    sum[channel] += f64::from(texel[channel]) * basis * node.solid_angle_sr;
                }
            }
        }
    }
    sum
}

/// Largest difference of two sets of coefficients.
fn difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn every_order_matches_brute_force_over_the_patches() {
    let map = random(12, 6, 8);
    let analysis = analyse(&map, &REQUEST);
    for order in 0..=8 {
        let exact = brute_force(&map, order, 8);
        let error = difference(&sh(&analysis, order).coefficients, &exact);
        assert!(error <= 1e-9, "order {order}: {error}");
    }
    assert!(
        difference(&sh(&analysis, 8).coefficients, &brute_force(&map, 8, 1)) > 1e-3,
        "points are no patches"
    );
    assert_eq!(sh(&analysis, 9).order, 8, "more is cut");
}

#[test]
fn irradiance_scales_each_degree_by_lamberts_spectrum() {
    let radiance = radiance(&random(12, 6, 8), 8);
    let lambert = [1.0, 2.0 / 3.0, 0.25, 0.0, -1.0 / 24.0, 0.0, 1.0 / 64.0, 0.0, -1.0 / 128.0];
    let irradiance = radiance.to_irradiance();
    for (index, (radiance, irradiance)) in
        radiance.coefficients.iter().zip(irradiance.coefficients).enumerate()
    {
        check_within("E/π", irradiance[1], radiance[1] * lambert[index.isqrt()], 1e-12);
    }
}

#[test]
fn search_ends_soon_after_it_is_cancelled() {
    let irradiance = radiance(&sun_over(1e7, 1.0, 700), 3).to_irradiance();
    check(16, |cancel| Some(dering(&irradiance, cancel).ok()?.strength.to_le_bytes().to_vec()));
}
