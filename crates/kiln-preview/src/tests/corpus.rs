//! Real models under real light. With `KILN_PREVIEW_OUT` the pictures are kept there, to be looked at.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use image::RgbaImage;
use kiln_accuracy::Source;
use kiln_bake::{AnalysisRequest, Cancel, Lobe, TexelFormat, encode_level, scale_log2};
use kiln_image::{Cube, Limits, Panorama};
use serde_json::json;

use super::fixture::{Build, gpu};
use crate::HeadlessViewer;

const SPECULAR_SIZE: usize = 128;
const SPECULAR_LEVELS: usize = 6;
const WANTED: &str = "nobody cancels";

#[expect(clippy::print_stderr, reason = "a skipped test says so, a measured one what it measured")]
pub(super) fn say(text: &str) {
    eprintln!("{text}");
}

pub(super) fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("KILN_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        say("SKIPPED: KILN_CORPUS is not set, no real model was drawn");
    }
    folder
}

/// Bakes a panorama into `env/NAME/…`, as the pipeline does.
fn bake(build: &mut Build, name: &str, path: &Path) {
    let bytes = std::fs::read(path).expect("the corpus has it");
    let decoded = kiln_image::decode(&bytes, &Limits::default(), Cancel::NEVER).expect("it is sound");
    let panorama = Panorama::new(decoded.image).expect("it is twice as wide as high");
    bake_panorama(build, name, &panorama, [SPECULAR_SIZE, SPECULAR_LEVELS]);
}

/// The same for a panorama; `size` and `levels` of the chain.
pub(super) fn bake_panorama(
    build: &mut Build,
    name: &str,
    panorama: &Panorama,
    [size, levels]: [usize; 2],
) -> Maps {
    let request = AnalysisRequest {
        alpha_min: (1.0 / (levels - 1) as f64).powi(2),
        sheen_alpha_min: None,
        error: 1e-3,
    };
    let analysis = kiln_bake::analyse(panorama, &request, Cancel::NEVER).expect(WANTED);
    let skybox = |size: usize| kiln_bake::skybox(panorama, size, Cancel::NEVER).expect(WANTED);
    let mirror = skybox(size).swap_remove(0);
    let level = |level: usize| {
        let roughness = kiln_bake::roughness_of_level(level, levels);
        let alpha = roughness * roughness;
        kiln_bake::specular_level(&analysis, alpha, size >> level, Cancel::NEVER).expect(WANTED).cube
    };
    let specular: Vec<Cube> = std::iter::once(mirror).chain((1..levels).map(level)).collect();
    add_cube(build, &format!("env/{name}/specular"), &specular);
    let irradiance = kiln_bake::irradiance(&analysis, 64, Cancel::NEVER).expect(WANTED);
    let irradiance = [irradiance.cube];
    add_cube(build, &format!("env/{name}/irradiance"), &irradiance);
    add_cube(build, &format!("env/{name}/skybox"), &skybox(256));
    let source = |levels: &[Cube]| Source::of_levels(levels, Cancel::NEVER).expect(WANTED);
    Maps { specular: source(&specular), irradiance: source(&irradiance), levels }
}

/// What was baked, to be looked up in `f64`.
pub(super) struct Maps {
    specular: Source,
    irradiance: Source,
    levels: usize,
}

impl Maps {
    /// As shaders look it up: bilinear across faces' edges, linear between levels.
    pub(super) fn light(&self, lobe: Lobe, direction: [f64; 3]) -> [f64; 3] {
        match lobe {
            Lobe::Ggx { alpha } => self.specular.sample(direction, alpha.sqrt() * (self.levels - 1) as f64),
            _ => self.irradiance.sample(direction, 0.0),
        }
    }
}

fn add_cube(build: &mut Build, name: &str, levels: &[Cube]) {
    let largest =
        levels.iter().flat_map(|level| &level.rgb).fold(0.0_f32, |largest, &value| largest.max(value));
    let scale = scale_log2(largest);
    let encode = |(index, level): (usize, &Cube)| {
        let level = encode_level(level, TexelFormat::Rgba16Float, scale, Cancel::NEVER).expect(WANTED);
        (format!("mip{index}"), level.bytes)
    };
    let parts: Vec<(String, Vec<u8>)> = levels.iter().enumerate().map(encode).collect();
    let parts: Vec<(&str, Vec<u8>)> =
        parts.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
    let meta = json!({ "size": levels[0].face_size, "levels": levels.len(), "format": "rgba16f", "scale_log2": scale });
    build.target(name, "cube", meta, &parts);
}

