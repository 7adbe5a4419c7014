//! Spectra of the kernels that environments are prefiltered with.
//!
//! With the split-sum assumption N = V = R the prefiltered map of a lobe is the environment convolved with
//! K(θ) ∝ D(θ/2) max(cos θ, 0) (Karis 2013, "Real Shading in Unreal Engine 4"; θ is the angle between the light
//! and N = V, so the half vector stands at θ/2); Lambert's is max(cos θ, 0)/π. By Funk–Hecke a convolution
//! scales the harmonics of degree l by κ_l = ∫ K(x) P_l(x) dx / ∫ K(x) dx, x = cos θ.

use crate::cancel::{Cancel, Cancelled};
use crate::quadrature::gauss_legendre;
use crate::simd;
use std::f64::consts::{FRAC_PI_2, PI};

/// Spectrum of a kernel, normalised to κ_0 = 1, with what error bounds need of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// κ_0 … κ_L.
    pub kappa: Vec<f64>,
    /// ln ∫ K dω = ln(2π ∫ K dx) before normalisation, D with its usual 1/π or 1/2π. (The integral itself
    /// underflows for Charlie's small α.)
    pub ln_norm: f64,
    /// ∫ K² dω of the normalised kernel (∫ K dω = 1), per steradian. By Parseval Σ_l κ_l² (2l + 1)/4π, all l.
    pub energy: f64,
}

impl Kernel {
    /// Σ_{l > band limit} κ_l² (2l + 1)/4π, what the spectrum leaves out; never negative.
    ///
    /// A difference, so no smaller than some 1e-15 of [`Kernel::energy`].
    pub fn energy_beyond(&self, band_limit: usize) -> f64 {
        let kept: f64 = self.kappa[..=band_limit.min(self.kappa.len() - 1)]
            .iter()
            .enumerate()
            .map(|(l, k)| k * k * (2 * l + 1) as f64 / (4.0 * PI))
            .sum();
        (self.energy - kept).max(4.0 * f64::EPSILON * self.energy)
    }
}

/// GGX (Trowbridge–Reitz), 0 < `alpha` ≤ 1: K = D(θ/2) max(cos θ, 0).
///
/// κ_l within 1e-9 of an independent oracle (α ≥ 0.01, l ≤ 1024). Panics unless `alpha` is in (0, 1].
///
/// # Errors
/// [`Cancelled`] within the work of a few nodes.
pub fn kernel_ggx(alpha: f64, band_limit: usize, cancel: Cancel) -> Result<Kernel, Cancelled> {
    assert!(alpha > 0.0 && alpha <= 1.0, "GGX needs alpha in (0, 1], got {alpha}");
    let panels = panels(alpha, FRAC_PI_2, band_limit);
    let ln_kernel = |theta| libm::log(ggx_distribution(alpha, theta) * libm::cos(theta));
    spectrum(band_limit, &panels, ln_kernel, cancel)
}

/// The unnormalised GGX kernel D(θ/2) max(cos θ, 0) for a unit vector at cosine `x`, given 1 − x.
///
/// D = α² / (π (α² cos²θ_h + sin²θ_h)²) with sin²θ_h = (1 − x)/2: no difference of nearly equal numbers, however
/// small α (Walter et al. 2007, eq. 33, divided by cos⁴ θ_h throughout).
#[inline]
pub fn ggx_kernel_at(alpha: f64, one_minus_x: f64) -> f64 {
    let sin2 = 0.5 * one_minus_x;
    let cosine = (1.0 - one_minus_x).max(0.0);
    let alpha2 = alpha * alpha;
    let denominator = alpha2 * (1.0 - sin2) + sin2;
    alpha2 * cosine / (PI * denominator * denominator)
}

/// Charlie (Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF"), 0 < `alpha` ≤ 1:
/// K = (2 + 1/α) sin(θ/2)^(1/α) / 2π · max(cos θ, 0), in logarithms. Panics unless `alpha` is in (0, 1].
///
/// # Errors
/// [`Cancelled`] within the work of a few nodes.
pub fn kernel_charlie(alpha: f64, band_limit: usize, cancel: Cancel) -> Result<Kernel, Cancelled> {
    assert!(alpha > 0.0 && alpha <= 1.0, "Charlie needs alpha in (0, 1], got {alpha}");
    let ln_scale = libm::log((2.0 + 1.0 / alpha) / (2.0 * PI));
    let panels = panels(0.1, 2.0 * alpha, band_limit);
    let ln_kernel =
        |theta| ln_scale + libm::log(libm::sin(0.5 * theta)) / alpha + libm::log(libm::cos(theta));
    spectrum(band_limit, &panels, ln_kernel, cancel)
}

