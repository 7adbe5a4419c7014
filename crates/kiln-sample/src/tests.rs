//! The sample project, read back with the crates that read users' projects.

use std::collections::BTreeMap;
use std::sync::Arc;

use kiln_scene::{Packed, load, pack, variant_name};

use crate::material_balls::material_balls;
use crate::profile::{Mapping, Profile, Surface, radians, revolve};
use crate::{SampleOptions, ball, files, shaders, sky, tiles};

/// Small, so that the suite stays quick.
const OPTIONS: SampleOptions =
    SampleOptions { panorama_width: 64, sun: sky::SunPosition { elevation_deg: 35.0, azimuth_deg: 40.0 } };

fn project() -> BTreeMap<String, Vec<u8>> {
    files(&OPTIONS).into_iter().collect()
}

fn packed(files: &BTreeMap<String, Vec<u8>>) -> Packed {
    let path = "scenes/material_balls.gltf";
    pack(path, &files[path], &mut |path| files.get(path).map(|bytes| Arc::from(bytes.as_slice())))
}

#[test]
fn scene_packs_without_a_word_and_calls_for_each_effect_once() {
    let packed = packed(&project());
    assert_eq!(packed.diagnostics, []);
    let variants: Vec<(&str, String)> =
        packed.effects.iter().map(|it| (it.material.as_str(), variant_name(&it.effects))).collect();
    let variants: Vec<(&str, &str)> =
        variants.iter().map(|(name, variant)| (*name, variant.as_str())).collect();
    let expected = [
        ("brushed_gold", "base"),
        ("car_paint", "clearcoat"),
        ("velvet", "sheen"),
        ("glossy_plastic", "base"),
        ("tiles", "normal_map+occlusion"),
        ("flat_colour", "unlit"),
        ("neutral_stand", "base"),
        ("ground", "base"),
    ];
    assert_eq!(variants, expected);
    let car_paint = packed.effects[1].reads.ggx.unwrap();
    assert_eq!(car_paint, [0.03, 0.5]);
}

#[test]
fn scene_has_the_main_camera_and_all_balls_inside_its_frame() {
    let files = project();
    let scene = load(&packed(&files).glb.unwrap()).unwrap();
    let camera = &scene.cameras[0];
    assert_eq!(camera.name, "main");
    let view = camera.world.inverse();
    let tan = (camera.yfov_rad.unwrap() / 2.0).tan();
    let balls = scene.draws.iter().filter(|draw| draw.name != "ground");
    for draw in balls {
        for vertex in &scene.primitives[draw.primitive].vertices {
            let at = view.transform_point3(draw.world.transform_point3(vertex.position.into()));
            assert!(at.z < 0.0, "{} is behind the camera", draw.name);
            let (x, y) = (at.x / -at.z / (tan * 16.0 / 9.0), at.y / -at.z / tan);
            assert!(x.abs() <= 0.97 && y.abs() <= 0.97, "{}: {x} {y}", draw.name);
        }
    }
}

#[test]
fn each_ball_is_detailed_but_not_heavy() {
    let [upper, lower] = ball::shells();
    let triangles = (upper.indices.len() + lower.indices.len()) / 3;
    assert!((3_000..=8_000).contains(&triangles), "{triangles}");
    let index = upper.indices.iter().chain(&lower.indices).max().unwrap();
    assert!((*index as usize) < upper.positions.len().max(lower.positions.len()));
}

fn check_surface(surface: &Surface) -> Result<(), String> {
    let sub = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (triangles, _) = surface.indices.as_chunks::<3>();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|index| surface.positions[index as usize]);
        let (u, v) = (sub(b, a), sub(c, a));
        let face = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let area = dot(face, face).sqrt();
        if area.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return Err(format!("{triangle:?} has no area"));
        }
        for &index in triangle {
            let normal = surface.normals[index as usize];
            let length = dot(normal, normal).sqrt();
            let along = dot(face, normal) / area;
            // Triangles of an arc turn away from the true normal by half a step, here less than 20°.
            if !((length - 1.0).abs() <= 1e-5 && along >= 0.94) {
                return Err(format!("normal {normal:?} against face {face:?}: {along}"));
            }
        }
    }
    Ok(())
}

