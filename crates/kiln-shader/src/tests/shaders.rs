//! The shaders that users start from: every feature compiles, and a variant holds nothing of absent ones.

use std::collections::BTreeSet;

use super::{Files, compiled, set};
use crate::{BindingKind, Compiled, Program, Reflection, scan};

pub(super) const FEATURES: [&str; 11] = [
    "alpha_blend",
    "alpha_mask",
    "clearcoat",
    "emission",
    "normal_map",
    "occlusion",
    "sheen",
    "specular",
    "transmission",
    "unlit",
    "vertex_color",
];

/// Names of the interface that belong to one feature, by what they start with.
const OWNED: [(&str, &str); 13] = [
    ("alpha_mask", "alpha_cutoff"),
    ("clearcoat", "clearcoat_"),
    ("emission", "emissive_"),
    ("normal_map", "normal_texture"),
    ("normal_map", "normal_scale"),
    ("normal_map", "normal_uv_"),
    ("occlusion", "occlusion_texture"),
    ("occlusion", "occlusion_strength"),
    ("occlusion", "occlusion_uv_"),
    ("sheen", "sheen_"),
    ("specular", "specular_factor"),
    ("specular", "specular_color_"),
    ("transmission", "transmission_"),
];

pub(super) fn shipped() -> Files {
    macro_rules! files {
        ($($path:literal),*) => {
            Files::new(&[$(($path, include_str!(concat!("../../../../", $path)))),*])
        };
    }
    files![
        "shaders/lib/brdf.wgsl",
        "shaders/lib/colour.wgsl",
        "shaders/lib/environment.wgsl",
        "shaders/lib/frame.wgsl",
        "shaders/lib/fullscreen.wgsl",
        "shaders/lib/material.wgsl",
        "shaders/lib/sheen.wgsl",
        "shaders/lib/vector.wgsl",
        "shaders/pbr/background.wgsl",
        "shaders/pbr/lobes.wgsl",
        "shaders/pbr/pbr.wgsl",
        "shaders/pbr/tonemap.wgsl"
    ]
}

#[track_caller]
fn material(features: &[&str]) -> Compiled {
    compiled(shipped().compile("shaders/pbr/pbr.wgsl", features))
}

/// All names that a renderer binds by.
fn names(reflection: &Reflection) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for binding in &reflection.bindings {
        names.insert(binding.name.clone());
        if let BindingKind::Uniform { members, .. } = &binding.kind {
            names.extend(members.iter().map(|member| member.name.clone()));
        }
    }
    names.extend(
        reflection.entry_points.iter().flat_map(|entry| &entry.inputs).map(|input| input.name.clone()),
    );
    names
}

/// Names of absent features that `compiled` still holds.
fn leftovers(compiled: &Compiled, features: &[&str]) -> Vec<String> {
    let names = names(&compiled.reflection);
    let absent = OWNED.iter().filter(|(feature, _)| !features.contains(feature));
    let mut found = Vec::new();
    for (_, prefix) in absent {
        found.extend(names.iter().filter(|name| name.starts_with(prefix)).cloned());
        let text = words(&compiled.wgsl).any(|word| word.starts_with(prefix));
        found.extend(text.then(|| format!("{prefix} in the text")));
    }
    found
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|character: char| !(character.is_ascii_alphanumeric() || character == '_'))
}

#[test]
fn each_feature_and_pair_compiles_without_traces_of_absent_ones() {
    let files = shipped();
    let mut sets: Vec<Vec<&str>> =
        vec![vec![], FEATURES.iter().copied().filter(|name| *name != "unlit").collect()];
    for (index, first) in FEATURES.iter().enumerate() {
        sets.push(vec![first]);
        sets.extend(FEATURES[index + 1..].iter().map(|second| vec![*first, *second]));
    }
    for features in sets {
        let compiled = compiled(files.compile("shaders/pbr/pbr.wgsl", &features));
        assert_eq!(leftovers(&compiled, &features), Vec::<String>::new(), "for {features:?}");
    }
}

#[test]
fn leftovers_finds_a_symbol_of_an_absent_feature() {
    let found = leftovers(&material(&["sheen"]), &[]);
    assert!(found.iter().any(|name| name == "sheen_color_texture"), "{found:?}");
    assert!(found.iter().any(|name| name == "sheen_ in the text"), "{found:?}");
}

