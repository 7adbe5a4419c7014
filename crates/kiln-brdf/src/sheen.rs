//! Directional albedo of the sheen lobe.

use crate::circles::{Lobe, Rule, integrate};
use crate::dfg::{Precision, bring_into};
use std::f64::consts::PI;

/// Least roughness of the lobe: below it the light comes from within 0.02 rad of the horizon.
const ROUGHNESS_MIN: f64 = 0.02;

/// Whether Ashikhmin's visibility, which grows without limit towards grazing angles, is cut off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SheenVisibility {
    /// As it is: the albedo exceeds 1 at grazing views and low roughness (three.js, glTF's sample viewer).
    Unclamped,
    /// min(V, 1) (Filament).
    Clamped,
}

/// Directional albedo of sheen, ∫ D V n·l dω_l with Charlie's D and Ashikhmin's V.
///
/// Both arguments are brought into [0, 1], roughness from 0.02; NaN counts as the least.
/// Checked by: `sheen_meets_every_oracle_row`.
pub fn sheen_albedo(
    visibility: SheenVisibility,
    n_dot_v: f64,
    perceptual_roughness: f64,
    precision: Precision,
) -> f64 {
    integrate_sheen(visibility, n_dot_v, perceptual_roughness, precision.rule())
}

pub(crate) fn integrate_sheen(
    visibility: SheenVisibility,
    n_dot_v: f64,
    perceptual_roughness: f64,
    rule: &Rule,
) -> f64 {
    let n_dot_v = bring_into(n_dot_v, 0.0);
    let roughness = bring_into(perceptual_roughness, ROUGHNESS_MIN);
    let inverse_alpha = 1.0 / (roughness * roughness);
    let gain = (2.0 + inverse_alpha) / (2.0 * PI);
    let v = |n_dot_l: f64| 0.25 / (n_dot_l + n_dot_v - n_dot_l * n_dot_v).max(f64::MIN_POSITIVE);
    let is_clamped = visibility == SheenVisibility::Clamped;
    // V = 1 where n·l + n·v − n·l n·v = 1/4.
    let kink = (0.25 - n_dot_v) / (1.0 - n_dot_v);
    let lobe = Lobe {
        scale: 1.0,
        distribution: |sin2_theta_h: f64| gain * libm::exp(0.5 * inverse_alpha * libm::log(sin2_theta_h)),
        scattered: |n_dot_l: f64| n_dot_l * if is_clamped { v(n_dot_l).min(1.0) } else { v(n_dot_l) },
        kink: (is_clamped && kink > 0.0).then_some(kink),
    };
    integrate(n_dot_v, &lobe, rule).iter().sum()
}
