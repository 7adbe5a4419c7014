//! Integrals against independent values, closed forms and a finer rule.

use crate::circles::Rule;
use crate::dfg::{Precision, albedo_average, dfg, dfg_ggx, dfg_multiscatter};
use crate::fits::{ErrorNorms, fit_error, fit_karis_mobile, fit_lazarov};
use crate::lobes::{Masking, d_ggx};
use crate::quadrature::gauss;
use crate::sheen::{SheenVisibility, sheen_albedo};
use std::f64::consts::{LN_2, PI};

/// Independent values; see the first lines of each file.
const LUT_GGX: &str = include_str!("../tests/data/lut_ggx.tsv");
const LUT_SHEEN: &str = include_str!("../tests/data/lut_sheen.tsv");

/// Passes only when `|actual - expected| <= tol`; written with `<=`, so NaN fails.
#[track_caller]
fn check_within(what: &str, actual: f64, expected: f64, tol: f64) {
    let error = (actual - expected).abs();
    assert!(error <= tol, "{what}: got {actual}, want {expected}, error {error} over {tol}");
}

fn rows(table: &'static str, name: &'static str) -> Vec<Vec<f64>> {
    let is_row = |line: &&str| !line.starts_with('#') && line.starts_with(name);
    let number = |field: &str| field.parse::<f64>().ok();
    table.lines().filter(is_row).map(|line| line.split('\t').filter_map(number).collect()).collect()
}

const ORACLES: [(&str, Masking); 3] = [
    ("ggx_height_correlated\t", Masking::SmithCorrelated),
    ("ggx_separable\t", Masking::SmithSeparable),
    ("ggx_schlick_k_half_r2\t", Masking::SchlickIbl),
];

/// Largest error / tolerance of `dfg` over all of the oracle's rows.
fn worst_ggx(tolerance_min: f64, dfg: impl Fn(Masking, f64, f64) -> [f64; 2]) -> f64 {
    let mut worst: f64 = 0.0;
    for (name, masking) in ORACLES {
        let rows = rows(LUT_GGX, name);
        assert_eq!(rows.len(), 121, "{name}");
        for row in rows {
            let [scale, bias] = dfg(masking, row[1], row[0]);
            let error = (scale - row[2]).abs().max((bias - row[3]).abs());
            let ratio = error / (2.0 * row[4]).max(tolerance_min);
            assert!(ratio.is_finite(), "{name} {row:?}");
            worst = worst.max(ratio);
        }
    }
    worst
}

#[test]
fn ggx_meets_every_oracle_row() {
    let worst =
        worst_ggx(1e-9, |masking, n_dot_v, roughness| dfg(masking, n_dot_v, roughness, Precision::Full));
    assert!(worst <= 1.0, "{worst} times the tolerance");
}

#[test]
fn table_rule_meets_the_oracle_less_closely() {
    let table = |masking, n_dot_v, roughness| dfg(masking, n_dot_v, roughness, Precision::Table);
    let worst = worst_ggx(5e-6, table);
    assert!(worst <= 1.0, "{worst} times the tolerance");
    assert!(worst_ggx(1e-9, table) > 10.0, "it is coarser, and the check sees it");
}

#[test]
fn oracle_check_rejects_a_slightly_wrong_roughness_and_another_masking() {
    let moved =
        |masking, n_dot_v, roughness: f64| dfg(masking, n_dot_v, roughness * 1.00001, Precision::Full);
    assert!(worst_ggx(1e-9, moved) > 10.0);
    let other = |_, n_dot_v, roughness| dfg_ggx(n_dot_v, roughness);
    assert!(worst_ggx(1e-9, other) > 1e6);
}

/// Largest error / tolerance over the sheen oracle's rows, unclamped and clamped.
fn worst_sheen(tolerance_min: f64, albedo: impl Fn(SheenVisibility, f64, f64) -> f64) -> [f64; 2] {
    let rows = rows(LUT_SHEEN, "");
    assert_eq!(rows.len(), 49);
    [(SheenVisibility::Unclamped, 2), (SheenVisibility::Clamped, 3)].map(|(visibility, column)| {
        rows.iter().fold(0.0, |worst: f64, row| {
            let error = (albedo(visibility, row[1], row[0]) - row[column]).abs();
            assert!(error.is_finite(), "{row:?}");
            worst.max(error / (2.0 * row[4]).max(tolerance_min))
        })
    })
}