#[test]
fn each_feature_changes_the_canonical_text() {
    let plain = material(&[]);
    for feature in FEATURES {
        assert_ne!(material(&[feature]).wgsl, plain.wgsl, "{feature} does nothing");
    }
}

#[test]
fn interface_has_only_documented_names() {
    let document = include_str!("../../../../docs/shader-interface.md");
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    let mut undocumented = Vec::new();
    for (role, features) in [("pbr", &all[..]), ("background", &[]), ("tonemap", &[])] {
        let compiled = compiled(shipped().compile(&format!("shaders/pbr/{role}.wgsl"), features));
        let names = names(&compiled.reflection).into_iter();
        undocumented.extend(names.filter(|name| !is_documented(document, name)));
    }
    assert_eq!(undocumented, Vec::<String>::new());
    assert!(!is_documented(document, "no_such_texture"));
    assert!(!is_documented(document, "base_colour_texture"));
}

/// Whether the interface page names it, or the X of `X_texture`, `X_sampler`, `X_uv_u`, `X_uv_v`.
fn is_documented(document: &str, name: &str) -> bool {
    let named =
        |name: &str| document.contains(&format!("`{name}`")) || document.contains(&format!("`{name}:"));
    let suffixes = ["_texture", "_sampler", "_uv_u", "_uv_v"];
    let plain = document.contains(&format!("`{name}` ")) || named(name);
    plain || suffixes.iter().filter_map(|suffix| name.strip_suffix(suffix)).any(named)
}

#[test]
fn textures_of_all_features_fit_the_default_limit() {
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    let bindings = material(&all).reflection.bindings;
    let textures = bindings.iter().filter(|binding| matches!(binding.kind, BindingKind::Texture { .. }));
    let samplers = bindings.iter().filter(|binding| matches!(binding.kind, BindingKind::Sampler { .. }));
    // wgpu's default max_sampled_textures_per_shader_stage and max_samplers_per_shader_stage.
    assert!(textures.count() <= 16);
    assert!(samplers.count() <= 16);
}

#[test]
fn every_library_function_is_valid() {
    // Unused functions are validated too, so importing one name of each module checks all of it.
    let root = "import lib::brdf::{d_charlie, d_ggx, f_schlick, f_schlick_roughness, v_ashikhmin, v_smith_height_correlated};
        import lib::colour::{from_srgb, luminance, tone_map_aces_fitted};
        @fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f {
            let d = d_ggx(x, x, x) * v_smith_height_correlated(x, x, x) + d_charlie(x, x) * v_ashikhmin(x, x);
            let f = f_schlick(vec3f(x), 1.0, x) + f_schlick_roughness(vec3f(x), x, x);
            return vec4f(from_srgb(f) + tone_map_aces_fitted(f), luminance(f) * d);
        }";
    let mut files = shipped();
    files.0.insert("shaders/test/root.wgsl".to_owned(), root.into());
    let wgsl = compiled(files.compile("shaders/test/root.wgsl", &[])).wgsl;
    assert!(wgsl.contains("fn d_charlie("));
}

#[test]
fn feature_sets_that_agree_on_named_features_compile_to_the_same() {
    let files = shipped();
    let outcome = files.compile("shaders/pbr/background.wgsl", &["sheen"]);
    assert_eq!(outcome.features, BTreeSet::new());
    assert_eq!(compiled(outcome), compiled(files.compile("shaders/pbr/background.wgsl", &[])));
    let material = files.compile("shaders/pbr/pbr.wgsl", &[]);
    assert_eq!(material.features, set(&FEATURES));
}

#[test]
fn scan_finds_files_that_only_some_features_import() {
    let files = shipped();
    let scanned =
        scan(&Program::of("shaders/pbr/pbr.wgsl"), &mut |path| files.0.get(path).cloned()).dependencies;
    let found: BTreeSet<&str> = scanned
        .iter()
        .filter(|dependency| dependency.found)
        .map(|dependency| dependency.path.as_str())
        .collect();
    assert!(found.contains("shaders/lib/sheen.wgsl"), "{found:?}");
    assert!(!found.contains("shaders/lib/fullscreen.wgsl"), "{found:?}");
}
