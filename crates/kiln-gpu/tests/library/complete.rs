//! No function of the library is left out.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::repository;

/// Read textures or derivatives, and are seen in the golden frames instead.
const SEEN_IN_FRAMES: [&str; 9] = [
    "alpha2_filtered",
    "environment_direction",
    "ggx_scale_bias",
    "irradiance_over_pi",
    "mip_level",
    "sheen_albedo",
    "sheen_radiance",
    "skybox_radiance",
    "specular_radiance",
];

/// Every function of `shaders/lib` with its text.
fn functions() -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(repository().join("shaders/lib")).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        for part in text.split("\nfn ").skip(1) {
            let name = part.split('(').next().unwrap_or_default();
            let body = part.split("\n}").next().unwrap_or_default();
            found.insert(name.to_owned(), body.to_owned());
        }
    }
    found
}

fn calls(text: &str, name: &str) -> bool {
    let call = format!("{name}(");
    let is_word = |character: char| character.is_ascii_alphanumeric() || character == '_';
    text.match_indices(&call).any(|(at, _)| !text[..at].ends_with(is_word))
}

/// Functions that no comparison calls, directly or through another.
fn left_out(functions: &BTreeMap<String, String>, comparisons: &str) -> BTreeSet<String> {
    let mut texts = vec![comparisons];
    let mut left: BTreeSet<String> = functions.keys().cloned().collect();
    while let Some(text) = texts.pop() {
        let called: Vec<String> = left.iter().filter(|name| calls(text, name)).cloned().collect();
        for name in called {
            left.remove(&name);
            texts.push(&functions[&name]);
        }
    }
    left
}

/// The strings that comparisons are made of.
fn shader_texts(source: &str) -> String {
    source.split('"').skip(1).step_by(2).collect::<Vec<_>>().join("\n")
}

#[test]
fn every_function_of_the_library_is_compared() {
    let sources = [
        include_str!("colour.rs"),
        include_str!("functions.rs"),
        include_str!("lobes.rs"),
        include_str!("punctual.rs"),
        include_str!("samples.rs"),
    ];
    let comparisons: String = sources.map(shader_texts).join("\n");
    let functions = functions();
    assert!(functions.len() > 70, "{}", functions.len());
    let left = left_out(&functions, &comparisons);
    assert_eq!(left, SEEN_IN_FRAMES.map(str::to_owned).into());
    let fewer = comparisons.replace("tone_map_agx(", "");
    assert!(left_out(&functions, &fewer).contains("tone_map_agx"), "the check itself");
}