#[test]
fn sheen_meets_every_oracle_row() {
    let exact =
        |visibility, n_dot_v, roughness| sheen_albedo(visibility, n_dot_v, roughness, Precision::Full);
    let worst = worst_sheen(1e-9, exact);
    assert!(worst[0] <= 1.0 && worst[1] <= 1.0, "{worst:?} times the tolerance");
    let table =
        |visibility, n_dot_v, roughness| sheen_albedo(visibility, n_dot_v, roughness, Precision::Table);
    let worst = worst_sheen(1e-6, table);
    assert!(worst[0] <= 1.0 && worst[1] <= 1.0, "{worst:?} times the table's tolerance");
}

#[test]
fn sheen_check_rejects_a_wrong_roughness_and_the_other_visibility() {
    let moved = |visibility, n_dot_v, roughness: f64| {
        sheen_albedo(visibility, n_dot_v, roughness * 1.00001, Precision::Full)
    };
    let worst = worst_sheen(1e-9, moved);
    assert!(worst[0] > 10.0 && worst[1] > 10.0, "{worst:?}");
    let unclamped =
        |_, n_dot_v, roughness| sheen_albedo(SheenVisibility::Unclamped, n_dot_v, roughness, Precision::Full);
    assert!(worst_sheen(1e-9, unclamped)[1] > 1e6);
}

#[test]
fn grazing_and_smooth_corners_agree_with_a_finer_rule() {
    let finer = Rule {
        polar: crate::quadrature::tanh_sinh(110, 3.7),
        azimuth: crate::quadrature::tanh_sinh(110, 3.7),
    };
    for n_dot_v in [0.0, 1e-300, 1e-12, 1e-6, 1e-4, 1e-3, 0.01, 1.0] {
        for roughness in [4e-4, 1e-3, 0.01, 0.1, 1.0f64] {
            for masking in Masking::ALL {
                let [scale, bias] = dfg(masking, n_dot_v, roughness, Precision::Full);
                let alpha = roughness * roughness;
                let fine = crate::dfg::integrate_ggx(masking, n_dot_v, alpha, &finer);
                let what = format!("{masking:?} {n_dot_v} {roughness}");
                check_within(&what, scale, fine[0], 1e-9);
                check_within(&what, bias, fine[1], 1e-9);
                let table = dfg(masking, n_dot_v, roughness, Precision::Table);
                check_within(&what, table[0] + table[1], scale + bias, 3e-5);
            }
        }
    }
}

#[test]
fn grazing_sheen_agrees_with_a_finer_rule() {
    let finer = Rule {
        polar: crate::quadrature::tanh_sinh(110, 3.7),
        azimuth: crate::quadrature::tanh_sinh(110, 3.7),
    };
    for n_dot_v in [0.0, 1e-12, 1e-6, 1e-4, 2e-3, 0.03, 0.25, 1.0] {
        for roughness in [0.05, 0.1, 0.3, 0.7, 1.0] {
            for visibility in [SheenVisibility::Clamped, SheenVisibility::Unclamped] {
                let what = format!("{visibility:?} {n_dot_v} {roughness}");
                let fine = crate::sheen::integrate_sheen(visibility, n_dot_v, roughness, &finer);
                check_within(
                    &what,
                    sheen_albedo(visibility, n_dot_v, roughness, Precision::Full),
                    fine,
                    1e-9,
                );
                let tolerance = match visibility {
                    SheenVisibility::Clamped => 1e-7,
                    SheenVisibility::Unclamped if n_dot_v >= 1e-3 => 5e-5,
                    SheenVisibility::Unclamped => 5e-4,
                };
                let table = sheen_albedo(visibility, n_dot_v, roughness, Precision::Table);
                check_within(&what, table, fine, tolerance);
                let other = sheen_albedo(visibility, n_dot_v, roughness * (1.0 - 1e-3), Precision::Table);
                assert!(n_dot_v >= 1e-3 || (other - fine).abs() > 1e-7, "{what}: another roughness differs");
            }
        }
    }
}

