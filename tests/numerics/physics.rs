//! What physics asks of the lobes, natively: normalised, reciprocal, no brighter than what they receive, drawn as they are.

use std::f64::consts::{PI, TAU};

use kiln_brdf::sampling::{
    pdf_charlie, pdf_cosine, pdf_ggx, pdf_ggx_visible, sample_charlie, sample_cosine, sample_ggx,
    sample_ggx_visible,
};
use kiln_brdf::{
    Masking, Precision, SheenVisibility, albedo_average, d_charlie, d_ggx, dfg, dfg_multiscatter, invert,
    sheen_albedo, v_ashikhmin,
};
use kiln_sphere::quadrature::gauss_legendre;

use crate::maps::Random;
use crate::record::{hold, relative, worst};

/// Perceptual roughnesses, cosines of the view and reflectances that all of this is looked at over.
pub const ROUGHNESSES: [f64; 6] = [0.05, 0.1, 0.25, 0.5, 0.8, 1.0];
pub const COSINES: [f64; 6] = [0.01, 0.1, 0.3, 0.6, 0.9, 1.0];
pub const REFLECTANCES: [f64; 4] = [0.0, 0.04, 0.5, 1.0];

/// ∫₀¹ f, panels halving towards both ends.
pub fn integral(f: impl Fn(f64) -> f64) -> f64 {
    nodes().iter().map(|(x, weight)| weight * f(*x)).sum()
}

/// Nodes and weights of it.
pub fn nodes() -> Vec<(f64, f64)> {
    const PANELS: i32 = 52;
    let rule = gauss_legendre(12);
    let mut nodes = Vec::new();
    for panel in 0..PANELS {
        let (from, to) = (0.5 * 0.5f64.powi(panel + 1), 0.5 * 0.5f64.powi(panel));
        for (x, weight) in &rule {
            // Of [−1, 1].
            let at = from + 0.5 * (x + 1.0) * (to - from);
            nodes.extend([at, 1.0 - at].map(|at| (at, 0.5 * weight * (to - from))));
        }
    }
    nodes
}

/// Worst relative distance of ∫ D n·h dω from 1; n·h dω is π d(sin²θ).
fn normalisation(d: impl Fn(f64, f64) -> f64) -> f64 {
    worst(
        ROUGHNESSES.map(|roughness| relative(integral(|sin2| PI * d(roughness * roughness, sin2)), 1.0, 0.0)),
    )
}

#[test]
fn distributions_are_normalised() {
    let charlie = |alpha: f64, sin2: f64| d_charlie(alpha, sin2.sqrt());
    let error = normalisation(d_ggx).max(normalisation(charlie));
    hold("distributions_are_normalised", "f64", error);
    let wrong = |alpha: f64, sin2: f64| d_ggx(alpha, sin2) * (1.0 - sin2).sqrt();
    assert!(error <= 1e-6 && normalisation(wrong) > 1e-3, "the check sees a cosine too many");
}

#[test]
fn single_scattering_reflects_at_most_what_arrives() {
    for roughness in ROUGHNESSES {
        for n_dot_v in COSINES {
            for masking in [Masking::SmithCorrelated, Masking::SmithSeparable] {
                let [scale, bias] = dfg(masking, n_dot_v, roughness, Precision::Full);
                for f0 in REFLECTANCES {
                    let albedo = f0 * scale + bias;
                    assert!(
                        (0.0..=1.0 + 1e-9).contains(&albedo),
                        "{masking:?} {roughness} {n_dot_v} {f0}: {albedo}"
                    );
                }
            }
        }
    }
}

#[test]
fn charlie_with_ashikhmins_visibility_is_the_one_lobe_that_makes_light() {
    let most = |visibility, roughnesses: &[f64]| {
        let albedo =
            |roughness| worst(COSINES.map(|it| sheen_albedo(visibility, it, roughness, Precision::Full)));
        worst(roughnesses.iter().map(|roughness| albedo(*roughness)))
    };
    // As three.js and glTF's viewer have it, and as Filament does: smooth cloth at grazing views.
    assert!(most(SheenVisibility::Unclamped, &[0.1]) > 3.0);
    let clamped = most(SheenVisibility::Clamped, &[0.1]);
    assert!(clamped > 1.0 && clamped < 2.0, "{clamped}");
    for visibility in [SheenVisibility::Unclamped, SheenVisibility::Clamped] {
        assert!(most(visibility, &[0.5, 0.8, 1.0]) <= 1.0, "{visibility:?}: rough cloth does not");
    }
}

