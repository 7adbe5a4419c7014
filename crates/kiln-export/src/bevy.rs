//! Bevy: two cubes for `EnvironmentMapLight`, one for `Skybox`.
//!
//! Facts, from bevyengine/bevy:
//! - crates/bevy_pbr/src/light_probe/environment_map.wesl: both maps are read at (x, y, −z) ("Cubemaps are left-handed,
//!   so we negate the Z coordinate"); the level is `perceptual_roughness · (textureNumLevels − 1)`; the diffuse sample
//!   is multiplied by the diffuse colour without 1/π, so it is E/π; `intensity` multiplies both.
//! - crates/bevy_core_pipeline/src/skybox/skybox.wgsl: the sky is read at (x, y, −z) too, times `brightness`.
//! - assets/environment_maps/*_rgb9e5_zstd.ktx2: Bevy's own maps are RGB9E5 in KTX2 with Zstandard, which its
//!   features for the two load and every GPU filters.

use crate::conventions::{conventions, with_law};
use crate::cube_file::{Container, CubeStyle, cube_file, scale_for};
use crate::{BakedEnvironment, Cancel, ExportError, ExportFile, Preset};
use kiln_bake::TexelFormat;
use kiln_image::cube_layout::Mirror;

pub(crate) fn package(
    environment: &BakedEnvironment,
    format: TexelFormat,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    let scale_log2 = scale_for(environment, format);
    let style = CubeStyle { format, mirror: Some(Mirror::Z), container: Container::Ktx2Zstd, scale_log2 };
    let name = |map: &str| format!("{}_{map}.ktx2", environment.name);
    let specular = environment.specular.iter().map(|level| &level.1);
    let (diffuse, diffuse_facts) =
        cube_file(name("diffuse"), environment.irradiance.iter(), style, Vec::new(), cancel)?;
    let (specular, specular_facts) = cube_file(name("specular"), specular, style, Vec::new(), cancel)?;
    let (skybox, skybox_facts) =
        cube_file(name("skybox"), environment.skybox.iter(), style, Vec::new(), cancel)?;
    let chain = environment.specular.iter().map(|level| level.0);
    let facts = vec![
        diffuse_facts.json(&diffuse.path, "E / pi, for EnvironmentMapLight::diffuse_map"),
        with_law(
            specular_facts.json(&specular.path, "GGX chain, for EnvironmentMapLight::specular_map"),
            &Preset::Bevy.law(),
            chain,
        ),
        skybox_facts.json(&skybox.path, "radiance, for Skybox::image"),
    ];
    let notes = [
        (
            "intensity",
            "EnvironmentMapLight::intensity and Skybox::brightness: wanted cd/m² per unit, times multiply_by",
        ),
        (
            "mirror",
            "Bevy reads cubes at (x, y, -z); the texels are mirrored so that directions come out right",
        ),
        ("features", "needs Bevy's Cargo features for KTX2 and Zstandard"),
    ];
    let conventions = conventions(Preset::Bevy, environment, scale_log2, facts, &notes);
    Ok(vec![diffuse, specular, skybox, conventions])
}
