//! Khronos: the files of glTF-IBL-Sampler, which glTF-Sample-Renderer and others read.
//!
//! Facts, from KhronosGroup/glTF-Sample-Renderer:
//! - source/Renderer/shaders/ibl.glsl: Lambert, GGX and Charlie cubes are looked up at `u_EnvRotation · direction`, the
//!   level is `roughness · (u_MipCount − 1)` for both chains; the Lambert map is E/π (it multiplies the base colour);
//!   tables at (n·v, roughness): GGX in r and g.
//! - source/ibl_sampler.js: 256 texels, levels down to 16 (`lowestMipLevel = 4`).
//! - The sampler itself puts a panorama's centre at +X. Kiln keeps its own world: directions are right where
//!   `u_EnvRotation` is the identity; the viewer's setting turns them about Y.

use crate::conventions::{conventions, with_law};
use crate::cube_file::{Container, CubeStyle, cube_file, scale_for};
use crate::{BakedEnvironment, Cancel, ExportError, ExportFile, Preset};
use kiln_bake::TexelFormat;
use kiln_image::{ktx2, png};
use serde_json::json;

pub(crate) fn package(
    environment: &BakedEnvironment,
    format: TexelFormat,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    let scale_log2 = scale_for(environment, format);
    let style = CubeStyle { format, mirror: None, container: Container::Ktx2, scale_log2 };
    let name = |map: &str| format!("{}_{map}.ktx2", environment.name);
    let law = Preset::Khronos.law();
    let (mut files, mut facts) = (Vec::new(), Vec::new());
    let (file, fact) =
        cube_file(name("lambertian"), environment.irradiance.iter(), style, Vec::new(), cancel)?;
    facts.push(fact.json(&file.path, "E / pi"));
    files.push(file);
    let chains = [("ggx", Some(&environment.specular)), ("charlie", environment.sheen.as_ref())];
    for (map, chain) in chains.into_iter().filter_map(|(map, chain)| Some((map, chain?))) {
        let (file, fact) =
            cube_file(name(map), chain.iter().map(|level| &level.1), style, Vec::new(), cancel)?;
        let holds = if map == "ggx" { "GGX chain" } else { "Charlie chain" };
        facts.push(with_law(fact.json(&file.path, holds), &law, chain.iter().map(|level| level.0)));
        files.push(file);
    }
    if let Some(dfg) = &environment.dfg {
        cancel.check()?;
        let rgb = |entry: &[f32; 2]| {
            [entry[0], entry[1], 0.0].map(|value| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
        };
        let bytes: Vec<u8> = dfg.entries.iter().flat_map(rgb).collect();
        let picture = ExportFile {
            path: "lut_ggx.png".to_owned(),
            bytes: png::encode_rgb8(dfg.size, dfg.size, &bytes),
        };
        let level = ktx2::Format::R16G16_SFLOAT.encode(dfg.entries.as_flattened(), 2);
        let texture = ktx2::Texture {
            format: ktx2::Format::R16G16_SFLOAT,
            width: dfg.size,
            height: dfg.size,
            faces: 1,
            levels: vec![&level],
            key_values: Vec::new(),
        };
        let table = ExportFile { path: "lut_ggx.ktx2".to_owned(), bytes: ktx2::write(&texture) };
        let axes = "column: n.v, row from the top: perceptual roughness, texel centres; r scale, g bias";
        facts.push(
            json!({"path": picture.path, "holds": "GGX table, 8-bit linear: banding of 2e-3", "axes": axes}),
        );
        facts.push(json!({"path": table.path, "holds": "GGX table, RG16F", "axes": axes}));
        files.extend([picture, table]);
    }
    let notes = [
        ("intensity", "u_EnvIntensity: wanted intensity times multiply_by"),
        ("rotation", "directions are Kiln's where u_EnvRotation is the identity"),
        ("charlie_lut", "the viewer's own lut_charlie.png and lut_sheen_E.png go with the Charlie chain"),
    ];
    files.push(conventions(Preset::Khronos, environment, scale_log2, facts, &notes));
    Ok(files)
}
