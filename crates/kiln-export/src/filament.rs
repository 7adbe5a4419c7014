//! Filament: what `cmgen --format=ktx --deploy` writes.
//!
//! Facts, from google/filament:
//! - tools/cmgen/src/cmgen.cpp: `NAME_ibl.ktx` and `NAME_skybox.ktx`, KTX 1, faces +X −X +Y −Y +Z −Z,
//!   `R11F_G11F_B10F`; 256 down to 16 texels; roughness by `lodToPerceptualRoughness`; the nine harmonics as text in the
//!   pair `sh`, one coefficient a line.
//! - libs/ktxreader/src/Ktx1Reader.cpp: which `glType` it takes (see [`kiln_image::ktx1::Format`]);
//!   libs/image/src/Ktx1Bundle.cpp, `getSphericalHarmonics`: 27 numbers by `strtof`.
//! - shaders/src/surface_light_indirect.fs: `lod = iblRoughnessOneLevel · r · (2 − r)`, directions are looked up as they
//!   are, irradiance is the polynomial of [`crate::sh::filament`]. filament/src/materials/skybox.mat looks the sky up as it
//!   is; it is seen magnified, so one level is enough.
//! - cmgen itself turns a panorama by 180° about Y against Kiln's world (`CubemapUtils::equirectangularToCubemap` and
//!   the mirror that follows put its centre at +Z). Kiln keeps its own world.

use crate::conventions::{conventions, with_law};
use crate::cube_file::{Container, CubeStyle, cube_file, scale_for};
use crate::{BakedEnvironment, Cancel, ExportError, ExportFile, Preset, sh};
use kiln_bake::TexelFormat;
use serde_json::json;
use std::fmt::Write;

pub(crate) fn package(
    environment: &BakedEnvironment,
    format: TexelFormat,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    let scale_log2 = scale_for(environment, format);
    let style = CubeStyle { format, mirror: None, container: Container::Ktx1Filament, scale_log2 };
    // The engine's intensity multiplies texture and harmonics alike, so both carry the scale.
    let unscale = (0..scale_log2).fold(1.0, |value, _| value * 0.5);
    let harmonics = sh::filament(&environment.radiance_sh).map(|c| c.map(|value| value * unscale));
    let specular = environment.specular.iter().map(|level| &level.1);
    let pairs = vec![("sh".to_owned(), metadata(&harmonics))];
    let (ibl, ibl_facts) =
        cube_file(format!("{}_ibl.ktx", environment.name), specular, style, pairs, cancel)?;
    let sky = environment.skybox.iter().take(1);
    let (skybox, skybox_facts) =
        cube_file(format!("{}_skybox.ktx", environment.name), sky, style, Vec::new(), cancel)?;
    let text =
        ExportFile { path: format!("{}_sh.txt", environment.name), bytes: text(&harmonics).into_bytes() };
    let chain = environment.specular.iter().map(|level| level.0);
    let facts = vec![
        with_law(
            ibl_facts
                .json(&ibl.path, "GGX chain and, in the pair `sh`, irradiance harmonics, for IndirectLight"),
            &Preset::Filament.law(),
            chain,
        ),
        skybox_facts.json(&skybox.path, "radiance, for Skybox; level 0 only: a sky is seen magnified"),
        json!({
            "path": text.path,
            "holds": "the same harmonics as cmgen prints them",
            "evaluation": "E/pi = c0 + c1 y + c2 z + c3 x + c4 xy + c5 yz + c6 (3zz - 1) + c7 zx + c8 (xx - yy)",
        }),
    ];
    let notes = [
        ("intensity", "IndirectLight::intensity: wanted lux per unit, times multiply_by"),
        (
            "orientation",
            "cmgen puts a panorama's centre at +Z, Kiln at -Z: half a turn about Y apart, neither is mirrored",
        ),
    ];
    let conventions = conventions(Preset::Filament, environment, scale_log2, facts, &notes);
    Ok(vec![ibl, skybox, text, conventions])
}

/// One coefficient a line. `f32` in its shortest form: what the reader keeps.
fn metadata(harmonics: &[[f64; 3]; 9]) -> String {
    harmonics.iter().fold(String::new(), |mut text, c| {
        let [r, g, b] = c.map(|value| value as f32);
        writeln!(text, "{r} {g} {b}").expect("writing to memory succeeds");
        text
    })
}

fn text(harmonics: &[[f64; 3]; 9]) -> String {
    let names = (0..3_i32).flat_map(|l| (-l..=l).map(move |m| (l, m)));
    harmonics.iter().zip(names).fold(String::new(), |mut text, ([r, g, b], (l, m))| {
        writeln!(text, "({r:18.15}, {g:18.15}, {b:18.15}); // L{l}{m}, irradiance, pre-scaled base")
            .expect("writing to memory succeeds");
        text
    })
}
