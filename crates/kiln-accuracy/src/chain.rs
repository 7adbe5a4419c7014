//! Which maps are compared: the levels of a lobe's chain.

use kiln_bake::{Lobe, RoughnessLaw};
use serde::{Deserialize, Serialize};

/// A lobe without its width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LobeKind {
    /// Specular reflection.
    Ggx,
    /// Irradiance over π.
    Lambert,
    /// Sheen.
    Charlie,
}

impl LobeKind {
    /// All of them.
    pub const ALL: [LobeKind; 3] = [LobeKind::Ggx, LobeKind::Lambert, LobeKind::Charlie];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            LobeKind::Ggx => "ggx",
            LobeKind::Lambert => "lambert",
            LobeKind::Charlie => "charlie",
        }
    }

    /// The lobe of a perceptual roughness.
    pub fn of_roughness(self, roughness: f64) -> Lobe {
        let alpha = roughness * roughness;
        match self {
            LobeKind::Ggx => Lobe::Ggx { alpha },
            LobeKind::Lambert => Lobe::Lambert,
            LobeKind::Charlie => Lobe::Charlie { alpha },
        }
    }
}

/// One map of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Which mip.
    pub mip: usize,
    /// Mips of the whole chain, the first included.
    pub mip_count: usize,
    /// Perceptual; 1 for Lambert.
    pub roughness: f64,
    /// What the map is convolved with.
    pub lobe: Lobe,
    /// Edge of its faces.
    pub face_size: usize,
}

impl Level {
    /// α of the lobe; 1 for Lambert.
    pub fn alpha(&self) -> f64 {
        match self.lobe {
            Lobe::Lambert => 1.0,
            Lobe::Ggx { alpha } | Lobe::Charlie { alpha } => alpha,
        }
    }

    /// Texels of the map.
    pub fn texels(&self) -> usize {
        6 * self.face_size * self.face_size
    }
}

/// Mips of a chain from `face_size` down to faces of 4 texels, at least one.
pub fn level_count(face_size: usize) -> usize {
    (face_size.max(4).ilog2() - 1) as usize
}

/// The maps of a lobe that an estimator has to make: from the first rough mip to the last; for Lambert one map of an
/// eighth of the size, at most 64.
pub fn chain(kind: LobeKind, face_size: usize, law: &RoughnessLaw) -> Vec<Level> {
    let mip_count = match law {
        RoughnessLaw::Custom(list) => list.len(),
        _ => level_count(face_size),
    };
    let level = |mip: usize| {
        let roughness = law.roughness(mip, mip_count);
        Level {
            mip,
            mip_count,
            roughness,
            lobe: kind.of_roughness(roughness),
            face_size: (face_size >> mip).max(1),
        }
    };
    match kind {
        LobeKind::Lambert => {
            let face_size = (face_size / 8).clamp(1, 64);
            vec![Level { mip: 0, mip_count: 1, roughness: 1.0, lobe: Lobe::Lambert, face_size }]
        }
        LobeKind::Ggx | LobeKind::Charlie => {
            (0..mip_count).map(level).filter(|level| level.roughness > 0.0).collect()
        }
    }
}

/// Blender's Eevee of the versions before 4: α = (mip / last)⁴, so perceptual roughness is the square of the mip's share.
pub fn eevee_probe_law(level_count: usize) -> RoughnessLaw {
    let last = level_count.max(2) - 1;
    let share = |mip: usize| mip as f64 / last as f64;
    RoughnessLaw::Custom((0..level_count.max(1)).map(|mip| share(mip) * share(mip)).collect())
}

#[cfg(test)]
mod tests {
    use super::{LobeKind, chain, eevee_probe_law};
    use kiln_bake::{Lobe, RoughnessLaw};

    #[test]
    fn chain_of_256_faces_has_six_rough_levels_down_to_four_texels() {
        let levels = chain(LobeKind::Ggx, 256, &RoughnessLaw::Linear);
        let sizes: Vec<usize> = levels.iter().map(|level| level.face_size).collect();
        assert_eq!(sizes, [128, 64, 32, 16, 8, 4]);
        assert_eq!(levels[5].lobe, Lobe::Ggx { alpha: 1.0 });
        assert_eq!(chain(LobeKind::Lambert, 256, &RoughnessLaw::Linear)[0].face_size, 32);
    }

    #[test]
    fn eevee_spreads_alpha_as_the_fourth_power() {
        let levels = chain(LobeKind::Ggx, 64, &eevee_probe_law(5));
        let alphas: Vec<f64> = levels.iter().map(|level| level.alpha()).collect();
        let expected = [0.25_f64.powi(4), 0.5_f64.powi(4), 0.75_f64.powi(4), 1.0];
        assert!(alphas.iter().zip(expected).all(|(a, e)| (a - e).abs() <= 1e-15), "{alphas:?}");
    }
}
