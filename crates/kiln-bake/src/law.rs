//! Roughness laws: which perceptual roughness each mip of a prefiltered chain is baked for.

use thiserror::Error;

/// Eevee's roughness of the last mip; rougher reflections are read from the diffuse probe
/// (Blender, eevee_defines.hh, `SPHERE_PROBE_MIP_MAX_ROUGHNESS`).
const EEVEE_ROUGHNESS_MAX: f64 = 0.7;
/// Share of the square root in Eevee's law (Blender, eevee_lightprobe_sphere_mapping_lib.glsl,
/// `sphere_probe_roughness_to_lod`).
const EEVEE_ROOT_SHARE: f64 = 0.4;

/// From mip to perceptual roughness. With m = mip/(n − 1) in a chain of n:
#[derive(Clone, Debug, PartialEq)]
pub enum RoughnessLaw {
    /// r = m: Kiln's own, Khronos' renderers, Bevy.
    Linear,
    /// Inverse of lod = (n − 1) · r · (2 − r), that is r = 1 − √(1 − m): Filament (cmgen.cpp, `lodToPerceptualRoughness`).
    Filament,
    /// Inverse of m = 0.6 q + 0.4 √q with q = r/0.7: Blender's Eevee. The last mip has roughness 0.7.
    Eevee,
    /// The roughness of each mip, first to last; the chain has as many.
    Custom(Vec<f64>),
}

/// Why a list is no law.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// No mip at all.
    #[error("a roughness law needs at least one value")]
    Empty,
    /// A value that is no roughness, or smaller than the one before.
    #[error("roughness {value} of mip {level} must be between {least} and 1: a chain only gets rougher")]
    Value {
        /// Which mip.
        level: usize,
        /// Its value.
        value: f64,
        /// Least allowed there.
        least: f64,
    },
}

impl RoughnessLaw {
    /// A law from a list, ascending values in 0 … 1; equal neighbours are legal.
    ///
    /// # Errors
    /// [`LawError`] with the first value that is wrong.
    pub fn custom(roughness: Vec<f64>) -> Result<RoughnessLaw, LawError> {
        if roughness.is_empty() {
            return Err(LawError::Empty);
        }
        let mut least = 0.0;
        for (level, &value) in roughness.iter().enumerate() {
            if !(least..=1.0).contains(&value) {
                return Err(LawError::Value { level, value, least });
            }
            least = value;
        }
        Ok(RoughnessLaw::Custom(roughness))
    }

    /// Perceptual roughness of mip `level` in a chain of `level_count`; 0 for a chain of one, unless a list says
    /// otherwise. Levels beyond the last have the last one's.
    pub fn roughness(&self, level: usize, level_count: usize) -> f64 {
        let m = if level_count < 2 { 0.0 } else { (level as f64 / (level_count - 1) as f64).min(1.0) };
        match self {
            RoughnessLaw::Linear => m,
            RoughnessLaw::Filament => 1.0 - (1.0 - m).sqrt(),
            RoughnessLaw::Eevee => {
                let (b, a) = (EEVEE_ROOT_SHARE, 1.0 - EEVEE_ROOT_SHARE);
                let root = ((b * b + 4.0 * a * m).sqrt() - b) / (2.0 * a);
                EEVEE_ROUGHNESS_MAX * root * root
            }
            RoughnessLaw::Custom(list) => list.get(level).or(list.last()).copied().unwrap_or(0.0),
        }
    }

    /// The mip, with fraction, at which a shader with this law reads `roughness`; undoes [`RoughnessLaw::roughness`].
    /// Clamped to the chain.
    pub fn level(&self, roughness: f64, level_count: usize) -> f64 {
        let last = level_count.saturating_sub(1) as f64;
        let r = roughness.clamp(0.0, 1.0);
        let m = match self {
            RoughnessLaw::Linear => r,
            RoughnessLaw::Filament => r * (2.0 - r),
            RoughnessLaw::Eevee => {
                let q = (r / EEVEE_ROUGHNESS_MAX).min(1.0);
                (1.0 - EEVEE_ROOT_SHARE) * q + EEVEE_ROOT_SHARE * q.sqrt()
            }
            RoughnessLaw::Custom(list) => {
                let above = list.partition_point(|&value| value <= r);
                let Some(&high) = list.get(above) else { return last };
                let Some(&low) = above.checked_sub(1).and_then(|below| list.get(below)) else { return 0.0 };
                return ((above - 1) as f64 + (r - low) / (high - low)).min(last);
            }
        };
        m * last
    }

