//! Each engine's lookup, written as its shader has it, finds the right light in the right direction; the same lookup
//! without the engine's peculiarity does not.

use super::readers::{ktx1_cube, ktx2_cube};
use super::synthetic::{environment, file, files, filtered, irradiance, radiance, sheen, worst};
use crate::{Cancel, Preset, package};
use kiln_image::{Image, Limits, decode};
use serde_json::Value;
use std::f64::consts::PI;

/// Half a texel of a 64-texel face, of light that changes by its own size over the sphere, and the format.
const NEAREST: f64 = 0.03;
/// What must be exceeded by a lookup that is wrong.
const WRONG: f64 = 0.2;

fn conventions(files: &[crate::ExportFile]) -> Value {
    serde_json::from_slice(file(files, "conventions.json")).expect("JSON")
}

#[test]
fn bevy_sees_the_right_light_through_its_mirror() {
    let files = files(Preset::Bevy);
    let paths: Vec<&str> = files.iter().map(|file| file.path.as_str()).collect();
    assert_eq!(
        paths,
        ["studio_diffuse.ktx2", "studio_specular.ktx2", "studio_skybox.ktx2", "conventions.json"]
    );
    let (diffuse, format) = ktx2_cube(file(&files, "studio_diffuse.ktx2"));
    assert_eq!(format, 123, "RGB9E5");
    let (specular, _) = ktx2_cube(file(&files, "studio_specular.ktx2"));
    let (skybox, _) = ktx2_cube(file(&files, "studio_skybox.ktx2"));
    assert_eq!((specular.sizes.as_slice(), skybox.sizes.len()), ([64, 32, 16].as_slice(), 7));
    let sample_dir = |[x, y, z]: [f64; 3]| [x, y, -z];
    assert!(worst(|n| diffuse.fetch(sample_dir(n), 0.0), irradiance) < NEAREST);
    assert!(worst(|d| skybox.fetch(sample_dir(d), 0.0), radiance) < NEAREST);
    for roughness in [0.0, 0.5, 1.0] {
        let level = roughness * specular.last_level();
        assert!(worst(|r| specular.fetch(sample_dir(r), level), |r| filtered(r, roughness)) < 3.0 * NEAREST);
    }
    assert!(worst(|n| diffuse.fetch(n, 0.0), irradiance) > WRONG / 2.0, "the check itself: no mirror");
    assert!(worst(|d| skybox.fetch(d, 0.0), radiance) > WRONG, "the check itself: no mirror");
}

#[test]
fn khronos_renderer_sees_the_right_light() {
    let files = files(Preset::Khronos);
    let (lambertian, format) = ktx2_cube(file(&files, "studio_lambertian.ktx2"));
    assert_eq!(format, 97, "RGBA16F");
    assert!(worst(|n| lambertian.fetch(n, 0.0), irradiance) < NEAREST);
    for (path, wanted) in
        [("studio_ggx.ktx2", filtered as fn([f64; 3], f64) -> [f64; 3]), ("studio_charlie.ktx2", sheen)]
    {
        let (chain, _) = ktx2_cube(file(&files, path));
        for roughness in [0.0, 0.5, 1.0] {
            let lod = roughness * chain.last_level();
            assert!(worst(|r| chain.fetch(r, lod), |r| wanted(r, roughness)) < 3.0 * NEAREST, "{path}");
        }
        assert!(
            worst(|[x, y, z]| chain.fetch([x, y, -z], 0.0), |r| wanted(r, 0.0)) > WRONG,
            "the check itself"
        );
    }
    let table = ktx2::Reader::new(file(&files, "lut_ggx.ktx2")).expect("a table").header();
    assert_eq!((table.pixel_width, table.face_count, table.format.map(|f| f.value())), (2, 1, Some(83)));
    let limits = Limits::default();
    let picture = decode(file(&files, "lut_ggx.png"), &limits, Cancel::NEVER).expect("a PNG").image;
    assert_eq!((picture.width, picture.height), (2, 2));
    assert!(picture.texel(0, 0)[0] > picture.texel(0, 1)[0], "row 0 is smooth");
}

