//! Real files that nobody of this project made, found through `KILN_CORPUS`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{Effect, Packed, Scene, external_uris, load, pack, variant_name};

/// The corpus folder; says loudly that a test was skipped where it is not set.
pub(super) fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("KILN_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        report("SKIPPED: KILN_CORPUS is not set, no corpus file was read");
    }
    folder
}

#[expect(clippy::print_stderr, reason = "what the corpus runs found is for people to read")]
pub(super) fn report(line: &str) {
    eprintln!("{line}");
}

fn pack_file(corpus: &Path, file: &str) -> Packed {
    let bytes = std::fs::read(corpus.join(file)).unwrap();
    pack(file, &bytes, &mut |path| std::fs::read(corpus.join(path)).ok().map(Arc::from))
}

/// What one file must come out as.
struct Expected {
    file: &'static str,
    triangles: usize,
    draws: usize,
    /// Variant names in use, each once, sorted.
    variants: &'static [&'static str],
    bounds: [[f32; 3]; 2],
}

#[track_caller]
fn check_file(expected: &Expected) {
    let Some(corpus) = corpus() else { return };
    let packed = pack_file(&corpus, &format!("gltf/khronos-sample-assets/{}", expected.file));
    let messages: Vec<String> = packed.diagnostics.iter().map(ToString::to_string).collect();
    let glb = packed.glb.as_ref().unwrap_or_else(|| panic!("{messages:#?}"));
    let scene = load(glb).unwrap();
    check_scene(&scene);
    let mut variants: Vec<String> = packed.effects.iter().map(|it| variant_name(&it.effects)).collect();
    variants.sort();
    variants.dedup();
    let summary = &packed.summary;
    let found = format!("{} triangles, {} draws, {variants:?}", summary.triangles, summary.draws);
    let wanted =
        format!("{} triangles, {} draws, {:?}", expected.triangles, expected.draws, expected.variants);
    let bounds = summary.bounds.unwrap();
    assert_eq!(found, wanted, "{bounds:?} {messages:#?}");
    let extent = (0..3).map(|axis| bounds[1][axis] - bounds[0][axis]).fold(0.0, f32::max);
    super::check_within("bounds", bounds.as_flattened(), expected.bounds.as_flattened(), 1e-3 * extent);
}

/// What a renderer relies on.
#[track_caller]
fn check_scene(scene: &Scene) {
    for draw in scene.draws.iter().chain(&scene.hidden) {
        let primitive = &scene.primitives[draw.primitive];
        let joints = draw.skin.map_or(0, |skin| scene.skins[skin].joints.len());
        assert_eq!(draw.skin.is_some(), !primitive.influences.is_empty(), "{}", draw.name);
        let hung = primitive.influences.iter().flat_map(|it| it.joints);
        assert!(hung.into_iter().all(|joint| usize::from(joint) < joints), "{}", draw.name);
        assert_eq!(draw.morph.map_or(0, |morph| scene.morphs[morph].len()), primitive.targets.len());
    }
    for draw in &scene.draws {
        let places: Vec<_> = draw.instances.iter().map(|it| draw.world * it.matrix()).collect();
        let is_solid = |place: &glam::Mat4| place.determinant() > 0.0;
        assert!(
            if places.is_empty() { is_solid(&draw.world) } else { places.iter().all(is_solid) },
            "{}",
            draw.name
        );
    }
    for skin in &scene.skins {
        assert!(skin.joints.len() == skin.inverse_binds.len());
        assert!(skin.joints.iter().all(|&joint| joint < scene.nodes.len()));
    }
    for primitive in &scene.primitives {
        let counts = primitive
            .targets
            .iter()
            .map(|it| it.deltas.len())
            .chain(Some(primitive.influences.len()).filter(|&count| count > 0));
        assert!(counts.into_iter().all(|count| count == primitive.vertices.len()));
        for influence in &primitive.influences {
            super::check_within("weights", &[influence.weights.iter().sum()], &[1.0], 2e-6);
        }
        assert!(primitive.material < scene.materials.len());
        assert!(!primitive.indices.is_empty() && primitive.indices.len() % 3 == 0);
        assert!(primitive.indices.iter().all(|&index| (index as usize) < primitive.vertices.len()));
        for vertex in &primitive.vertices {
            let length = |v: &[f32]| v.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!(vertex.position.iter().all(|value| value.is_finite()));
            super::check_within("unit normal", &[length(&vertex.normal)], &[1.0], 1e-3);
            super::check_within("unit tangent", &[length(&vertex.tangent[..3])], &[1.0], 1e-3);
            assert!(vertex.tangent[3].abs() == 1.0);
        }
    }
    for texture in &scene.textures {
        let image = &scene.images[texture.image];
        assert_eq!(image.rgba.len(), image.width as usize * image.height as usize * 4);
    }
}

