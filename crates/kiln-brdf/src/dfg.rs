//! Split-sum terms of GGX and their averages.

use crate::circles::{Lobe, Rule, integrate};
use crate::lobes::{Masking, d_ggx, schlick_weight};
use crate::quadrature::{Node, gauss, gauss_towards_end, tanh_sinh};
use std::sync::OnceLock;

/// Below this α the lobe is a mirror to 1e-9 (n·v ≥ 1e-5).
const ALPHA_MIRROR: f64 = 1e-7;

/// How well an integral is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 1e-9 of every value, at some milliseconds each.
    Full,
    /// Good enough for a table of `f32`, at some 10 microseconds a value: 5e-6 for GGX, 3e-5 where n·v and α vanish
    /// together; for sheen from roughness 0.05 on 1e-7 clamped, and unclamped (where it exceeds 1) 5e-5 from
    /// n·v = 0.001 on, 5e-4 below.
    Table,
}

impl Precision {
    pub(crate) fn rule(self) -> &'static Rule {
        static FULL: OnceLock<Rule> = OnceLock::new();
        static TABLE: OnceLock<Rule> = OnceLock::new();
        match self {
            Self::Full => {
                FULL.get_or_init(|| Rule { polar: tanh_sinh(64, 3.4), azimuth: tanh_sinh(64, 3.4) })
            }
            Self::Table => {
                TABLE.get_or_init(|| Rule { polar: gauss_towards_end(28), azimuth: gauss_towards_end(10) })
            }
        }
    }
}

/// Split-sum terms [scale, bias] of GGX with Schlick's Fresnel: reflectance under uniform light = F0 · scale + bias.
///
/// ```text
/// scale = ∫ D V n·l (1 − (1 − v·h)⁵) dω_l      bias = ∫ D V n·l (1 − v·h)⁵ dω_l
/// ```
///
/// Both arguments are brought into [0, 1]; NaN counts as 0. Finite everywhere; roughness 0 is a mirror, n·v = 0 the
/// limit from above at any other roughness.
/// Checked by: `ggx_meets_every_oracle_row`, `grazing_and_smooth_corners_agree_with_a_finer_rule`.
pub fn dfg(masking: Masking, n_dot_v: f64, perceptual_roughness: f64, precision: Precision) -> [f64; 2] {
    let n_dot_v = bring_into(n_dot_v, 0.0);
    let roughness = bring_into(perceptual_roughness, 0.0);
    integrate_ggx(masking, n_dot_v, roughness * roughness, precision.rule())
}

/// [`dfg`] with height-correlated Smith masking, in full.
pub fn dfg_ggx(n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
    dfg(Masking::SmithCorrelated, n_dot_v, perceptual_roughness, Precision::Full)
}

pub(crate) fn integrate_ggx(masking: Masking, n_dot_v: f64, alpha: f64, rule: &Rule) -> [f64; 2] {
    if alpha < ALPHA_MIRROR {
        let bias = schlick_weight(n_dot_v);
        return [1.0 - bias, bias].map(|value| value * masking.mirror(n_dot_v));
    }
    let lobe = Lobe {
        scale: alpha,
        distribution: |sin2_theta_h| d_ggx(alpha, sin2_theta_h),
        scattered: |n_dot_l| masking.scattered(alpha, n_dot_v, n_dot_l),
        kink: None,
    };
    integrate(n_dot_v, &lobe, rule)
}

/// [`dfg`] as renderers with multiple scattering tabulate it: [bias, scale + bias] = [∫ D V n·l (1 − v·h)⁵, E].
///
/// E is the directional albedo of a lobe that reflects all (F = 1); reflectance = lerp(bias, E, F0), and F0 (1/E − 1)
/// of it is the energy that single scattering loses (Filament's `prefilteredDFG`; Fdez-Agüera 2019, "A
/// Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting").
pub fn dfg_multiscatter(
    masking: Masking,
    n_dot_v: f64,
    perceptual_roughness: f64,
    precision: Precision,
) -> [f64; 2] {
    let [scale, bias] = dfg(masking, n_dot_v, perceptual_roughness, precision);
    [bias, scale + bias]
}

/// Average albedo of GGX with F = 1, 2 ∫ E(μ) μ dμ over μ = n·v in [0, 1]: with E the other half of Kulla and Conty's
/// compensation lobe (1 − E(μ_l)) (1 − E(μ_v)) / (π (1 − average)) (2017, "Revisiting Physically Based Shading at
/// Imageworks").
///
/// Accuracy: 1e-9 in full, 1e-5 for tables.
pub fn albedo_average(masking: Masking, perceptual_roughness: f64, precision: Precision) -> f64 {
    static FULL: OnceLock<Vec<Node>> = OnceLock::new();
    static TABLE: OnceLock<Vec<Node>> = OnceLock::new();
    let rule = match precision {
        Precision::Full => FULL.get_or_init(|| tanh_sinh(24, 2.9)),
        Precision::Table => TABLE.get_or_init(|| gauss(10)),
    };
    let alpha = bring_into(perceptual_roughness, 0.0) * bring_into(perceptual_roughness, 0.0);
    // The albedo turns at n·v = α from one limit to the other.
    let turn = alpha.clamp(1e-3, 0.5);
    let mut sum = 0.0;
    for [start, end] in [[0.0, turn], [turn, 1.0]] {
        for node in rule {
            let n_dot_v = start + (end - start) * node.from_start;
            let [scale, bias] = integrate_ggx(masking, n_dot_v, alpha, precision.rule());
            sum += node.weight * (end - start) * 2.0 * n_dot_v * (scale + bias);
        }
    }
    sum
}

/// `value` in [`least`, 1]; NaN becomes `least`.
pub(crate) fn bring_into(value: f64, least: f64) -> f64 {
    if value >= least { value.min(1.0) } else { least }
}
