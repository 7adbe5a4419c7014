//! Split-sum terms by quadrature over half vectors.
//!
//! ∫ D V n·l (…) dω_l = ∫ D V n·l · 4 v·h (…) dω_h. With the half vector at (θ, φ) from the normal and φ = 0 towards V
//!
//! ```text
//! v·h = cos θ_v cos θ + sin θ_v sin θ cos φ        n·l = 2 v·h cos θ − n·v
//! ```
//!
//! so D depends on θ alone and the horizon n·l = 0 cuts each circle of constant θ at one |φ| only: everything
//! is lit for 2θ < π/2 − θ_v, nothing for 2θ > π/2 + θ_v. On θ the variable asinh(tan θ / α) takes the lobe's scale
//! away; tanh–sinh rules on both variables crowd towards peak, horizon and the two transitions, at any α.

use crate::lobes::{d_ggx, schlick_weight, smith_denominator};
use crate::quadrature::{Node, tanh_sinh};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

/// Below this α the lobe is a mirror to all digits of a table: (1 − (1 − n·v)⁵, (1 − n·v)⁵).
const ALPHA_MIRROR: f64 = 1e-7;
/// Nodes on each side of a rule's middle, and how far the rule reaches towards the ends: 1e-10 of the integral, and
/// 1e-6 (5e-7 at the oracle's points).
const HALF_FINE: usize = 64;
const REACH_FINE: f64 = 3.4;
const HALF_TABLE: usize = 24;
const REACH_TABLE: f64 = 2.4;

/// Split-sum terms [scale, bias] of GGX with height-correlated Smith masking and Schlick's Fresnel:
/// reflectance under uniform light = F0 · scale + bias.
///
/// ```text
/// scale = ∫ D V n·l (1 − (1 − v·h)⁵) dω_l      bias = ∫ D V n·l (1 − v·h)⁵ dω_l
/// ```
///
/// Both arguments are brought into [0, 1]; NaN counts as 0. Finite everywhere: n·v = 0 is the limit from above, and
/// so is roughness 0 (a mirror); at both it is the mirror's (0, 1). Accuracy: 1e-9 for roughness
/// from 0.05 and n·v from 0.005 on, 2e-3 in the worst corner (n·v = 0 at vanishing roughness).
pub fn dfg_ggx(n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
    static RULE: OnceLock<Vec<Node>> = OnceLock::new();
    integrate_ggx(n_dot_v, perceptual_roughness, RULE.get_or_init(|| tanh_sinh(HALF_FINE, REACH_FINE)))
}

/// [`dfg_ggx`] with a coarser rule, good enough for a table of `f32`: 1e-6 in the same range.
pub fn dfg_ggx_table_entry(n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
    static RULE: OnceLock<Vec<Node>> = OnceLock::new();
    integrate_ggx(n_dot_v, perceptual_roughness, RULE.get_or_init(|| tanh_sinh(HALF_TABLE, REACH_TABLE)))
}

fn integrate_ggx(n_dot_v: f64, perceptual_roughness: f64, rule: &[Node]) -> [f64; 2] {
    let n_dot_v = bring_into(n_dot_v, 0.0);
    let roughness = bring_into(perceptual_roughness, 0.0);
    let alpha = roughness * roughness;
    if alpha < ALPHA_MIRROR {
        let bias = schlick_weight(n_dot_v);
        return [1.0 - bias, bias];
    }
    let view = View { alpha, n_dot_v, sin_v: ((1.0 - n_dot_v) * (1.0 + n_dot_v)).sqrt() };
    let theta_v = libm::acos(n_dot_v);
    // asin(n·v) keeps its digits at grazing views, π/2 − acos does not.
    let elevation = libm::asin(n_dot_v);
    let edges = [0.0, 0.5 * elevation, 0.5 * (FRAC_PI_2 + theta_v)].map(|theta: f64| libm::tan(theta));
    let mut sum = [0.0; 2];
    for (edge, is_cut) in edges.windows(2).zip([false, true]) {
        let [start, end] = [edge[0], edge[1]].map(|tangent| libm::asinh(tangent / alpha));
        for node in rule {
            let w = start + (end - start) * node.from_start;
            let tangent = alpha * libm::sinh(w);
            let weight = node.weight * (end - start) * alpha * libm::cosh(w);
            let [scale, bias] = view.circle(tangent, is_cut, rule);
            sum[0] += weight * scale;
            sum[1] += weight * bias;
        }
    }
    sum
}