pub(super) fn files_below(folder: &Path, corpus: &Path, list: &mut Vec<String>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, corpus, list);
        } else if path.extension().is_some_and(|extension| extension == "gltf" || extension == "glb") {
            list.push(path.strip_prefix(corpus).unwrap().to_str().unwrap().to_owned());
        }
    }
}

/// Packs every file below `folder`; returns how many were drawn and the reasons for the others.
fn run_folder(corpus: &Path, folder: &str) -> (usize, BTreeMap<String, String>) {
    let mut files = Vec::new();
    files_below(&corpus.join(folder), corpus, &mut files);
    let (mut drawn, mut refused) = (0, BTreeMap::new());
    for file in files {
        let packed = pack_file(corpus, &file);
        let errors: Vec<&_> = packed.diagnostics.iter().filter(|it| it.is_error()).collect();
        match &packed.glb {
            Some(glb) => {
                assert!(errors.is_empty(), "{file} was packed with errors");
                let scene =
                    load(glb).unwrap_or_else(|error| panic!("{file}: its pack does not load: {error}"));
                check_scene(&scene);
                let again = pack("again.glb", glb, &mut |_| None).glb.unwrap();
                assert!(again == *glb, "{file}: not a fixed point: {}", super::first_difference(&again, glb));
                drawn += 1;
            }
            None => {
                assert!(!errors.is_empty(), "{file} was refused without a reason");
                refused.insert(file, errors[0].message.clone());
            }
        }
    }
    (drawn, refused)
}

#[test]
fn every_valid_file_is_drawn_or_refused_for_a_named_reason() {
    let Some(corpus) = corpus() else { return };
    let (drawn, refused) = run_folder(&corpus, "gltf");
    report(&format!("gltf: {drawn} drawn, {} refused", refused.len()));
    refused.iter().for_each(|(file, reason)| report(&format!("  {file}: {reason}")));
    assert!(drawn > 200, "{drawn}");
}

#[test]
fn every_invalid_file_ends_without_a_panic() {
    let Some(corpus) = corpus() else { return };
    let (drawn, refused) = run_folder(&corpus, "gltf-invalid");
    report(&format!("gltf-invalid: {drawn} drawn, {} refused", refused.len()));
    refused.iter().for_each(|(file, reason)| report(&format!("  {file}: {reason}")));
    assert!(refused.len() > 50, "{}", refused.len());
}

#[test]
fn external_uris_of_every_file_are_what_pack_asks_for() {
    let Some(corpus) = corpus() else { return };
    let mut files = Vec::new();
    files_below(&corpus.join("gltf/khronos-sample-assets"), &corpus, &mut files);
    for file in files {
        let bytes = std::fs::read(corpus.join(&file)).unwrap();
        let listed: Vec<String> = external_uris(&file, &bytes).0.into_iter().map(|uri| uri.path).collect();
        pack(&file, &bytes, &mut |path| {
            assert!(listed.iter().any(|it| it == path), "{file}: {path} is not listed");
            std::fs::read(corpus.join(path)).ok().map(Arc::from)
        });
    }
}

// Triangle counts and bounds below were computed from the files' accessors by a separate program.

#[test]
fn toy_car_has_coated_paint_cloth_and_glass() {
    check_file(&Expected {
        file: "ToyCar/glTF/ToyCar.gltf",
        triangles: 108_936,
        draws: 3,
        variants: &["clearcoat+emission+normal_map+occlusion", "normal_map+occlusion+sheen", "transmission"],
        bounds: [[-0.034_995, -0.016_206, -0.036_981], [0.038_448, 0.012_617, 0.036_981]],
    });
}

