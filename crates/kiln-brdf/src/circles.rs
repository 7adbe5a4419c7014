//! Integrals of a lobe over all lights, by quadrature over half vectors.
//!
//! ∫ D V n·l (…) dω_l = ∫ D V n·l · 4 v·h (…) dω_h. With the half vector at (θ, φ) from the normal and φ = 0 towards V
//!
//! ```text
//! v·h = cos θ_v cos θ + sin θ_v sin θ cos φ        n·l = 2 v·h cos θ − n·v
//! ```
//!
//! so D depends on θ alone and each circle of constant θ meets a given n·l at one |φ| only: the horizon n·l = 0 cuts it
//! once (everything is lit for 2θ < π/2 − θ_v, nothing for 2θ > π/2 + θ_v), and so does a kink of V. On θ the
//! variable asinh(θ / α) takes the lobe's scale away; the rules on both variables crowd towards the ends of
//! each piece, where peak, horizon and transitions are.

use crate::lobes::schlick_weight;
use crate::quadrature::Node;
use std::f64::consts::FRAC_PI_2;

/// D · V for one view.
pub(crate) struct Lobe<D, S> {
    /// θ_h on which D varies: α for GGX.
    pub(crate) scale: f64,
    /// D from sin² θ_h.
    pub(crate) distribution: D,
    /// V · n·l from n·l.
    pub(crate) scattered: S,
    /// An n·l in (0, 1) at which V is not smooth.
    pub(crate) kink: Option<f64>,
}

/// What one integral's quadrature is made of.
pub(crate) struct Rule {
    /// Over each piece of θ.
    pub(crate) polar: Vec<Node>,
    /// Over each piece of φ.
    pub(crate) azimuth: Vec<Node>,
}

/// [∫ D V n·l (1 − (1 − v·h)⁵) dω_l, ∫ D V n·l (1 − v·h)⁵ dω_l] over the light's hemisphere, 0 ≤ `n_dot_v` ≤ 1.
pub(crate) fn integrate<D, S>(n_dot_v: f64, lobe: &Lobe<D, S>, rule: &Rule) -> [f64; 2]
where
    D: Fn(f64) -> f64,
    S: Fn(f64) -> f64,
{
    let view = View { lobe, n_dot_v, sin_v: ((1.0 - n_dot_v) * (1.0 + n_dot_v)).sqrt() };
    let (edges, count) = polar_edges(n_dot_v, lobe.kink);
    let mut sum = [0.0; 2];
    for edge in edges[..count].windows(2) {
        let [start, end] = [edge[0], edge[1]].map(|theta| libm::asinh(theta / lobe.scale));
        for node in &rule.polar {
            let w = start + (end - start) * node.from_start;
            let growth = libm::exp(w);
            let [sinh, cosh] = [0.5 * (growth - 1.0 / growth), 0.5 * (growth + 1.0 / growth)];
            let weight = node.weight * (end - start) * lobe.scale * cosh;
            let circle = view.circle(lobe.scale * sinh, &rule.azimuth);
            sum[0] += weight * circle[0];
            sum[1] += weight * circle[1];
        }
    }
    sum
}

/// The θ between which the integrand is smooth, ascending from 0 to where all is dark, and how many they are.
fn polar_edges(n_dot_v: f64, kink: Option<f64>) -> ([f64; 5], usize) {
    let theta_v = libm::acos(n_dot_v);
    // asin(n·v) keeps its digits at grazing views, π/2 − acos does not.
    let mut edges = [0.0, 0.5 * libm::asin(n_dot_v), 0.5 * (FRAC_PI_2 + theta_v), 0.0, 0.0];
    let mut count = 3;
    if let Some(kink) = kink {
        let theta_kink = libm::acos(kink);
        edges[3] = 0.5 * (theta_kink - theta_v).abs();
        edges[4] = 0.5 * (theta_kink + theta_v);
        count = 5;
    }
    edges[..count].sort_unstable_by(f64::total_cmp);
    (edges, count)
}

/// What stays the same during one integral.
struct View<'a, D, S> {
    lobe: &'a Lobe<D, S>,
    n_dot_v: f64,
    sin_v: f64,
}

impl<D: Fn(f64) -> f64, S: Fn(f64) -> f64> View<'_, D, S> {
    /// The integrand over all φ per dθ.
    fn circle(&self, theta: f64, azimuth: &[Node]) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(theta);
        let (along, across) = (self.n_dot_v * cosine, self.sin_v * sine);
        // sin²(|φ|/2) at which n·l has a value.
        let half_angle = |n_dot_l: f64| {
            let needed = 0.5 * n_dot_l / cosine + self.n_dot_v * (0.5 / cosine - cosine);
            // 0/0 (one point) counts as dark.
            (0.5 - 0.5 * needed / across).clamp(0.0, 1.0).max(0.0)
        };
        let lit2 = half_angle(0.0);
        let kink2 = self.lobe.kink.map_or(0.0, half_angle);
        let mut sum = [0.0; 2];
        for [start2, end2] in [[0.0, kink2], [kink2, lit2]] {
            if start2 >= end2 {
                continue;
            }
            let (start, end) = (start2.sqrt(), end2.sqrt());
            let length = end - start;
            let mut piece = [0.0; 2];
            for node in azimuth {
                let s = start + length * node.from_start;
                let cos2 = 1.0 - end2 + length * node.from_end * (end + s);
                let v_dot_h = along + across - 2.0 * across * s * s;
                let n_dot_l = (2.0 * v_dot_h * cosine - self.n_dot_v).max(0.0);
                let value = node.weight * (self.lobe.scattered)(n_dot_l) * v_dot_h / cos2.sqrt();
                let fresnel = schlick_weight(v_dot_h.min(1.0));
                piece[0] += value;
                piece[1] += value * fresnel;
            }
            sum[0] += (piece[0] - piece[1]) * 2.0 * length;
            sum[1] += piece[1] * 2.0 * length;
        }
        // 4 v·h from the change of variables, both signs of φ, sin θ dθ.
        let weight = 8.0 * (self.lobe.distribution)(sine * sine) * sine;
        sum.map(|value| value * weight)
    }
}