/// `value` in [`least`, 1]; NaN becomes `least`.
fn bring_into(value: f64, least: f64) -> f64 {
    if value >= least { value.min(1.0) } else { least }
}

/// What stays the same during one integral.
struct View {
    alpha: f64,
    n_dot_v: f64,
    sin_v: f64,
}

impl View {
    /// The integrand over all φ per d tan θ.
    fn circle(&self, tangent: f64, is_cut: bool, rule: &[Node]) -> [f64; 2] {
        let cos2 = 1.0 / (1.0 + tangent * tangent);
        let cosine = cos2.sqrt();
        let sine = tangent * cosine;
        let (along, across) = (self.n_dot_v * cosine, self.sin_v * sine);
        let phi_max = if is_cut { self.horizon(cosine, across) } else { PI };
        let mut sum = [0.0; 2];
        for node in rule {
            let v_dot_h = along + across * libm::cos(phi_max * node.from_start);
            let n_dot_l = 2.0 * v_dot_h * cosine - self.n_dot_v;
            if n_dot_l <= 0.0 {
                continue;
            }
            let visible = n_dot_l * 0.5 / smith_denominator(self.alpha, self.n_dot_v, n_dot_l);
            let value = node.weight * visible * v_dot_h;
            let fresnel = schlick_weight(v_dot_h.min(1.0));
            sum[0] += value * (1.0 - fresnel);
            sum[1] += value * fresnel;
        }
        // 4 v·h from the change of variables, both signs of φ, sin θ dθ = sin θ cos²θ d tan θ.
        let weight = 8.0 * phi_max * d_ggx(self.alpha, sine * sine) * sine * cos2;
        sum.map(|value| value * weight)
    }

    /// |φ| at which n·l = 0: cos φ = n·v (1 − 2 cos²θ) / (2 cos θ sin θ_v sin θ).
    fn horizon(&self, cosine: f64, across: f64) -> f64 {
        let needed = self.n_dot_v * (0.5 / cosine - cosine);
        if across > 0.0 { libm::acos((needed / across).clamp(-1.0, 1.0)) } else { FRAC_PI_2 }
    }
}