/// Lambert: K = max(cos θ, 0)/π, in closed form.
///
/// κ_1 = 2/3, κ_l = 0 for odd l > 1, κ_l = 2 (−1)^(l/2−1) / ((l + 2)(l − 1)) · C(l, l/2)/2^l for even l
/// (Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps", eq. 8,
/// divided by π).
pub fn kernel_lambert(band_limit: usize) -> Kernel {
    let mut kappa = vec![0.0; band_limit + 1];
    kappa[0] = 1.0;
    if band_limit >= 1 {
        kappa[1] = 2.0 / 3.0;
    }
    let mut central = 1.0;
    for l in (2..=band_limit).step_by(2) {
        central *= (l - 1) as f64 / l as f64;
        let sign = if l % 4 == 2 { 2.0 } else { -2.0 };
        kappa[l] = sign * central / ((l + 2) as f64 * (l - 1) as f64);
    }
    Kernel { kappa, ln_norm: 0.0, energy: 2.0 / (3.0 * PI) }
}

fn ggx_distribution(alpha: f64, theta: f64) -> f64 {
    let half = libm::sin(0.5 * theta);
    let (alpha2, sin2) = (alpha * alpha, half * half);
    let denominator = alpha2 * (1.0 - sin2) + sin2;
    alpha2 / (PI * denominator * denominator)
}

/// Nodes of a Gauss panel.
const NODES: usize = 20;
/// Widest panel in radians of phase l θ: 20 nodes integrate cos over 12 rad to 1e-16.
const PHASE_MAX: f64 = 12.0;
/// Nodes advanced side by side.
const LANES: usize = 8;

/// Panel edges over [0, π/2], doubling in width from `lobe` at 0 and from `horizon` at π/2.
fn panels(lobe: f64, horizon: f64, band_limit: usize) -> Vec<f64> {
    let widest = PHASE_MAX / (band_limit + 1) as f64;
    let mut edges = vec![0.0];
    let mut edge = 0.0;
    while edge < FRAC_PI_2 {
        let width = widest.min(lobe.max(edge)).min(horizon.max(0.5 * (FRAC_PI_2 - edge)));
        edge = (edge + width).min(FRAC_PI_2);
        edges.push(edge);
    }
    edges
}

/// One node: 1 − cos θ, and the logarithm of weight · K · sin θ.
struct Node {
    one_minus_x: f64,
    ln_mass: f64,
    ln_kernel: f64,
}

fn nodes(edges: &[f64], ln_kernel: impl Fn(f64) -> f64, cancel: Cancel) -> Result<Vec<Node>, Cancelled> {
    let rule = gauss_legendre(NODES);
    let mut nodes = Vec::with_capacity((edges.len() - 1) * NODES);
    for edge in edges.windows(2) {
        cancel.check()?;
        let half = 0.5 * (edge[1] - edge[0]);
        for &(y, weight) in &rule {
            let theta = edge[0] + half * (1.0 + y);
            let half_sine = libm::sin(0.5 * theta);
            let ln_kernel = ln_kernel(theta);
            let ln_mass = ln_kernel + libm::log(weight * half * libm::sin(theta));
            nodes.push(Node { one_minus_x: 2.0 * half_sine * half_sine, ln_mass, ln_kernel });
        }
    }
    Ok(nodes)
}

fn spectrum(
    band_limit: usize,
    edges: &[f64],
    ln_kernel: impl Fn(f64) -> f64,
    cancel: Cancel,
) -> Result<Kernel, Cancelled> {
    let nodes = nodes(edges, ln_kernel, cancel)?;
    let largest = nodes.iter().fold(f64::NEG_INFINITY, |a, node| a.max(node.ln_mass));
    let masses: Vec<f64> = nodes.iter().map(|node| libm::exp(node.ln_mass - largest)).collect();
    let total: f64 = masses.iter().sum();
    let ln_norm = libm::log(2.0 * PI * total) + largest;
    let mean_of_kernel = nodes
        .iter()
        .zip(&masses)
        .map(|(node, mass)| mass / total * libm::exp(node.ln_kernel - ln_norm))
        .sum();
    let mut kappa = vec![0.0; band_limit + 1];
    for (nodes, masses) in nodes.chunks(LANES).zip(masses.chunks(LANES)) {
        cancel.check()?;
        let one_minus_x = std::array::from_fn(|lane| nodes.get(lane).map_or(0.0, |node| node.one_minus_x));
        let mass = std::array::from_fn(|lane| masses.get(lane).map_or(0.0, |mass| mass / total));
        simd::dispatch(
            #[inline(always)]
            || add_legendre_moments(&mut kappa, &one_minus_x, &mass),
        );
    }
    kappa[0] = 1.0;
    Ok(Kernel { kappa, ln_norm, energy: mean_of_kernel })
}

