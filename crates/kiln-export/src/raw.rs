//! Raw: everything Kiln has in its own conventions, unrounded unless another format is asked for.

use crate::conventions::{conventions, with_law};
use crate::cube_file::{Container, CubeStyle, cube_file, scale_for};
use crate::{BakedEnvironment, Cancel, ExportError, ExportFile, Preset};
use kiln_bake::TexelFormat;
use kiln_image::{exr_write, ktx2};
use serde_json::json;

pub(crate) fn package(
    environment: &BakedEnvironment,
    format: TexelFormat,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    let scale_log2 = scale_for(environment, format);
    let style = CubeStyle { format, mirror: None, container: Container::Ktx2, scale_log2 };
    let name = |map: &str| format!("{}_{map}", environment.name);
    let law = Preset::Raw.law();
    let (mut files, mut facts) = (Vec::new(), Vec::new());
    let plain = [
        ("skybox.ktx2", "radiance", environment.skybox.as_slice()),
        ("irradiance.ktx2", "E / pi", environment.irradiance.as_slice()),
    ];
    for (map, holds, levels) in plain {
        let (file, fact) = cube_file(name(map), levels.iter(), style, Vec::new(), cancel)?;
        facts.push(fact.json(&file.path, holds));
        files.push(file);
    }
    let chains = [
        ("specular.ktx2", "GGX chain", Some(&environment.specular)),
        ("sheen.ktx2", "Charlie chain", environment.sheen.as_ref()),
    ];
    for (map, holds, chain) in chains.into_iter().filter_map(|(map, holds, chain)| Some((map, holds, chain?)))
    {
        let (file, fact) =
            cube_file(name(map), chain.iter().map(|level| &level.1), style, Vec::new(), cancel)?;
        facts.push(with_law(fact.json(&file.path, holds), &law, chain.iter().map(|level| level.0)));
        files.push(file);
    }

    let sky = &environment.skybox[0];
    let panorama = kiln_bake::panorama_of_cube(sky, cancel)?;
    let panorama =
        ExportFile { path: name("panorama.exr"), bytes: exr_write::encode_panorama(&panorama, cancel)? };
    facts.push(json!({
        "path": panorama.path, "holds": "radiance panorama", "format": "OpenEXR, binary32, ZIP, envmap latlong",
        "centre": "-Z", "resampled": "area means of the skybox cube, two rows a face texel: flux is kept",
    }));
    let cube = ExportFile { path: name("cube.exr"), bytes: exr_write::encode_cube(sky, cancel)? };
    facts.push(json!({
        "path": cube.path, "holds": "radiance cube", "format": "OpenEXR, binary32, ZIP, envmap cube",
        "faces": "OpenEXR's +X -X +Y -Y +Z -Z from the top, each unmirrored as seen from inside",
        "axes": "turned by 180 degrees about +Y, as the panorama is: OpenEXR's +Z is -Z here, its +X is -X",
    }));
    files.extend([panorama, cube]);

    let harmonics = json!({
        "order": environment.radiance_sh.len().isqrt() - 1,
        "holds": "radiance: integral of L Y_lm over the sphere, at l(l+1)+m, r g b each",
        "basis": "real, orthonormal, no Condon-Shortley sign: Y_1,-1 = 0.4886 y, Y_1,0 = 0.4886 z, Y_1,1 = 0.4886 x",
        "irradiance_over_pi": "multiply degree l by 1, 2/3, 1/4, 0, -1/24, 0, 1/64, 0, -1/128",
        "coefficients": environment.radiance_sh,
    });
    let mut bytes = serde_json::to_vec_pretty(&harmonics).expect("numbers and strings");
    bytes.push(b'\n');
    facts.push(json!({"path": name("sh.json"), "holds": "radiance harmonics"}));
    files.push(ExportFile { path: name("sh.json"), bytes });

    if let Some(dfg) = &environment.dfg {
        let level = ktx2::Format::R32G32_SFLOAT.encode(dfg.entries.as_flattened(), 2);
        let texture = ktx2::Texture {
            format: ktx2::Format::R32G32_SFLOAT,
            width: dfg.size,
            height: dfg.size,
            faces: 1,
            levels: vec![&level],
            key_values: Vec::new(),
        };
        facts.push(json!({
            "path": "lut_ggx.ktx2", "holds": "GGX table, RG32F: reflectance = F0 * r + g",
            "axes": "column: n.v, row from the top: perceptual roughness, texel centres",
        }));
        files.push(ExportFile { path: "lut_ggx.ktx2".to_owned(), bytes: ktx2::write(&texture) });
    }
    let notes = [
        ("lookup", "cubes as Vulkan samples them, direction (x, y, z)"),
        ("multiply_by", "holds for KTX2 cubes; EXR files, harmonics and tables are not scaled"),
    ];
    files.push(conventions(Preset::Raw, environment, scale_log2, facts, &notes));
    Ok(files)
}