#[test]
fn nothing_is_infinite_or_above_one_anywhere() {
    for n_dot_v in [0.0, 1e-300, 1e-12, 1e-4, 0.5, 1.0, f64::NAN, -1.0, 2.0, f64::INFINITY] {
        for roughness in [0.0, 1e-9, 3e-4, 1e-3, 0.05, 1.0, f64::NAN, -1.0, 2.0, f64::INFINITY] {
            for precision in [Precision::Full, Precision::Table] {
                for masking in Masking::ALL {
                    let [bias, albedo] = dfg_multiscatter(masking, n_dot_v, roughness, precision);
                    assert!(
                        bias >= 0.0 && albedo >= bias && albedo <= 1.0 + 1e-4,
                        "{masking:?} {n_dot_v} {roughness} {bias} {albedo}"
                    );
                }
                for visibility in [SheenVisibility::Clamped, SheenVisibility::Unclamped] {
                    let albedo = sheen_albedo(visibility, n_dot_v, roughness, precision);
                    assert!((0.0..100.0).contains(&albedo), "{visibility:?} {n_dot_v} {roughness} {albedo}");
                }
            }
        }
    }
}

#[test]
fn roughness_zero_is_a_mirror_and_small_roughness_tends_to_it() {
    assert_eq!(dfg_ggx(0.0, 0.0), [0.0, 1.0], "a mirror at grazing view");
    for masking in Masking::ALL {
        for n_dot_v in [0.1, 0.5, 1.0] {
            let (mirror, smooth) =
                (dfg(masking, n_dot_v, 0.0, Precision::Full), dfg(masking, n_dot_v, 1e-3, Precision::Full));
            // SchlickLights' k moves by roughness/4, the others' terms by α² at most.
            let tolerance = if masking == Masking::SchlickLights { 2e-3 } else { 1e-5 };
            check_within("scale", smooth[0], mirror[0], tolerance);
            check_within("bias", smooth[1], mirror[1], tolerance);
        }
    }
    assert!((dfg_ggx(0.5, 0.3)[0] - dfg_ggx(0.5, 0.0)[0]).abs() > 1e-3, "a rough one is none");
}

#[test]
fn albedo_at_roughness_one_is_the_closed_form() {
    // D = 1/π and V = 1/(2 (n·l + n·v)), so E = 1 − μ ln((1 + μ)/μ) and its average 4/3 (1 − ln 2).
    for mu in [1e-6f64, 0.01, 0.3, 0.7, 1.0] {
        let [_, albedo] = dfg_multiscatter(Masking::SmithCorrelated, mu, 1.0, Precision::Full);
        check_within("E", albedo, 1.0 - mu * (1.0 / mu).ln_1p(), 1e-10);
    }
    let expected = 4.0 / 3.0 * (1.0 - LN_2);
    check_within("average", albedo_average(Masking::SmithCorrelated, 1.0, Precision::Full), expected, 1e-9);
    check_within("average", albedo_average(Masking::SmithCorrelated, 1.0, Precision::Table), expected, 1e-5);
    let other = albedo_average(Masking::SmithCorrelated, 0.99, Precision::Full);
    assert!((other - expected).abs() > 1e-3, "the check sees another roughness");
}

#[test]
fn average_albedo_for_tables_agrees_with_the_full_one() {
    for roughness in [0.0, 0.02, 0.1, 0.3, 0.7] {
        let full = albedo_average(Masking::SmithCorrelated, roughness, Precision::Full);
        let table = albedo_average(Masking::SmithCorrelated, roughness, Precision::Table);
        check_within(&format!("roughness {roughness}"), table, full, 1e-5);
    }
}