/// Directional albedo of sheen, ∫ D V n·l dω_l with Charlie's D and Ashikhmin's V, unclamped (above 1 at grazing views
/// and low roughness: that is the model).
///
/// Both arguments are brought into (0, 1]: roughness from 0.02, n·v from 1e-6. Direct quadrature over the light's
/// hemisphere; accuracy 1e-6 for roughness from 0.1 on (at α = 1 the kink at L = V costs the rest).
pub fn sheen_albedo(n_dot_v: f64, perceptual_roughness: f64) -> f64 {
    static RULE: OnceLock<Vec<Node>> = OnceLock::new();
    let rule = RULE.get_or_init(|| tanh_sinh(HALF_FINE, REACH_FINE));
    let n_dot_v = bring_into(n_dot_v, 1e-6);
    let roughness = bring_into(perceptual_roughness, 0.02);
    let alpha = roughness * roughness;
    let sin_v = ((1.0 - n_dot_v) * (1.0 + n_dot_v)).sqrt();
    let mut sum = 0.0;
    for polar in rule {
        // n·l from the horizon up.
        let n_dot_l = polar.from_start;
        let sin_l = (polar.from_end * (1.0 + n_dot_l)).sqrt();
        let mut around = 0.0;
        for azimuth in rule {
            // |l + v|² and the part of it along the normal.
            let l_dot_v = n_dot_l * n_dot_v + sin_l * sin_v * libm::cos(PI * azimuth.from_start);
            let length2 = (2.0 + 2.0 * l_dot_v).max(f64::MIN_POSITIVE);
            let along = n_dot_l + n_dot_v;
            let sin2_h = (1.0 - along * along / length2).max(0.0);
            around += azimuth.weight * crate::lobes::d_charlie(alpha, sin2_h.sqrt());
        }
        sum += polar.weight * 2.0 * PI * around * crate::lobes::v_ashikhmin(n_dot_v, n_dot_l) * n_dot_l;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{dfg_ggx, dfg_ggx_table_entry, sheen_albedo};

    /// Independent values; see the first line of each file.
    const LUT_GGX: &str = include_str!("../tests/data/lut_ggx.tsv");
    const LUT_SHEEN: &str = include_str!("../tests/data/lut_sheen.tsv");

    fn rows(table: &'static str, name: &'static str) -> impl Iterator<Item = Vec<f64>> {
        let is_row = move |line: &&str| !line.starts_with('#') && line.starts_with(name);
        let number = |field: &str| field.parse::<f64>().ok();
        table.lines().filter(is_row).map(move |line| line.split('\t').filter_map(number).collect())
    }

    /// Largest error / tolerance of `dfg` over the oracle's height-correlated rows.
    fn worst_ratio(tolerance_min: f64, dfg: impl Fn(f64, f64) -> [f64; 2]) -> f64 {
        let mut worst: f64 = 0.0;
        for row in rows(LUT_GGX, "ggx_height_correlated\t") {
            let [scale, bias] = dfg(row[1], row[0]);
            let error = (scale - row[2]).abs().max((bias - row[3]).abs());
            let ratio = error / (2.0 * row[4]).max(tolerance_min);
            assert!(ratio.is_finite(), "{row:?}");
            worst = worst.max(ratio);
        }
        worst
    }

    #[test]
    fn dfg_matches_the_oracle() {
        let worst = worst_ratio(1e-9, dfg_ggx);
        assert!(worst <= 1.0, "{worst} times the tolerance");
    }

    #[test]
    fn table_rule_matches_the_oracle_less_closely() {
        let worst = worst_ratio(1e-6, dfg_ggx_table_entry);
        assert!(worst <= 1.0, "{worst} times the tolerance");
    }

    #[test]
    fn oracle_check_rejects_a_slightly_wrong_roughness() {
        assert!(worst_ratio(1e-9, |n_dot_v, roughness| dfg_ggx(n_dot_v, roughness * 1.00001)) > 10.0);
    }

    #[test]
    fn sheen_matches_the_oracle() {
        let mut worst: f64 = 0.0;
        for row in rows(LUT_SHEEN, "") {
            let error = (sheen_albedo(row[1], row[0]) - row[2]).abs();
            worst = worst.max(error);
        }
        assert!(worst <= 1e-6, "{worst}");
        assert!(
            (sheen_albedo(0.5, 0.501) - 0.229552783835).abs() > 1e-4,
            "the check must tell roughness apart"
        );
    }

    #[test]
    fn corners_are_finite_and_bounded() {
        for n_dot_v in [0.0, 1e-12, 1e-4, 0.5, 1.0, f64::NAN, -1.0, 2.0] {
            for roughness in [0.0, 1e-9, 1e-3, 4e-3, 0.05, 1.0, f64::NAN, -1.0, 2.0] {
                for value in [dfg_ggx(n_dot_v, roughness), dfg_ggx_table_entry(n_dot_v, roughness)] {
                    let total = value[0] + value[1];
                    assert!(
                        value[0] >= 0.0 && value[1] >= 0.0 && total <= 1.0 + 2e-3,
                        "{n_dot_v} {roughness} {value:?}"
                    );
                }
            }
        }
        assert_eq!(dfg_ggx(0.0, 0.0), [0.0, 1.0], "a mirror at grazing view");
    }

    #[test]
    fn small_roughness_tends_to_the_mirror() {
        let [scale, bias] = dfg_ggx(0.5, 1e-3);
        assert!((bias - 0.03125).abs() <= 1e-5 && (scale + bias - 1.0).abs() <= 1e-5, "{scale} {bias}");
    }
}
