//! Spectra and norms of the prefilter kernels against an independent quadrature, row by row, and closed forms.

use kiln_sphere::{Cancel, Kernel, kernel_charlie, kernel_ggx, kernel_lambert};
use std::collections::BTreeMap;

/// Independent values; see the file's first lines.
const ORACLE: &str = include_str!("data/kernel_spectra.tsv");
const BAND_LIMIT: usize = 1024;

/// One line of the oracle.
struct Row {
    kernel: &'static str,
    alpha: f64,
    l: usize,
    kappa: f64,
    norm: f64,
    tolerance: f64,
}

fn rows() -> Vec<Row> {
    let parse = |line: &'static str| {
        let field: Vec<&str> = line.split('\t').collect();
        let number = |index: usize| field[index].parse::<f64>().expect("a number");
        let l = field[2].parse().expect("a degree");
        let tolerance = (2.0 * number(5)).max(1e-9);
        Row { kernel: field[0], alpha: number(1), l, kappa: number(3), norm: number(4), tolerance }
    };
    ORACLE.lines().filter(|line| !line.starts_with('#')).map(parse).collect()
}

fn kernel(name: &str, alpha: f64) -> Kernel {
    match name {
        "ggx" => kernel_ggx(alpha, BAND_LIMIT, Cancel::NEVER).expect("nobody cancels"),
        "charlie" => kernel_charlie(alpha, BAND_LIMIT, Cancel::NEVER).expect("nobody cancels"),
        "lambert" => kernel_lambert(BAND_LIMIT),
        other => panic!("unknown kernel {other}"),
    }
}

/// Largest error / tolerance of (κ, norm) by kernel and α, the α moved by a factor first.
fn worst(factor: f64) -> BTreeMap<String, [f64; 2]> {
    let mut kernels = BTreeMap::new();
    let mut worst = BTreeMap::<String, [f64; 2]>::new();
    let rows = rows();
    assert_eq!(rows.len(), 360);
    for row in rows {
        let name = format!("{} {}", row.kernel, row.alpha);
        let kernel =
            kernels.entry(name.clone()).or_insert_with(|| kernel(row.kernel, (row.alpha * factor).min(1.0)));
        let kappa = (kernel.kappa[row.l] - row.kappa).abs() / row.tolerance;
        // The file writes 0 where the norm underflows.
        let norm = if row.norm > 0.0 {
            (kernel.ln_norm.exp() / row.norm - 1.0).abs() / row.tolerance
        } else {
            f64::from(u8::from(kernel.ln_norm.exp() > 0.0))
        };
        assert!(kappa.is_finite() && norm.is_finite(), "{name}, l {}", row.l);
        let ratios = worst.entry(name).or_default();
        *ratios = [ratios[0].max(kappa), ratios[1].max(norm)];
    }
    worst
}

#[test]
fn every_row_of_the_oracle_is_met() {
    for (name, ratios) in worst(1.0) {
        assert!(ratios[0] <= 1.0 && ratios[1] <= 1.0, "{name}: {ratios:?} times the tolerance");
    }
}

#[test]
fn check_rejects_a_slightly_smaller_alpha_in_every_kernel() {
    for (name, ratios) in worst(1.0 - 1e-6) {
        let is_lambert = name.starts_with("lambert");
        assert!(is_lambert || ratios[0] > 10.0, "{name}: {ratios:?}");
    }
}

/// ln ∫ K dω of Charlie, from ∫_0^½ t^q (1 − 2t) dt with t = sin²(θ/2), q = 1/2α: 2^(1 − q)/(q + 2).
fn ln_charlie_norm(alpha: f64) -> f64 {
    let q = 0.5 / alpha;
    (1.0 - q) * std::f64::consts::LN_2 - (q + 2.0).ln()
}

#[test]
fn charlie_norm_is_the_closed_form_where_it_underflows_too() {
    for alpha in [1.0, 0.25, 0.01, 0.0004, 1e-5] {
        let kernel = kernel_charlie(alpha, 4, Cancel::NEVER).expect("nobody cancels");
        let error = (kernel.ln_norm - ln_charlie_norm(alpha)).abs();
        assert!(error <= 1e-9, "α = {alpha}: {} off by {error}", kernel.ln_norm);
        assert!(
            (kernel.ln_norm - ln_charlie_norm(alpha * (1.0 - 1e-6))).abs() > 1e-8,
            "the check sees another α"
        );
    }
}
