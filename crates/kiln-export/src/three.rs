//! three.js: it filters for itself (`PMREMGenerator`), so it gets radiance and harmonics.
//!
//! Facts, from mrdoob/three.js:
//! - src/renderers/shaders/ShaderChunk/common.glsl.js, `equirectUv`: u = atan(z, x)/2π + ½, v = asin(y)/π + ½ upwards, so
//!   a panorama's centre looks along +X; `HDRLoader`/`RGBELoader` and `EXRLoader` put an image's top row at v = 1.
//! - src/renderers/webgl/WebGLMaterials.js: a `CubeTexture` is read at (−x, y, z) (`flipEnvMap` = −1 unless it is a render
//!   target); `HDRCubeTextureLoader` and `CubeTextureLoader` take the six faces +X −X +Y −Y +Z −Z.
//! - `LightProbe`: see [`crate::sh::three`].

use crate::conventions::conventions;
use crate::{BakedEnvironment, Cancel, ExportError, ExportFile, Preset, sh};
use kiln_image::cube_layout::{FACE_STEMS, Mirror, face_image, mirror};
use kiln_image::{Image, Panorama, exr_write, hdr};
use serde_json::json;

/// A panorama as three.js wants it: turned so that its centre, which looks along −Z here, looks along +X.
fn turned(panorama: &Panorama, cancel: Cancel) -> Result<Image, ExportError> {
    let (width, height) = (panorama.width(), panorama.height());
    let mut rgb = Vec::with_capacity(width * height * 3);
    for row in panorama.rgb().chunks_exact(width * 3) {
        cancel.check()?;
        // After a quarter of the columns, of three values each.
        let (left, right) = row.split_at(width / 4 * 3);
        rgb.extend_from_slice(right);
        rgb.extend_from_slice(left);
    }
    Ok(Image { width, height, rgb })
}

pub(crate) fn package(
    environment: &BakedEnvironment,
    cancel: Cancel,
) -> Result<Vec<ExportFile>, ExportError> {
    let name = &environment.name;
    let sky = &environment.skybox[0];
    let height = 2 * sky.face_size;
    let panorama = turned(&kiln_bake::panorama_of_cube(sky, cancel)?, cancel)?;
    let mut files = vec![
        ExportFile { path: format!("{name}.hdr"), bytes: hdr::encode(&panorama) },
        ExportFile { path: format!("{name}.exr"), bytes: exr_write::encode_image(&panorama, cancel)? },
    ];
    let mirrored = mirror(sky, Mirror::X);
    for (face, suffix) in FACE_STEMS.into_iter().enumerate() {
        cancel.check()?;
        let bytes = hdr::encode(&face_image(&mirrored, face));
        files.push(ExportFile { path: format!("{name}_{suffix}.hdr"), bytes });
    }
    let coefficients = sh::three(&environment.radiance_sh);
    let probe = json!({
        "sh": coefficients,
        "use": "new THREE.LightProbe(new THREE.SphericalHarmonics3().fromArray(sh))",
        "holds": "radiance, real orthonormal basis, degree 2, r g b of each coefficient; the shader applies the cosine lobe",
    });
    let mut bytes = serde_json::to_vec_pretty(&probe).expect("numbers and strings");
    bytes.push(b'\n');
    files.push(ExportFile { path: format!("{name}_lightprobe.json"), bytes });

    let resampled = "area means of the skybox cube, two rows a face texel: flux is kept";
    let facts = vec![
        json!({
            "path": format!("{name}.hdr"), "holds": "radiance panorama for PMREMGenerator.fromEquirectangular",
            "format": "Radiance RGBE", "resampled": resampled, "width": 2 * height, "height": height,
            "centre": "+X, where three.js looks for it",
            "encoding_error": "a channel is off by at most 2^-9 of the texel's brightest one",
        }),
        json!({
            "path": format!("{name}.exr"), "holds": "the same panorama", "format": "OpenEXR, binary32, ZIP",
            "resampled": resampled, "width": 2 * height, "height": height, "centre": "+X, where three.js looks for it",
            "encoding_error": 0.0,
        }),
        json!({
            "path": FACE_STEMS.map(|suffix| format!("{name}_{suffix}.hdr")), "holds": "radiance, six faces for HDRCubeTextureLoader",
            "format": "Radiance RGBE", "face_size": sky.face_size, "lookup": "direction (-x, y, z)",
            "encoding_error": "a channel is off by at most 2^-9 of the texel's brightest one",
        }),
        json!({
            "path": format!("{name}_lightprobe.json"), "holds": "radiance harmonics for LightProbe",
            "evaluation": "shGetIrradianceAt gives E; the Lambert BRDF divides by pi",
        }),
    ];
    let notes = [
        ("law", "none: PMREMGenerator filters at load time with its own levels"),
        (
            "light_probe",
            "use either the probe or scene.environment for diffuse light, not both: they hold the same light",
        ),
    ];
    files.push(conventions(Preset::Three, environment, 0, facts, &notes));
    Ok(files)
}
