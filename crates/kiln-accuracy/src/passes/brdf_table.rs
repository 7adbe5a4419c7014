//! The split sum's table by importance sampling: twin of `shaders/bake/brdf_table.wgsl`.

use kiln_brdf::sampling::{hammersley, sample_ggx};
use kiln_brdf::{Masking, Precision, dfg};
use kiln_sphere::{Cancel, Cancelled};
use rayon::prelude::*;

use super::prefilter_jittered::{JITTER, jitter};
use crate::norms::{ErrorNorms, Weighted};

/// A table as somebody makes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableEstimator {
    /// Its name.
    pub name: &'static str,
    /// Whose it is.
    pub title: &'static str,
    /// Texels along an edge.
    pub size: usize,
    /// Samples a texel; `None`: quadrature.
    pub sample_count: Option<u32>,
    /// Its own masking term. What another term would give is no error of the estimator, but is measured too.
    pub masking: Masking,
    /// Azimuth of the view in the samples' frame, as a share of a turn: tutorials' tangent of (0, 0, 1) is a quarter away.
    pub turn: f64,
    /// Whether their hash turns the samples; it is that of the table's normal, and so the same for all texels.
    pub is_jittered: bool,
}

/// What is compared.
pub const TABLES: [TableEstimator; 4] = [
    TableEstimator {
        name: "quadrature",
        title: "Kiln, quadrature",
        size: 256,
        sample_count: None,
        masking: Masking::SmithCorrelated,
        turn: 0.0,
        is_jittered: false,
    },
    TableEstimator {
        name: "eevee",
        title: "Eevee before Blender 4, 64² × 8192",
        size: 64,
        sample_count: Some(8192),
        masking: Masking::SmithSeparable,
        turn: 0.0,
        is_jittered: false,
    },
    TableEstimator {
        name: "opengl",
        title: "OpenGL tutorials, 512² × 1024",
        size: 512,
        sample_count: Some(1024),
        masking: Masking::SchlickIbl,
        turn: 0.25,
        is_jittered: false,
    },
    TableEstimator {
        name: "vulkan",
        title: "Vulkan samples, 256² × 1024, jittered",
        size: 256,
        sample_count: Some(1024),
        masking: Masking::SchlickIbl,
        turn: 0.25,
        is_jittered: true,
    },
];

/// Means of 4 V (n·l) (v·h) / (n·h) over half vectors of GGX, split by Schlick's weight (1 − v·h)⁵.
pub fn scale_bias(
    masking: Masking,
    n_dot_v: f64,
    perceptual_roughness: f64,
    count: u32,
    turn: f64,
) -> [f64; 2] {
    let alpha = (perceptual_roughness * perceptual_roughness).clamp(1e-6, 1.0);
    let sine = ((1.0 - n_dot_v) * (1.0 + n_dot_v)).max(0.0).sqrt();
    let (sin_turn, cos_turn) = libm::sincos(2.0 * std::f64::consts::PI * turn);
    let mut sum = [0.0; 2];
    for index in 0..count {
        let [x, y, z] = sample_ggx(hammersley(index, count), alpha);
        let v_dot_h = (sine * (x * cos_turn + y * sin_turn) + n_dot_v * z).clamp(0.0, 1.0);
        let n_dot_l = 2.0 * v_dot_h * z - n_dot_v;
        if n_dot_l > 0.0 {
            let weight = 4.0 * masking.scattered(alpha, n_dot_v, n_dot_l) * v_dot_h / z.max(1e-6);
            let fresnel = (1.0 - v_dot_h).powi(5);
            sum[0] += weight * (1.0 - fresnel);
            sum[1] += weight * fresnel;
        }
    }
    sum.map(|value| value / f64::from(count))
}

impl TableEstimator {
    /// Azimuth of the view in the samples' frame, jitter included.
    pub fn view_turn(&self) -> f64 {
        let jitter = if self.is_jittered { JITTER * jitter([0.0, 0.0, 1.0]) } else { 0.0 };
        self.turn - jitter
    }

    /// [scale, bias] at one place.
    pub fn entry(&self, n_dot_v: f64, perceptual_roughness: f64) -> [f64; 2] {
        match self.sample_count {
            Some(count) => scale_bias(self.masking, n_dot_v, perceptual_roughness, count, self.view_turn()),
            None => dfg(self.masking, n_dot_v, perceptual_roughness, Precision::Table),
        }
    }

    /// Its texels' error on an evenly spread `probes`² of them: of its own integral, and of height-correlated Smith's, which
    /// glTF asks for. Absolute, as the terms are at most 1.
    ///
    /// # Errors
    /// [`Cancelled`] within a row of probes.
    pub fn measure(&self, probes: usize, cancel: Cancel) -> Result<[ErrorNorms; 2], Cancelled> {
        let place = |index: usize| {
            let texel = (2 * index + 1) * self.size / (2 * probes);
            (texel as f64 + 0.5) / self.size as f64
        };
        let rows: Vec<Vec<[Weighted; 2]>> = (0..probes)
            .into_par_iter()
            .map(|row| {
                cancel.check()?;
                let errors = (0..probes).map(|column| {
                    let (n_dot_v, roughness) = (place(column), place(row));
                    let found = self.entry(n_dot_v, roughness);
                    [self.masking, Masking::SmithCorrelated].map(|masking| {
                        let exact = dfg(masking, n_dot_v, roughness, Precision::Full);
                        let off = (0..2).map(|i| (found[i] - exact[i]).abs());
                        Weighted {
                            weight: 1.0,
                            square: off.clone().map(|e| e * e).sum::<f64>() / 2.0,
                            local: off.fold(0.0, f64::max),
                        }
                    })
                });
                Ok(errors.collect())
            })
            .collect::<Result<_, Cancelled>>()?;
        let all: Vec<[Weighted; 2]> = rows.concat();
        Ok([0, 1].map(|i| ErrorNorms::of(all.iter().map(|pair| pair[i]), 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::{TABLES, scale_bias};
    use kiln_bake::{Cancel, Masking};
    use kiln_brdf::dfg_ggx;

    #[test]
    fn tables_are_off_by_their_samples_and_quadrature_is_not() {
        let own: Vec<f64> = TABLES.iter().map(|t| t.measure(6, Cancel::NEVER).unwrap()[0].max).collect();
        assert!(own[0] <= 5e-5, "{own:?}");
        assert!(own[1..].iter().all(|error| (1e-4..0.2).contains(error)), "{own:?}");
    }

    #[test]
    fn another_masking_term_is_told_from_noise() {
        let [own, other] = TABLES[2].measure(6, Cancel::NEVER).unwrap();
        assert!(other.rms > 2.0 * own.rms, "{own:?} {other:?}");
        let [scale, bias] = scale_bias(Masking::SmithCorrelated, 0.9, 0.5, 4096, 0.0);
        let exact = dfg_ggx(0.9, 0.5);
        assert!((scale - exact[0]).abs() <= 2e-3 && (bias - exact[1]).abs() <= 2e-3);
    }
}