/// The same integral over lights by plain product rules: slow, obvious, good for rough lobes.
fn brute_force(masking: Masking, n_dot_v: f64, alpha: f64) -> [f64; 2] {
    let sin_v = (1.0 - n_dot_v * n_dot_v).sqrt();
    let (polar, azimuth) = (gauss(200), 400);
    let mut sum = [0.0; 2];
    for node in &polar {
        let (n_dot_l, sin_l) = (node.from_start, (1.0 - node.from_start * node.from_start).sqrt());
        for j in 0..azimuth {
            let phi = (f64::from(j) + 0.5) * PI / f64::from(azimuth);
            let l_dot_v = n_dot_l * n_dot_v + sin_l * sin_v * phi.cos();
            let v_dot_h = (0.5 * (1.0 + l_dot_v)).sqrt();
            let n_dot_h = (n_dot_l + n_dot_v) / (2.0 * v_dot_h);
            let value = d_ggx(alpha, 1.0 - n_dot_h * n_dot_h) * masking.scattered(alpha, n_dot_v, n_dot_l);
            let weight = node.weight * 2.0 * PI / f64::from(azimuth) * value;
            sum[0] += weight * (1.0 - (1.0 - v_dot_h).powi(5));
            sum[1] += weight * (1.0 - v_dot_h).powi(5);
        }
    }
    sum
}

#[test]
fn every_masking_agrees_with_brute_force_on_rough_lobes() {
    for masking in Masking::ALL {
        for (n_dot_v, roughness) in [(0.05, 0.8), (0.4, 0.6), (0.9, 0.7), (1.0, 1.0f64)] {
            let exact = dfg(masking, n_dot_v, roughness, Precision::Full);
            let brute = brute_force(masking, n_dot_v, roughness * roughness);
            let what = format!("{masking:?} {n_dot_v} {roughness}");
            check_within(&what, exact[0], brute[0], 1e-8);
            check_within(&what, exact[1], brute[1], 1e-8);
            let wrong = brute_force(masking, n_dot_v, roughness * roughness + 1e-4);
            assert!((wrong[0] - exact[0]).abs() > 1e-7, "{what}: the check sees another α");
        }
    }
}

/// Worst and RMS errors of scale, bias and a dielectric's reflectance.
fn check_fit(masking: Masking, fit: impl Fn(f64, f64) -> [f64; 2], expected: [[f64; 2]; 3]) {
    let error = fit_error(masking, 64, fit);
    let measured = [error.scale, error.bias, error.dielectric].map(|norms| [norms.worst, norms.rms]);
    for (measured, expected) in measured.iter().flatten().zip(expected.iter().flatten()) {
        check_within(&format!("{masking:?} {measured:?}"), *measured, *expected, 0.02 * expected);
    }
}

#[test]
fn fits_are_as_far_from_the_table_as_stated() {
    // The fits were made for Schlick's masking.
    check_fit(Masking::SchlickIbl, fit_karis_mobile, [[0.1798, 0.0703], [0.2411, 0.0284], [0.2444, 0.0289]]);
    check_fit(
        Masking::SmithCorrelated,
        fit_karis_mobile,
        [[0.4616, 0.1279], [0.0848, 0.0209], [0.0837, 0.0228]],
    );
    check_fit(Masking::SchlickIbl, fit_lazarov, [[0.5005, 0.1867], [0.4646, 0.0344], [0.4457, 0.0322]]);
    check_fit(Masking::SmithCorrelated, fit_lazarov, [[0.4898, 0.1392], [0.4839, 0.0530], [0.4647, 0.0507]]);
}

#[test]
fn fit_of_the_table_itself_has_no_error() {
    let exact = fit_error(Masking::SmithCorrelated, 8, dfg_ggx);
    assert!(exact.scale.worst <= 5e-6 && exact.bias.worst <= 5e-6, "{exact:?}");
}

#[test]
fn error_norms_hold_the_worst_even_if_it_is_not_a_number() {
    let norms = ErrorNorms::of([([0.0; 2], 3.0, 1.0), ([0.5; 2], -4.0, 1.0), ([1.0; 2], 0.0, 2.0)]);
    assert_eq!((norms.worst, norms.worst_at, norms.rms), (4.0, [0.5; 2], 2.5));
    let norms = ErrorNorms::of([([0.5; 2], f64::NAN, 1.0), ([0.0; 2], 1.0, 1.0)]);
    assert!(norms.worst.is_nan() && norms.worst_at == [0.5; 2]);
}