/// κ_l += Σ mass · P_l(x), by Bonnet's recursion in u = 1 − x for the differences δ_l = P_l − P_{l−1}:
/// δ_{l+1} = (l δ_l − (2l + 1) u P_l)/(l + 1), which stays exact near x = 1.
#[inline(always)]
fn add_legendre_moments(kappa: &mut [f64], one_minus_x: &[f64; LANES], mass: &[f64; LANES]) {
    let (mut value, mut difference) = ([1.0; LANES], [0.0; LANES]);
    for (l, kappa) in kappa.iter_mut().enumerate() {
        let inverse = 1.0 / (l + 1) as f64;
        let (keep, turn) = (l as f64 * inverse, (2 * l + 1) as f64 * inverse);
        let mut products = [0.0; LANES];
        for lane in 0..LANES {
            products[lane] = mass[lane] * value[lane];
            difference[lane] = keep * difference[lane] - turn * (one_minus_x[lane] * value[lane]);
            value[lane] += difference[lane];
        }
        let pairs: [f64; LANES / 2] = std::array::from_fn(|lane| products[lane] + products[lane + LANES / 2]);
        *kappa += (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Kernel, kernel_charlie, kernel_lambert};
    use crate::cancel::Cancel;
    use crate::testing::check_within;

    fn kernel_ggx(alpha: f64, band_limit: usize) -> Kernel {
        super::kernel_ggx(alpha, band_limit, Cancel::NEVER).expect("nobody cancels")
    }

    /// Rows of an independent quadrature: see the file's first lines.
    const ORACLE: &str = include_str!("../tests/data/kernel_spectra.tsv");

    fn kernel(name: &str, alpha: f64, band_limit: usize) -> Kernel {
        match name {
            "ggx" => kernel_ggx(alpha, band_limit),
            "charlie" => kernel_charlie(alpha, band_limit, Cancel::NEVER).expect("nobody cancels"),
            "lambert" => kernel_lambert(band_limit),
            other => panic!("unknown kernel {other}"),
        }
    }

    /// Largest (error / tolerance) over the oracle's rows; alphas moved by `factor` first.
    fn worst_oracle_ratio(factor: f64) -> f64 {
        let mut worst: f64 = 0.0;
        let mut cached: Option<(String, Kernel)> = None;
        for row in ORACLE.lines().filter(|line| !line.starts_with('#')) {
            let field: Vec<&str> = row.split('\t').collect();
            let number = |i: usize| -> f64 { field[i].parse().expect("a number") };
            let key = format!("{} {}", field[0], field[1]);
            if cached.as_ref().is_none_or(|(have, _)| *have != key) {
                cached = Some((key, kernel(field[0], number(1) * factor, 1024)));
            }
            let (_, kernel) = cached.as_ref().expect("just set");
            let l: usize = field[2].parse().expect("a degree");
            let tolerance = (2.0 * number(5)).max(1e-9);
            let norm_error = (kernel.ln_norm.exp() - number(4)).abs() / number(4).max(1e-300);
            let ratio = ((kernel.kappa[l] - number(3)).abs()).max(norm_error * 1e-1) / tolerance;
            assert!(ratio.is_finite(), "{row}");
            worst = worst.max(ratio);
        }
        worst
    }

    #[test]
    fn spectra_match_the_oracle() {
        let worst = worst_oracle_ratio(1.0);
        assert!(worst <= 1.0, "worst error is {worst} times the tolerance");
    }

    #[test]
    fn oracle_check_rejects_a_wrong_alpha() {
        assert!(worst_oracle_ratio(0.999999) > 10.0);
    }

    #[test]
    fn ggx_at_alpha_one_is_lambert() {
        let (ggx, lambert) = (kernel_ggx(1.0, 300), kernel_lambert(300));
        for l in 0..=300 {
            check_within("kappa", ggx.kappa[l], lambert.kappa[l], 1e-14);
        }
        check_within("energy", ggx.energy, lambert.energy, 1e-13);
    }

    #[test]
    fn energy_is_the_sum_of_the_spectrum() {
        for alpha in [0.02, 0.1, 0.5] {
            let kernel = kernel_ggx(alpha, 3000);
            check_within("left over", kernel.energy_beyond(3000) / kernel.energy, 0.0, 1e-9);
            assert!(kernel.energy_beyond(0) > 0.1 * kernel.energy, "the first band is not all");
        }
    }
}