#[test]
fn filament_sees_the_right_light_and_its_polynomial_gives_irradiance() {
    let files = files(Preset::Filament);
    let (ibl, pairs) = ktx1_cube(file(&files, "studio_ibl.ktx"));
    assert_eq!(ibl.sizes, [64, 32, 16]);
    let one_level = ibl.last_level();
    let lod = |r: f64| one_level * r * (2.0 - r);
    for roughness in [0.0, 1.0 - 0.5_f64.sqrt(), 1.0] {
        assert!((lod(roughness) - lod(roughness).round()).abs() < 1e-12, "a whole level");
        let read = |d| ibl.fetch(d, lod(roughness));
        assert!(worst(read, |d| filtered(d, roughness)) < 3.0 * NEAREST);
        assert!(worst(|[x, y, z]| read([-x, y, z]), |d| filtered(d, roughness)) > WRONG, "the check itself");
    }
    let linear = 0.5 * one_level;
    assert!(worst(|d| ibl.fetch(d, linear), |d| filtered(d, 0.5)) > 0.1, "the check itself: another law");

    let sh: Vec<f64> =
        pairs[0].1.split_whitespace().map(|number| number.parse().expect("a number")).collect();
    assert_eq!((pairs.len(), pairs[0].0.as_str(), sh.len()), (1, "sh", 27));
    let polynomial = |[x, y, z]: [f64; 3]| {
        let basis = [1.0, y, z, x, y * x, y * z, 3.0 * z * z - 1.0, z * x, x * x - y * y];
        [0, 1, 2].map(|channel| (0..9).map(|i| basis[i] * sh[3 * i + channel]).sum::<f64>())
    };
    assert!(worst(polynomial, irradiance) < 1e-6, "{}", worst(polynomial, irradiance));
    assert!(worst(|[x, y, z]| polynomial([x, z, y]), irradiance) > 0.02, "the check itself: axes matter");
    let text = std::str::from_utf8(file(&files, "studio_sh.txt")).expect("text");
    assert_eq!(text.lines().count(), 9);
    assert!(
        text.lines().nth(1).is_some_and(|line| line.ends_with("// L1-1, irradiance, pre-scaled base")),
        "{text}"
    );
    let (skybox, _) = ktx1_cube(file(&files, "studio_skybox.ktx"));
    assert!(worst(|d| skybox.fetch(d, 0.0), radiance) < NEAREST);
}

fn panorama(bytes: &[u8]) -> Image {
    decode(bytes, &Limits::default(), Cancel::NEVER).expect("an image").image
}

fn nearest(image: &Image, u: f64, v: f64) -> [f64; 3] {
    let index = |uv: f64, count: usize| ((uv * count as f64) as usize).min(count - 1);
    image.texel(index(u, image.width), index(v, image.height)).map(f64::from)
}

#[test]
fn three_sees_the_right_light_in_panorama_cube_and_probe() {
    let files = files(Preset::Three);
    for path in ["studio.hdr", "studio.exr"] {
        let image = panorama(file(&files, path));
        assert_eq!((image.width, image.height), (256, 128));
        // equirectUv with v upwards; the loaders put the top row at v = 1.
        let equirect = |[x, y, z]: [f64; 3]| {
            let (u, v) = (libm::atan2(z, x) / (2.0 * PI) + 0.5, libm::asin(y) / PI + 0.5);
            nearest(&image, u, 1.0 - v)
        };
        assert!(worst(equirect, radiance) < NEAREST, "{path}");
        assert!(
            worst(|[x, y, z]| equirect([-z, y, x]), radiance) > WRONG,
            "the check itself: another centre"
        );
    }
    let faces = ["px", "nx", "py", "ny", "pz", "nz"]
        .map(|face| panorama(file(&files, &format!("studio_{face}.hdr"))));
    let cube = |direction: [f64; 3]| {
        let (face, [s, t]) = kiln_sphere::cube_face_st(direction);
        nearest(&faces[face], 0.5 * (s + 1.0), 0.5 * (t + 1.0))
    };
    let flip_env_map = -1.0;
    assert!(worst(|[x, y, z]| cube([flip_env_map * x, y, z]), radiance) < NEAREST);
    assert!(worst(cube, radiance) > WRONG, "the check itself: no flip");

    let probe: Value = serde_json::from_slice(file(&files, "studio_lightprobe.json")).expect("JSON");
    let sh: Vec<f64> =
        probe["sh"].as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect();
    // shGetIrradianceAt, then the Lambert BRDF of a white surface.
    let outgoing = |[x, y, z]: [f64; 3]| {
        let factors = [
            0.886227,
            2.0 * 0.511664 * y,
            2.0 * 0.511664 * z,
            2.0 * 0.511664 * x,
            2.0 * 0.429043 * x * y,
            2.0 * 0.429043 * y * z,
            0.743125 * z * z - 0.247708,
            2.0 * 0.429043 * x * z,
            0.429043 * (x * x - y * y),
        ];
        [0, 1, 2].map(|channel| (0..9).map(|i| factors[i] * sh[3 * i + channel]).sum::<f64>() / PI)
    };
    assert_eq!(sh.len(), 27);
    assert!(worst(outgoing, irradiance) < 1e-5, "{}", worst(outgoing, irradiance));
    assert!(worst(|d| outgoing(d).map(|v| v * PI), irradiance) > 1.0, "the check itself: π counts");
}