#[test]
fn clear_coat_test_has_materials_with_and_without_a_coat() {
    check_file(&Expected {
        file: "ClearCoatTest/glTF/ClearCoatTest.gltf",
        triangles: 37_116,
        draws: 27,
        variants: &["alpha_blend", "base", "clearcoat", "clearcoat+normal_map", "emission", "normal_map"],
        bounds: [[-7.357_803, -6.25, -0.06], [3.1, 6.854_517, 1.05]],
    });
}

#[test]
fn sheen_cloth_is_one_draw() {
    check_file(&Expected {
        file: "SheenCloth/glTF/SheenCloth.gltf",
        triangles: 115_200,
        draws: 1,
        variants: &["normal_map+occlusion+sheen"],
        bounds: [[-0.027_363, 0.000_1, -0.048_482], [0.044_766, 0.040_402, 0.022_842]],
    });
}

/// Union of the effects of a file's materials.
#[track_caller]
fn check_effects(file: &str, wanted: &[Effect], absent: &[Effect]) {
    let Some(corpus) = corpus() else { return };
    let packed = pack_file(&corpus, &format!("gltf/{file}"));
    let found = packed.all_effects();
    assert!(wanted.iter().all(|effect| found.contains(effect)), "{file}: {found:?}");
    assert!(!absent.iter().any(|effect| found.contains(effect)), "{file}: {found:?}");
}

#[test]
fn test_scenes_of_the_newer_extensions_call_for_them() {
    use Effect::{Anisotropy, Dispersion, Iridescence, Transmission, Volume};
    let khronos = "khronos-sample-assets";
    check_effects(
        &format!("{khronos}/AttenuationTest/glTF/AttenuationTest.gltf"),
        &[Transmission, Volume],
        &[Dispersion],
    );
    check_effects(
        &format!("{khronos}/AnisotropyStrengthTest/glTF/AnisotropyStrengthTest.gltf"),
        &[Anisotropy],
        &[Iridescence],
    );
    check_effects("adobe-usd-tests/ExtIridescence.gltf", &[Iridescence], &[Anisotropy]);
    check_effects("adobe-usd-tests/ExtDispersion.gltf", &[Dispersion, Volume], &[Anisotropy]);
}

#[test]
fn unlit_test_calls_for_nothing_but_colour() {
    check_file(&Expected {
        file: "UnlitTest/glTF/UnlitTest.gltf",
        triangles: 88,
        draws: 2,
        variants: &["unlit"],
        bounds: [[-2.2, -1.0, -1.0], [2.2, 1.0, 1.0]],
    });
}

#[test]
fn metal_rough_spheres_are_one_variant() {
    check_file(&Expected {
        file: "MetalRoughSpheresNoTextures/glTF/MetalRoughSpheresNoTextures.gltf",
        triangles: 1_040_409,
        draws: 123,
        variants: &["base"],
        bounds: [[-0.000_924, -0.001_01, -0.003_35], [0.006_477, 0.006_494, 0.000_35]],
    });
}

#[test]
fn fox_skinned_at_rest_is_where_it_was_modelled() {
    check_file(&Expected {
        file: "Fox/glTF/Fox.gltf",
        triangles: 576,
        draws: 1,
        variants: &["skin"],
        bounds: [[-12.592_718, -0.121_745, -88.095], [12.592_718, 78.907_19, 66.624_86]],
    });
}

#[test]
fn simple_instancing_is_one_draw() {
    check_file(&Expected {
        file: "SimpleInstancing/glTF/SimpleInstancing.gltf",
        triangles: 1500,
        draws: 1,
        variants: &["instancing"],
        bounds: [[-1.666_667; 3], [12.731_707; 3]],
    });
}

#[test]
fn animations_of_the_fox_are_read_whole() {
    let Some(corpus) = corpus() else { return };
    let packed = pack_file(&corpus, "gltf/khronos-sample-assets/Fox/glTF/Fox.gltf");
    let scene = load(packed.glb.as_ref().unwrap()).unwrap();
    let names: Vec<&str> = scene.animations.iter().map(|animation| animation.name.as_str()).collect();
    assert_eq!(names, ["Survey", "Walk", "Run"]);
    assert!(scene.animations.iter().all(|animation| !animation.channels.is_empty()));
    assert!(
        packed.diagnostics.iter().all(|it| !it.message.contains("/animations")),
        "{:?}",
        packed.diagnostics
    );
}
