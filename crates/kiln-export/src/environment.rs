//! What was baked, as values.

use crate::{ExportError, Preset};
use kiln_image::Cube;

/// The maps of one environment in `kiln-bake`'s conventions, unscaled. What an engine does not read may be empty or
/// `None`, see [`Preset::wish`].
#[derive(Clone, Debug, PartialEq)]
pub struct BakedEnvironment {
    /// Begins the names of files.
    pub name: String,
    /// Radiance and its mips, each half as large (rounded down) as the one before.
    pub skybox: Vec<Cube>,
    /// Perceptual roughness and the GGX-filtered map; sizes halve from level to level.
    pub specular: Vec<(f64, Cube)>,
    /// The same for Charlie.
    pub sheen: Option<Vec<(f64, Cube)>>,
    /// E/π.
    pub irradiance: Option<Cube>,
    /// Radiance, ∫ L Y_lm dω at l(l + 1) + m in the real orthonormal basis of [`kiln_sphere::real_harmonics`]; any
    /// square number of them.
    pub radiance_sh: Vec<[f64; 3]>,
    /// Split-sum table of GGX.
    pub dfg: Option<DfgTable>,
}

/// Reflectance = F0 · scale + bias.
#[derive(Clone, Debug, PartialEq)]
pub struct DfgTable {
    /// Entries along a side.
    pub size: usize,
    /// `size²` pairs (scale, bias): column x is n·v = (x + ½)/size, row y perceptual roughness (y + ½)/size.
    pub entries: Vec<[f32; 2]>,
}

/// Roughness may differ by this much from the law: it has been through text.
const ROUGHNESS_TOLERANCE: f64 = 1e-6;

impl BakedEnvironment {
    /// Whether everything is there that the preset writes, in the right sizes.
    pub(crate) fn check(&self, preset: Preset) -> Result<(), ExportError> {
        let is_file_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
        if self.name.is_empty() || self.name.starts_with('.') || !self.name.bytes().all(is_file_name) {
            return Err(ExportError::Name(self.name.clone()));
        }
        let missing = |map| Err(ExportError::Missing { preset: preset.name(), map });
        let wish = preset.wish(self.specular.first().map_or(1, |level| level.1.face_size));
        if self.skybox.is_empty() {
            return missing("skybox");
        }
        check_sizes("skybox", self.skybox.iter())?;
        if wish.specular_levels > 0 {
            if self.specular.is_empty() {
                return missing("specular chain");
            }
            check_chain(preset, "specular chain", &self.specular)?;
        }
        if wish.sheen {
            match self.sheen.as_deref() {
                None | Some([]) => return missing("sheen chain"),
                Some(sheen) => check_chain(preset, "sheen chain", sheen)?,
            }
        }
        if wish.irradiance_face.is_some() {
            let Some(irradiance) = &self.irradiance else { return missing("irradiance map") };
            check_sizes("irradiance map", std::iter::once(irradiance))?;
        }
        if wish.sh_order.is_some() {
            let actual = self.radiance_sh.len();
            if actual < 9 || actual.isqrt().pow(2) != actual {
                return Err(ExportError::Harmonics { needed: 9, actual });
            }
        }
        if wish.dfg_size.is_some() {
            let Some(dfg) = &self.dfg else { return missing("BRDF table") };
            if dfg.size == 0 || dfg.size.checked_mul(dfg.size) != Some(dfg.entries.len()) {
                return Err(ExportError::Table { size: dfg.size, actual: dfg.entries.len() });
            }
        }
        Ok(())
    }

    /// Largest value of any map; what is not finite counts as nothing.
    pub(crate) fn max_value(&self) -> f32 {
        let chains = self.specular.iter().chain(self.sheen.iter().flatten()).map(|level| &level.1);
        let cubes = self.skybox.iter().chain(chains).chain(&self.irradiance);
        let values = cubes.flat_map(|cube| cube.rgb.iter().copied());
        values.filter(|value| value.is_finite()).fold(0.0, f32::max)
    }
}

fn check_chain(preset: Preset, map: &'static str, chain: &[(f64, Cube)]) -> Result<(), ExportError> {
    check_sizes(map, chain.iter().map(|level| &level.1))?;
    let law = preset.law();
    for (level, &(actual, _)) in chain.iter().enumerate() {
        let expected = law.roughness(level, chain.len());
        let is_right = (actual - expected).abs() <= ROUGHNESS_TOLERANCE;
        if !is_right {
            let (preset, law) = (preset.name(), law.name());
            return Err(ExportError::Roughness { preset, map, level, expected, actual, law });
        }
    }
    Ok(())
}

fn check_sizes<'a>(map: &'static str, levels: impl Iterator<Item = &'a Cube>) -> Result<(), ExportError> {
    let mut expected = None;
    for (level, cube) in levels.enumerate() {
        let size = cube.face_size;
        let is_full =
            size > 0 && size.checked_mul(size).and_then(|n| n.checked_mul(18)) == Some(cube.rgb.len());
        let actual = if is_full { size } else { 0 };
        let wanted = expected.unwrap_or(size.max(1));
        // Below one texel there is no further level.
        if actual != wanted {
            return Err(ExportError::Level { map, level, expected: wanted, actual });
        }
        expected = Some(size / 2);
    }
    Ok(())
}