#[test]
fn normals_agree_with_the_winding_of_every_surface() {
    let [upper, lower] = ball::shells();
    let parts = [
        ("upper", upper),
        ("lower", lower),
        ("core", ball::core()),
        ("stand", ball::stand(1.0)),
        ("ground", ball::ground(6.0)),
    ];
    for (name, surface) in parts {
        check_surface(&surface).unwrap_or_else(|reason| panic!("{name}: {reason}"));
    }
}

#[test]
fn surface_check_rejects_a_profile_that_runs_upwards() {
    let inside_out = Profile::default().arc([0.0, 0.0], 1.0, radians(-60.0), radians(60.0), 12);
    assert!(check_surface(&revolve(&inside_out, 32, Mapping::Plain)).is_err());
}

/// Length of the UV step over length of the step on the surface, around and down a shell, at its ring `ring`.
fn stretch(surface: &Surface, ring: usize) -> [f32; 2] {
    let row = ball::SEGMENTS + 1;
    let (here, around, down) = (ring * row, ring * row + 1, (ring + 1) * row);
    let distance = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    [around, down].map(|there| {
        distance(&surface.uvs[here], &surface.uvs[there])
            / distance(&surface.positions[here], &surface.positions[there])
    })
}

#[test]
fn texture_is_stretched_alike_in_both_directions_from_pole_to_equator() {
    let [upper, _] = ball::shells();
    for ring in [1, 5, 10, 18] {
        let [around, down] = stretch(&upper, ring);
        assert!((around / down - 1.0).abs() <= 0.05, "ring {ring}: {around} around, {down} down");
    }
}

#[test]
fn tiles_repeat_without_a_seam() {
    let tiles = tiles::tiles();
    let texel = |image: &[u8], x: usize, y: usize| image[(y * tiles::SIZE + x) * 3 + 1];
    for image in [&tiles.base_color, &tiles.normal, &tiles.occlusion_roughness_metallic] {
        let jump = |a: u8, b: u8| a.abs_diff(b);
        let last = tiles::SIZE - 1;
        let across = (0..tiles::SIZE).map(|y| jump(texel(image, last, y), texel(image, 0, y))).max();
        let inside = (0..tiles::SIZE).flat_map(|y| (0..last).map(move |x| (x, y)));
        let inside = inside.map(|(x, y)| jump(texel(image, x, y), texel(image, x + 1, y))).max();
        assert!(across <= inside, "{across:?} across the border, {inside:?} inside");
    }
}

#[test]
fn shader_list_is_what_the_folders_hold() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    for folder in ["shaders/bake", "shaders/lib", "shaders/pbr"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            found.push(format!("{folder}/{}", entry.unwrap().file_name().to_str().unwrap()));
        }
    }
    found.sort();
    let listed: Vec<&str> = shaders::SHADERS.iter().map(|(path, _)| *path).collect();
    assert_eq!(listed, found);
}

#[test]
fn equal_options_give_equal_bytes_and_another_sun_another_sky_alone() {
    let (first, second) = (project(), project());
    assert!(first == second);
    let sun = sky::SunPosition { elevation_deg: 8.0, ..OPTIONS.sun };
    let moved: BTreeMap<_, _> = files(&SampleOptions { sun, ..OPTIONS }).into_iter().collect();
    let changed: Vec<&String> = first.keys().filter(|path| first[*path] != moved[*path]).collect();
    assert_eq!(changed, [crate::SKY_PATH]);
}

#[test]
fn project_file_names_only_files_that_are_there() {
    let files = project();
    let text = String::from_utf8(files["kiln.toml"].clone()).unwrap();
    let sources: Vec<&str> =
        text.lines().filter_map(|line| line.strip_prefix("source = \"")?.strip_suffix('"')).collect();
    assert_eq!(sources.len(), 7, "{sources:?}");
    for source in sources {
        assert!(files.contains_key(source), "{source}");
    }
}

#[test]
fn scene_is_readable_text_without_numbers_past_single_precision() {
    let (gltf, bin) = material_balls();
    assert!(gltf.lines().count() > 100, "one property a line");
    assert!(bin.len() < 1 << 20, "{} bytes", bin.len());
}
