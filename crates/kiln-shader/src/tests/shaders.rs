//! The shaders that users start from: every feature compiles, and a variant holds nothing of absent ones.

use std::collections::BTreeSet;

use super::{Files, compiled, set};
use crate::{BindingKind, Compiled, Program, Reflection, scan};

pub(super) const FEATURES: [&str; 21] = [
    "alpha_blend",
    "alpha_mask",
    "anisotropy",
    "clearcoat",
    "diffuse_transmission",
    "dispersion",
    "emission",
    "instancing",
    "iridescence",
    "morph",
    "normal_map",
    "occlusion",
    "punctual_lights",
    "sheen",
    "skin",
    "specular",
    "sun",
    "transmission",
    "unlit",
    "vertex_color",
    "volume",
];

/// Names of the interface that belong to one feature, by what they start with.
const OWNED: [(&str, &str); 31] = [
    ("alpha_mask", "alpha_cutoff"),
    ("anisotropy", "anisotropy_"),
    ("clearcoat", "clearcoat_"),
    ("diffuse_transmission", "diffuse_transmission_"),
    ("dispersion", "dispersion"),
    ("emission", "emissive_"),
    ("instancing", "instances"),
    ("iridescence", "iridescence_"),
    ("morph", "morph_"),
    ("normal_map", "normal_texture"),
    ("normal_map", "normal_scale"),
    ("normal_map", "normal_uv_"),
    ("occlusion", "occlusion_texture"),
    ("occlusion", "occlusion_strength"),
    ("occlusion", "occlusion_uv_"),
    ("punctual_lights", "lights"),
    ("punctual_lights", "Punctual"),
    ("sheen", "sheen_"),
    ("skin", "joint_matrices"),
    ("skin", "joints"),
    ("skin", "weights"),
    ("specular", "specular_factor"),
    ("specular", "specular_color_"),
    ("sun", "sun"),
    ("transmission", "scene_color"),
    ("transmission", "transmission_"),
    ("volume", "attenuation_color"),
    ("volume", "attenuation_distance"),
    ("volume", "thickness_factor"),
    ("volume", "thickness_texture"),
    ("volume", "thickness_uv_"),
];

/// Every file of the repository's `shaders/lib`, `shaders/pbr` and `shaders/bake`.
pub(super) fn shipped() -> Files {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Files::new(&[]);
    for folder in ["shaders/lib", "shaders/pbr", "shaders/bake"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{folder}/{}", path.file_name().unwrap().to_str().unwrap());
            files.0.insert(name, std::fs::read_to_string(path).unwrap().into());
        }
    }
    files
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
    let lit: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    let all = material(&lit);
    for feature in &lit {
        // Beside all others: a volume, for one, does nothing to what lets no light through.
        let others: Vec<&str> = lit.iter().copied().filter(|name| name != feature).collect();
        assert_ne!(material(&others).wgsl, all.wgsl, "{feature} does nothing");
    }
    assert_ne!(material(&["unlit"]).wgsl, material(&[]).wgsl);
    assert_eq!(material(&["volume"]).wgsl, material(&[]).wgsl, "an opaque thing has no inside");
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

/// How many textures and samplers a variant declares.
fn texture_and_sampler_count(features: &[&str]) -> (usize, usize) {
    let bindings = material(features).reflection.bindings;
    let count = |is_it: fn(&BindingKind) -> bool| bindings.iter().filter(|it| is_it(&it.kind)).count();
    let textures = count(|kind| matches!(kind, BindingKind::Texture { .. }));
    (textures, count(|kind| matches!(kind, BindingKind::Sampler { .. })))
}

/// Default of max_sampled_textures_per_shader_stage and max_samplers_per_shader_stage in WebGPU; Metal has no more samplers.
const LIMIT: usize = 16;

#[test]
fn three_effects_fit_the_default_limit_of_textures() {
    let effects = [
        "anisotropy",
        "clearcoat",
        "diffuse_transmission",
        "iridescence",
        "sheen",
        "specular",
        "transmission",
        "volume",
    ];
    for (index, first) in effects.iter().enumerate() {
        for (second_index, second) in effects.iter().enumerate().skip(index + 1) {
            for third in &effects[second_index + 1..] {
                let set = ["normal_map", "occlusion", "emission", first, second, third];
                // Sheen reads a chain and a table of its own; `lib::sheen` has a formula in the table's place.
                let more = usize::from(set.contains(&"sheen"));
                assert!(texture_and_sampler_count(&set).0 <= LIMIT + more, "{set:?}");
            }
        }
    }
}

#[test]
fn samplers_of_all_features_fit_the_default_limit() {
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    let (textures, samplers) = texture_and_sampler_count(&all);
    assert!(samplers <= LIMIT, "{samplers}");
    // Everything at once is for devices that have more: the preview asks for all its adapter has.
    assert_eq!(textures, 26);
}

/// The first function that a module declares.
fn first_function(text: &str) -> Option<&str> {
    let line = text.lines().find_map(|line| line.strip_prefix("fn "))?;
    line.split('(').next()
}

#[test]
fn every_library_function_is_valid() {
    let files = shipped();
    // A module is joined whole and validated before what is unused goes: one name of each checks all of it.
    for (path, text) in files.0.iter().filter(|(path, _)| path.starts_with("shaders/lib/")) {
        let Some(name) = first_function(text) else {
            assert!(
                path.ends_with("constants.wgsl") || path.ends_with("frame.wgsl"),
                "{path} has no function"
            );
            continue;
        };
        let module = path.trim_start_matches("shaders/lib/").trim_end_matches(".wgsl");
        let compile = |text: &str| {
            let root =
                format!("import lib::{module}::{name};\n@compute @workgroup_size(1) fn main() {{ _ = 1; }}");
            let mut files = shipped();
            files.0.insert(path.clone(), text.into());
            files.0.insert("shaders/test/root.wgsl".to_owned(), root.as_str().into());
            files.compile("shaders/test/root.wgsl", &[])
        };
        compiled(compile(text));
        assert!(compile(&format!("{text}\nfn wrong() -> f32 {{ return 1u; }}")).compiled.is_none(), "{path}");
    }
}

#[test]
fn feature_sets_that_agree_on_named_features_compile_to_the_same() {
    let files = shipped();
    let outcome = files.compile("shaders/pbr/background.wgsl", &["sheen"]);
    assert_eq!(outcome.features, BTreeSet::new());
    assert_eq!(compiled(outcome), compiled(files.compile("shaders/pbr/background.wgsl", &[])));
    let material = files.compile("shaders/pbr/pbr.wgsl", &[]);
    let mut known = set(&FEATURES);
    known.insert("inspect".to_owned());
    assert_eq!(material.features, known);
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
    assert!(found.contains("shaders/pbr/sheen.wgsl"), "{found:?}");
    assert!(!found.contains("shaders/lib/fullscreen.wgsl"), "{found:?}");
}