#[test]
fn white_furnace_of_all_bounces_is_white() {
    let mut errors = Vec::new();
    for roughness in ROUGHNESSES {
        let albedo =
            |n_dot_v: f64| dfg_multiscatter(Masking::SmithCorrelated, n_dot_v, roughness, Precision::Full)[1];
        // What a single bounce loses, spread as Kulla and Conty 2017 do: it comes back whole if the average is the average.
        let rule = gauss_legendre(24);
        let average: f64 = rule
            .iter()
            .map(|(x, weight)| (0.5 * (x + 1.0), 0.5 * weight))
            .map(|(mu, weight)| 2.0 * weight * mu * albedo(mu))
            .sum();
        let stated = albedo_average(Masking::SmithCorrelated, roughness, Precision::Full);
        for n_dot_v in COSINES {
            let single = albedo(n_dot_v);
            assert!(single <= 1.0 + 1e-9, "single scattering gains at {roughness} {n_dot_v}");
            let multiple = (1.0 - single) * (1.0 - average) / (1.0 - stated).max(1e-12);
            errors.push(relative(single + multiple, 1.0, 0.0));
        }
    }
    hold("white_furnace_of_all_bounces_is_white", "f64", worst(errors));
}

#[test]
fn lobes_are_reciprocal() {
    let mut random = Random(20);
    let mut errors = Vec::new();
    for _ in 0..1000 {
        let (alpha, v, l) = (random.between(1e-4, 1.0), random.between(1e-3, 1.0), random.between(1e-3, 1.0));
        for masking in Masking::ALL {
            errors.push(relative(
                masking.scattered(alpha, v, l) / l,
                masking.scattered(alpha, l, v) / v,
                0.0,
            ));
        }
        errors.push(relative(v_ashikhmin(v, l), v_ashikhmin(l, v), 0.0));
    }
    hold("lobes_are_reciprocal", "f64", worst(errors));
    let lambert_over_light = |v: f64, l: f64| relative(v / l, l / v, 0.0);
    assert!(lambert_over_light(0.2, 0.9) > 0.1, "the check sees what is not");
}

/// A lobe to draw from.
struct Drawn {
    name: &'static str,
    sample: fn([f64; 2], f64) -> [f64; 3],
    pdf: fn([f64; 3], f64) -> f64,
    invert: fn([f64; 3], f64) -> [f64; 2],
}

/// A view that is neither along the normal nor along an axis.
fn view() -> [f64; 3] {
    crate::support::unit([0.5, -0.3, 0.6])
}

const DRAWN: [Drawn; 4] = [
    Drawn {
        name: "cosine",
        sample: |u, _| sample_cosine(u),
        pdf: |d, _| pdf_cosine(d[2]),
        invert: |d, _| invert::invert_cosine(d),
    },
    Drawn { name: "ggx", sample: sample_ggx, pdf: pdf_ggx, invert: invert::invert_ggx },
    Drawn { name: "charlie", sample: sample_charlie, pdf: pdf_charlie, invert: invert::invert_charlie },
    Drawn {
        name: "ggx visible",
        sample: |u, alpha| sample_ggx_visible(view(), u, alpha),
        pdf: |h, alpha| pdf_ggx_visible(view(), h, alpha),
        invert: |h, alpha| invert::invert_ggx_visible(view(), h, alpha),
    },
];

#[test]
fn inverting_a_sample_gives_its_point() {
    let mut random = Random(21);
    let mut errors = Vec::new();
    for Drawn { name, sample, pdf, invert } in &DRAWN {
        for _ in 0..1000 {
            let (u, alpha) = ([random.unit(), random.between(1e-3, 1.0)], random.between(0.02, 1.0));
            let direction = sample(u, alpha);
            let back = invert(direction, alpha);
            // Turns 0 and 1 are one.
            let turn = (back[0] - u[0]).abs();
            errors.push(turn.min(1.0 - turn).max((back[1] - u[1]).abs()));
            let wrong = invert(direction, 1.1 * alpha);
            assert!(
                *name == "cosine" || (wrong[1] - u[1]).abs() > 1e-6,
                "{name}: another α is another point"
            );
            assert!(pdf(direction, alpha) > 0.0, "{name}: what is drawn has a density");
        }
    }
    hold("inverting_a_sample_gives_its_point", "f64", worst(errors));
}