    /// The law's name in files: `linear`, `filament`, `eevee`, `custom`.
    pub fn name(&self) -> &'static str {
        match self {
            RoughnessLaw::Linear => "linear",
            RoughnessLaw::Filament => "filament",
            RoughnessLaw::Eevee => "eevee",
            RoughnessLaw::Custom(_) => "custom",
        }
    }

    /// The law as a formula, for people and files.
    pub fn formula(&self) -> String {
        match self {
            RoughnessLaw::Linear => "roughness = mip / (levels - 1)".to_owned(),
            RoughnessLaw::Filament => "mip = (levels - 1) * roughness * (2 - roughness)".to_owned(),
            RoughnessLaw::Eevee => {
                "mip = (levels - 1) * (0.6 * q + 0.4 * sqrt(q)), q = min(roughness / 0.7, 1)".to_owned()
            }
            RoughnessLaw::Custom(list) => format!("roughness of each mip: {list:?}"),
        }
    }
}

/// Perceptual roughness of mip `level` in a chain of `level_count` under [`RoughnessLaw::Linear`]: level/(n − 1), 0 for
/// a chain of one.
pub fn roughness_of_level(level: usize, level_count: usize) -> f64 {
    RoughnessLaw::Linear.roughness(level, level_count)
}

#[cfg(test)]
mod tests {
    use super::{LawError, RoughnessLaw, roughness_of_level};

    fn laws() -> Vec<RoughnessLaw> {
        let custom = RoughnessLaw::custom(vec![0.0, 0.1, 0.3, 0.6, 0.9]).expect("ascending");
        vec![RoughnessLaw::Linear, RoughnessLaw::Filament, RoughnessLaw::Eevee, custom]
    }

    #[test]
    fn reading_a_level_undoes_baking_it() {
        for law in laws() {
            for level in 0..5 {
                let back = law.level(law.roughness(level, 5), 5);
                assert!((back - level as f64).abs() <= 1e-12, "{law:?}, level {level}: {back}");
            }
        }
    }

    #[test]
    fn filament_levels_are_those_of_cmgen() {
        // cmgen prints 0.134 0.293 0.5 1 for mips 1 to 4 of 5.
        let printed = [0.0, 0.134, 0.293, 0.5, 1.0];
        for (level, printed) in printed.into_iter().enumerate() {
            assert!((RoughnessLaw::Filament.roughness(level, 5) - printed).abs() < 5e-4);
        }
        assert!((RoughnessLaw::Linear.roughness(2, 5) - printed[2]).abs() > 0.1, "the check itself");
    }

    #[test]
    fn eevee_ends_at_seven_tenths_and_one_mip_is_legal_everywhere() {
        assert!((RoughnessLaw::Eevee.roughness(4, 5) - 0.7).abs() <= 1e-15);
        for law in laws() {
            assert_eq!((law.roughness(0, 1), law.level(0.5, 1)), (0.0, 0.0), "{law:?}");
        }
        assert_eq!(
            [roughness_of_level(3, 7), roughness_of_level(9, 7), roughness_of_level(0, 0)],
            [0.5, 1.0, 0.0]
        );
    }

    #[test]
    fn lists_that_fall_or_leave_the_range_are_refused() {
        let value = |list: &[f64]| RoughnessLaw::custom(list.to_vec());
        assert_eq!(value(&[]), Err(LawError::Empty));
        assert_eq!(value(&[0.0, 0.5, 0.4]), Err(LawError::Value { level: 2, value: 0.4, least: 0.5 }));
        assert!(value(&[0.0, 1.1]).is_err() && value(&[f64::NAN]).is_err() && value(&[-0.1]).is_err());
        assert!(value(&[0.3]).is_ok_and(|law| law.roughness(0, 1) == 0.3), "a list may begin anywhere");
    }
}
