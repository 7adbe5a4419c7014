//! Habits of the repository that a compiler does not check.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// From the bottom to the top: a crate may use those before it.
const LAYERS: [&str; 19] = [
    "kiln-diagnostic",
    "kiln-sphere",
    "kiln-brdf",
    "kiln-image",
    "kiln-bake",
    "kiln-export",
    "kiln-check",
    "kiln-gpu",
    "kiln-accuracy",
    "kiln-shader",
    "kiln-worker",
    "kiln-scene",
    "kiln-build",
    "kiln-link",
    "kiln-project",
    "kiln-sample",
    "kiln-daemon",
    "kiln-preview",
    "kiln",
];

/// Crates that see bytes and values only.
const CORE: [&str; 9] = [
    "kiln-sphere",
    "kiln-brdf",
    "kiln-image",
    "kiln-bake",
    "kiln-export",
    "kiln-accuracy",
    "kiln-check",
    "kiln-shader",
    "kiln-scene",
];
const IO: [&str; 8] = [
    "std::fs",
    "std::net",
    "std::env",
    "std::process",
    "std::time",
    "SystemTime",
    "Instant::now",
    "available_parallelism",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir().unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Product code: without tests, and up to the first `#[cfg(test)] mod tests {`.
fn product_code(file: &Path) -> Option<String> {
    let name = file.to_string_lossy();
    if name.contains("/tests") || name.ends_with("tests.rs") || name.ends_with("testing.rs") {
        return None;
    }
    let text = std::fs::read_to_string(file).unwrap();
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    Some(text[..end].to_owned())
}

fn io_in(code: &str) -> Vec<&'static str> {
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let lines: Vec<&str> = lines.collect();
    IO.into_iter().filter(|word| lines.iter().any(|line| line.contains(word))).collect()
}

#[test]
fn core_crates_have_no_io() {
    for name in CORE {
        for file in rust_files(&root().join("crates").join(name).join("src")) {
            let Some(code) = product_code(&file) else { continue };
            assert!(io_in(&code).is_empty(), "{} uses {:?}", file.display(), io_in(&code));
        }
    }
    assert_eq!(
        io_in("let t = std::time::Instant::now();"),
        ["std::time", "Instant::now"],
        "the check itself"
    );
}

fn metadata() -> Value {
    let version = Command::new("rustc").arg("-vV").output().unwrap();
    let version = String::from_utf8(version.stdout).unwrap();
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // What other systems need has not been downloaded here.
    command.args(["metadata", "--format-version", "1", "--offline", "--filter-platform", host]);
    let output = command.current_dir(root()).output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
}

fn upward_uses(crate_name: &str, uses: &BTreeSet<String>) -> Vec<String> {
    let level = |name: &str| LAYERS.iter().position(|layer| *layer == name);
    let own = level(crate_name).unwrap_or_else(|| panic!("{crate_name} has no place in the layers"));
    uses.iter().filter(|used| level(used).is_none_or(|level| level >= own)).cloned().collect()
}

#[test]
fn crates_depend_downwards_only() {
    let metadata = metadata();
    for package in metadata["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        if !name.starts_with("kiln") {
            continue;
        }
        let uses = package["dependencies"].as_array().unwrap().iter();
        let uses =
            uses.filter(|used| used["kind"].is_null()).map(|used| used["name"].as_str().unwrap().to_owned());
        let uses: BTreeSet<String> = uses.filter(|used| used.starts_with("kiln")).collect();
        assert!(upward_uses(name, &uses).is_empty(), "{name} uses {:?}", upward_uses(name, &uses));
    }
    let wrong = BTreeSet::from(["kiln-daemon".to_owned()]);
    assert_eq!(upward_uses("kiln-image", &wrong), ["kiln-daemon"], "the check itself");
}

const PERMISSIVE: [&str; 17] = [
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-1-Clause",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "Zlib",
    "ISC",
    "0BSD",
    "CC0-1.0",
    "Unicode-3.0",
    "Unlicense",
    "OFL-1.1",
    "Ubuntu-font-1.0",
    "bzip2-1.0.6",
];

/// Every part that an `AND` joins must have one permissive alternative.
fn is_permissive(licence: &str) -> bool {
    let flat = licence.replace(['(', ')'], " ").replace('/', " OR ");
    flat.split(" AND ").all(|part| part.split(" OR ").any(|one| PERMISSIVE.contains(&one.trim())))
}

#[test]
fn licences_are_permissive() {
    for package in metadata()["packages"].as_array().unwrap() {
        let licence = package["license"].as_str().unwrap_or("none stated");
        assert!(is_permissive(licence), "{} has licence {licence}", package["name"]);
    }
    assert!(!is_permissive("GPL-3.0-only") && !is_permissive("MIT AND GPL-3.0-only"), "the check itself");
}

#[test]
fn every_invariant_names_a_test_that_exists() {
    let root = root();
    let architecture = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let code: String = ["crates", "tests", "tools"]
        .iter()
        .flat_map(|folder| rust_files(&root.join(folder)))
        .map(|file| std::fs::read_to_string(file).unwrap())
        .collect();
    let invariants: Vec<&str> = architecture.lines().filter(|line| line.starts_with("| I")).collect();
    assert!(invariants.len() >= 10, "{}", invariants.len());
    for invariant in invariants {
        let test = invariant.rsplit('`').nth(1).unwrap_or_default();
        let name = test.rsplit("::").next().unwrap();
        assert!(code.contains(&format!("fn {name}()")), "{invariant}\nhas no test");
    }
}

#[test]
fn nothing_is_left_over() {
    // Put together here, so that this file does not hold the words itself.
    let words = [["to", "do!("].concat(), ["un", "implemented!("].concat(), ["#[ig", "nore"].concat()];
    for folder in ["crates", "tests", "tools"] {
        for file in rust_files(&root().join(folder)) {
            let text = std::fs::read_to_string(&file).unwrap();
            for word in &words {
                assert!(!text.contains(word), "{} holds {word}", file.display());
            }
        }
    }
}

#[test]
fn files_begin_with_what_they_are_and_stay_within_limits() {
    for file in rust_files(&root().join("crates")) {
        let text = std::fs::read_to_string(&file).unwrap();
        let is_test = product_code(&file).is_none();
        assert!(is_test || text.starts_with("//!"), "{} has no header", file.display());
        assert!(text.lines().count() <= 600, "{} is too long", file.display());
    }
}