const CELLS: [usize; 2] = [12, 16];
/// χ² of as many cells is above its mean by more than so many of its standard deviations in one of 3 million runs.
const SIGMAS: f64 = 5.0;

/// Points within the cells of a histogram over azimuth and height, at which a density is integrated over them, with weights.
pub fn cell_nodes() -> Vec<(usize, [f64; 3], f64)> {
    let rule = gauss_legendre(10);
    let mut nodes = Vec::new();
    for cell in 0..CELLS[0] * CELLS[1] {
        let (column, row) = (cell % CELLS[0], cell / CELLS[0]);
        for (a, weight_a) in &rule {
            for (b, weight_b) in &rule {
                let phi = (column as f64 + 0.5 * (a + 1.0)) * TAU / CELLS[0] as f64;
                let z = (row as f64 + 0.5 * (b + 1.0)) / CELLS[1] as f64;
                let radius = (1.0 - z * z).sqrt();
                let weight = 0.25 * weight_a * weight_b * TAU / (CELLS[0] * CELLS[1]) as f64;
                nodes.push((cell, [radius * phi.cos(), radius * phi.sin(), z], weight));
            }
        }
    }
    nodes
}

/// How many standard deviations χ² of directions is above its mean, given the density at [`cell_nodes`]. Cells that expect
/// fewer than five are taken together.
pub fn chi_square_sigmas(directions: &[[f64; 3]], density: &[f64]) -> f64 {
    let mut expected = vec![0.0; CELLS[0] * CELLS[1]];
    for ((cell, _, weight), density) in cell_nodes().iter().zip(density) {
        expected[*cell] += weight * density * directions.len() as f64;
    }
    let mut seen = vec![0.0; expected.len()];
    for [x, y, z] in directions {
        let turn = y.atan2(*x).rem_euclid(TAU) / TAU;
        let column = ((turn * CELLS[0] as f64) as usize).min(CELLS[0] - 1);
        seen[((z * CELLS[1] as f64) as usize).min(CELLS[1] - 1) * CELLS[0] + column] += 1.0;
    }
    let (mut chi2, mut cells, mut rest) = (0.0, 0.0, [0.0; 2]);
    for (seen, expected) in seen.iter().zip(&expected) {
        if *expected < 5.0 {
            rest = [rest[0] + seen, rest[1] + expected];
        } else {
            chi2 += (seen - expected).powi(2) / expected;
            cells += 1.0;
        }
    }
    if rest[1] >= 5.0 {
        chi2 += (rest[0] - rest[1]).powi(2) / rest[1];
        cells += 1.0;
    }
    let freedom: f64 = cells - 1.0;
    (chi2 - freedom) / (2.0 * freedom).sqrt()
}

/// Points for [`chi_square_sigmas`].
pub fn points(seed: u64) -> Vec<[f64; 2]> {
    let mut random = Random(seed);
    (0..1 << 15).map(|_| [random.unit(), random.unit()]).collect()
}

#[test]
fn samples_follow_their_densities_by_chi_square_and_not_a_wrong_one() {
    let nodes = cell_nodes();
    for (seed, Drawn { name, sample, pdf, .. }) in (22..).zip(&DRAWN) {
        for alpha in [0.35, 0.8] {
            let directions: Vec<[f64; 3]> = points(seed).into_iter().map(|u| sample(u, alpha)).collect();
            let density = |alpha: f64| -> Vec<f64> { nodes.iter().map(|(_, d, _)| pdf(*d, alpha)).collect() };
            let right = chi_square_sigmas(&directions, &density(alpha));
            assert!(right <= SIGMAS, "{name} of α {alpha}: χ² is {right} standard deviations off");
            let wrong = chi_square_sigmas(&directions, &density(1.3 * alpha));
            assert!(*name == "cosine" || wrong > SIGMAS, "{name}: α off by 30 % goes unseen: {wrong}");
        }
    }
}