#[test]
fn raw_holds_everything_unrounded() {
    let files = files(Preset::Raw);
    let (specular, format) = ktx2_cube(file(&files, "studio_specular.ktx2"));
    assert_eq!((format, specular.sizes.len()), (109, 7));
    for level in 0..7 {
        let roughness = f64::from(level) / 6.0;
        let size = specular.sizes[level as usize];
        let tolerance = 3.0 / size as f64 + 1e-6;
        assert!(worst(|d| specular.fetch(d, f64::from(level)), |d| filtered(d, roughness)) < tolerance);
    }
    let (irradiance_map, _) = ktx2_cube(file(&files, "studio_irradiance.ktx2"));
    assert!(worst(|d| irradiance_map.fetch(d, 0.0), irradiance) < NEAREST);
    assert!(
        worst(|[x, y, z]| irradiance_map.fetch([x, -y, z], 0.0), irradiance) > WRONG / 4.0,
        "the check itself"
    );
    let image = panorama(file(&files, "studio_panorama.exr"));
    let read = |d| {
        let [u, v] = kiln_sphere::panorama_uv(d);
        nearest(&image, u, v)
    };
    assert!(worst(read, radiance) < NEAREST);
    let sh: Value = serde_json::from_slice(file(&files, "studio_sh.json")).expect("JSON");
    assert_eq!((sh["order"].as_u64(), sh["coefficients"][0][1].as_f64()), (Some(2), Some(8.0)));
    for path in ["studio_sheen.ktx2", "studio_skybox.ktx2", "studio_cube.exr", "lut_ggx.ktx2"] {
        assert!(!file(&files, path).is_empty());
    }
}

#[test]
fn light_above_the_format_is_scaled_and_said() {
    for (preset, path) in [(Preset::Bevy, "sun_skybox.ktx2"), (Preset::Filament, "sun_skybox.ktx")] {
        let mut bright = environment(preset, 1e5);
        bright.name = "sun".to_owned();
        let files = package(preset, &bright, Cancel::NEVER).expect("complete");
        let conventions = conventions(&files);
        let factor = conventions["multiply_by"].as_f64().expect("a number");
        assert_eq!(factor, libm::exp2(conventions["scale_log2"].as_f64().expect("a number")));
        assert!(factor > 1.0 && conventions["files"][0]["encoding_error"]["clamped_flux"][0] == 0.0);
        let cube = if preset == Preset::Bevy {
            ktx2_cube(file(&files, path)).0
        } else {
            ktx1_cube(file(&files, path)).0
        };
        let read = |[x, y, z]: [f64; 3]| {
            let direction = if preset == Preset::Bevy { [x, y, -z] } else { [x, y, z] };
            cube.fetch(direction, 0.0).map(|value| value * factor / 1e5)
        };
        assert!(worst(read, radiance) < NEAREST, "{preset}");
    }
    assert_eq!(conventions(&files(Preset::Bevy))["multiply_by"], 1.0, "the check itself");
}

#[test]
fn conventions_name_every_file_its_law_and_its_error() {
    for preset in Preset::ALL {
        let files = files(preset);
        let conventions = conventions(&files);
        assert_eq!(conventions["preset"], preset.name());
        let text = conventions["files"].to_string();
        for file in files.iter().filter(|file| file.path != "conventions.json") {
            assert!(text.contains(&format!("\"{}\"", file.path)), "{preset}: {} is not described", file.path);
        }
        for described in conventions["files"].as_array().expect("a list") {
            let Some(levels) = described["levels"].as_u64() else { continue };
            let errors = described["encoding_error"]["rms_relative_to_rms"].as_array().expect("a list");
            assert_eq!(errors.len() as u64, levels, "{preset}");
            if let Some(roughness) = described["law"]["roughness"].as_array() {
                assert_eq!(roughness.len() as u64, levels, "{preset}");
                assert_eq!(described["law"]["name"], preset.law().name());
            }
        }
        assert!(conventions["world"]["handedness"] == "right" && conventions["irradiance"].is_string());
    }
}