/// Packs a model of the corpus.
pub(super) fn pack(name: &str, path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("the corpus has it");
    let folder = path.parent().expect("it lies in a folder").to_owned();
    let packed =
        kiln_scene::pack(name, &bytes, &mut |uri| std::fs::read(folder.join(uri)).ok().map(Arc::from));
    packed.glb.unwrap_or_else(|| panic!("{name}: {:?}", packed.diagnostics))
}

pub(super) fn find(corpus: &Path, name: &str) -> Option<PathBuf> {
    let mut folders = vec![corpus.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().is_some_and(|file| file == name) {
                return Some(path);
            }
        }
    }
    None
}

pub(super) fn keep(picture: &RgbaImage, name: &str) {
    if let Some(folder) = std::env::var_os("KILN_PREVIEW_OUT") {
        let path = PathBuf::from(folder).join(format!("{name}.png"));
        picture.save(&path).expect("the folder can be written");
    }
}

/// Mean and standard deviation of the codes.
fn statistics(picture: &RgbaImage) -> (f64, f64) {
    let codes = || picture.pixels().flat_map(|pixel| pixel.0[..3].to_vec()).map(f64::from);
    let count = codes().count() as f64;
    let mean = codes().sum::<f64>() / count;
    (mean, (codes().map(|code| (code - mean).powi(2)).sum::<f64>() / count).sqrt())
}

#[test]
fn real_models_are_drawn_under_a_real_sky() {
    let (Some(corpus), Some(gpu)) = (corpus(), gpu()) else { return };
    let models = std::env::var("KILN_PREVIEW_MODELS").unwrap_or_else(|_| "ToyCar SheenCloth".to_owned());
    let sky = std::env::var("KILN_PREVIEW_SKY").unwrap_or_else(|_| "venice".to_owned());
    let Some(panorama) = ["hdr", "exr"].iter().find_map(|kind| find(&corpus, &format!("{sky}.{kind}")))
    else {
        return say(&format!("SKIPPED: the corpus has no panorama {sky}"));
    };
    let mut build = Build::new();
    build.lut();
    bake(&mut build, "sky", &panorama);
    for name in models.split_whitespace() {
        let files = [format!("{name}.glb"), format!("{name}.gltf")];
        let Some(path) = files.iter().find_map(|file| find(&corpus, file)) else {
            say(&format!("SKIPPED: the corpus has no model {name}"));
            continue;
        };
        build.table.targets.retain(|target, _| !target.starts_with("scene/"));
        let glb = pack(name, &path);
        build.shaders_of(&glb).scene(name, "sky", glb);
        let mut viewer = HeadlessViewer::new(gpu.clone(), [640, 360]);
        let start = Instant::now();
        let report = viewer.apply(&build.revision());
        let apply_ms = start.elapsed().as_secs_f64() * 1e3;
        assert_eq!(report.diagnostics, vec![], "{name}");
        let picture = viewer.render().expect("the device reads back");
        let start = Instant::now();
        for _ in 0..5 {
            viewer.draw().expect("the device draws");
        }
        let frame_ms = start.elapsed().as_secs_f64() * 1e3 / 5.0;
        say(&format!("{name}: apply {apply_ms:.0} ms, frame {frame_ms:.1} ms, {:?}", report.notes));
        keep(&picture, name);
        let (mean, deviation) = statistics(&picture);
        assert!(
            (20.0..235.0).contains(&mean) && deviation > 10.0,
            "{name}: mean {mean}, deviation {deviation}"
        );
        assert_eq!(gpu.take_errors(), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn edited_shader_remakes_that_shader_alone() {
    let Some(gpu) = gpu() else { return };
    let mut build = Build::ball(json!({ "pbrMetallicRoughness": {} }));
    let mut viewer = HeadlessViewer::new(gpu, [640, 360]);
    viewer.apply(&build.revision());
    viewer.draw().expect("the device draws");
    let start = Instant::now();
    viewer.draw().expect("the device draws");
    say(&format!("frame of a sphere, 640 x 360: {:.1} ms", start.elapsed().as_secs_f64() * 1e3));
    let wgsl = build.revision().part("shader/pbr/base", "wgsl").expect("it is there").to_vec();
    let reflection = build.revision().part("shader/pbr/base", "reflection").expect("it is there").to_vec();
    let meta = build.table.targets["shader/pbr/base"].meta.clone();
    let mut times_ms: Vec<f64> = Vec::new();
    for edit in 0..5 {
        let edited = [wgsl.clone(), format!("const EDIT: i32 = {edit};\n").into_bytes()].concat();
        build.target(
            "shader/pbr/base",
            "shader",
            meta.clone(),
            &[("wgsl", edited), ("reflection", reflection.clone())],
        );
        let start = Instant::now();
        assert_eq!(viewer.apply(&build.revision()).made, ["shader/pbr/base"]);
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    say(&format!("apply of a shader edit: {times_ms:.1?} ms"));
}
