//! How large errors are, in three numbers.

use serde::{Deserialize, Serialize};

/// Norms of a map's error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorNorms {
    /// Root of the mean square over the sphere and the channels, relative to that of the exact map.
    pub rms: f64,
    /// What 95 % of the sphere stays below: a direction's worst channel, relative to its exact value plus a hundredth of the
    /// mean radiance.
    pub p95: f64,
    /// The largest of these, the places where errors hide included.
    pub max: f64,
}

/// The error in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted {
    /// Solid angle that it stands for; 0 for places that only the largest error looks at.
    pub weight: f64,
    /// Mean square over the channels.
    pub square: f64,
    /// The worst channel, as [`ErrorNorms::p95`] counts it.
    pub local: f64,
}

impl ErrorNorms {
    /// Norms of many errors; `size2` is the mean square over sphere and channels that `rms` is relative to. NaN anywhere gives
    /// NaN.
    pub fn of(errors: impl Iterator<Item = Weighted>, size2: f64) -> ErrorNorms {
        let mut errors: Vec<Weighted> = errors.collect();
        errors.sort_by(|a, b| a.local.total_cmp(&b.local));
        let total: f64 = errors.iter().map(|error| error.weight).sum();
        let squares: f64 = errors.iter().map(|error| error.weight * error.square).sum();
        let mut below = 0.0;
        let p95 = errors.iter().find(|error| {
            below += error.weight;
            below >= 0.95 * total
        });
        let mean = if squares == 0.0 { 0.0 } else { squares / total };
        ErrorNorms {
            rms: if mean == 0.0 { 0.0 } else { (mean / size2).sqrt() },
            p95: p95.map_or(0.0, |error| error.local),
            max: errors.last().map_or(0.0, |error| error.local),
        }
    }

    /// Of a chain: the root of the mean square over its levels, and the largest of the other two.
    pub fn of_chain(levels: &[ErrorNorms]) -> ErrorNorms {
        let squares: f64 = levels.iter().map(|level| level.rms * level.rms).sum();
        let largest = |of: fn(&ErrorNorms) -> f64| {
            levels
                .iter()
                .map(of)
                .fold(0.0, |a: f64, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
        };
        ErrorNorms {
            rms: (squares / levels.len().max(1) as f64).sqrt(),
            p95: largest(|level| level.p95),
            max: largest(|level| level.max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{ErrorNorms, Weighted};

    #[test]
    fn norms_of_known_errors_and_of_nan() {
        let one = |local: f64, weight: f64| Weighted { weight, square: local * local, local };
        let errors = (1..=100).map(|i| one(f64::from(i), 1.0)).chain([one(500.0, 0.0)]);
        let norms = ErrorNorms::of(errors, 4.0);
        assert_eq!((norms.p95, norms.max), (95.0, 500.0));
        assert!((norms.rms - (3383.5_f64 / 4.0).sqrt()).abs() <= 1e-9, "{norms:?}");
        let broken = ErrorNorms::of([one(1.0, 1.0), one(f64::NAN, 1.0)].into_iter(), 1.0);
        assert!(broken.rms.is_nan() && broken.max.is_nan(), "NaN is no small error: {broken:?}");
        assert!(ErrorNorms::of_chain(&[norms, broken]).max.is_nan());
    }
}
