//! A picture of an environment's artefacts, made from a published revision without a GPU.

use half::f16;
use kiln_image::Cube;
use kiln_image::sheet::{Picture, Tile, contact_sheet};
use kiln_link::{Revision, Target};
use serde_json::Value;

/// Pixels of one map's cross.
const TILE_WIDTH: usize = 320;
/// The skybox level shown is the first whose faces are at most this large.
const SKYBOX_FACE_MAX: usize = 256;

/// The contact sheet of `env/NAME/*` as PNG bytes; `None` if the revision has no such maps.
pub(crate) fn environment_sheet(revision: &Revision, env: &str) -> Option<Vec<u8>> {
    let mut tiles = Vec::new();
    for map in ["skybox", "irradiance", "specular"] {
        let name = format!("env/{env}/{map}");
        let Some(target) = revision.table.targets.get(&name) else { continue };
        for (level, part) in target.parts.iter().enumerate() {
            let Some(cube) = decode_level(target, level, revision.bytes(part)) else { continue };
            let title = match map {
                "skybox" if cube.face_size > SKYBOX_FACE_MAX => continue,
                "skybox" => "skybox".to_owned(),
                "irradiance" => "irradiance / pi".to_owned(),
                _ => {
                    let roughness = level as f64 / (target.parts.len() - 1).max(1) as f64;
                    format!("specular, roughness {roughness:.2}")
                }
            };
            tiles.push(Tile {
                title: format!("{title} ({0}x{0})", cube.face_size),
                picture: Picture::Cube(cube),
            });
            if map == "skybox" {
                break;
            }
        }
    }
    if tiles.is_empty() {
        return None;
    }
    let (width, height, rgb) = contact_sheet(&tiles, TILE_WIDTH);
    Some(kiln_image::png::encode_rgb8(width, height, &rgb))
}

fn decode_level(target: &Target, level: usize, bytes: &[u8]) -> Option<Cube> {
    let fact = |name: &str| target.meta.get(name).and_then(Value::as_i64);
    let face_size = usize::try_from(fact("size")?).ok()? >> level;
    let scale = 2f32.powi(i32::try_from(fact("scale_log2").unwrap_or(0)).ok()?);
    let values: Vec<f32> = match target.meta.get("format")?.as_str()? {
        "rgba16f" => {
            bytes.chunks_exact(2).map(|half| f16::from_le_bytes([half[0], half[1]]).to_f32()).collect()
        }
        "rgba32f" => bytes
            .chunks_exact(4)
            .map(|float| f32::from_le_bytes([float[0], float[1], float[2], float[3]]))
            .collect(),
        _ => return None,
    };
    let rgb =
        values.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).map(|value| value * scale);
    Cube::new(face_size, rgb.collect()).ok()
}
