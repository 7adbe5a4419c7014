//! What mutations start from: the shipped shaders, the GLSL programs of the tests, and the tutorials.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use kiln_shader::Program;
use kiln_worker::{Sources, Task};

/// A program with the texts of all files it may ask for.
#[derive(Clone)]
pub struct Input {
    pub program: Program,
    pub features: BTreeSet<String>,
    pub files: BTreeMap<String, String>,
    /// Whether it was made to be valid, so that a refusal is a finding.
    pub is_valid: bool,
}

impl Input {
    pub fn of(root: &str, text: String) -> Input {
        Input {
            program: Program::of(root),
            features: BTreeSet::new(),
            files: BTreeMap::from([(root.to_owned(), text)]),
            is_valid: false,
        }
    }

    pub fn task(&self, lints: bool) -> Task {
        let sources = self.files.iter().map(|(path, text)| (path.clone(), Some(Arc::from(text.as_str()))));
        Task::Compile {
            program: self.program.clone(),
            features: self.features.clone(),
            sources: Sources(sources.collect()),
            lints,
        }
    }
}

pub fn inputs() -> Vec<Input> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shipped = files_below(&root.join("shaders"), "shaders/");
    let roots = shipped.keys().filter(|path| path.ends_with(".wgsl"));
    let mut inputs: Vec<Input> = roots
        .map(|path| Input { files: shipped.clone(), ..Input::of(path, String::new()) })
        .map(with_all_features)
        .collect();
    inputs.extend(tutorials(&root.join("tests/shaders/tutorials")));
    inputs.extend(folders(&root.join("tests/shaders/glsl")).iter().map(|folder| glsl_case(folder)));
    inputs
}

fn with_all_features(mut input: Input) -> Input {
    let mut read = |path: &str| input.files.get(path).map(|text| Arc::from(text.as_str()));
    input.features = kiln_shader::scan(&input.program, &mut read).features;
    input
}

fn tutorials(folder: &Path) -> Vec<Input> {
    let files = files_below(folder, "");
    let stages = files.iter().filter(|(path, _)| path.ends_with(".vert") || path.ends_with(".frag"));
    stages.map(|(path, text)| Input::of(path, text.clone())).collect()
}

/// A folder of `tests/shaders/glsl`: its `request.txt` says how it is compiled.
fn glsl_case(folder: &Path) -> Input {
    let files = files_below(folder, "");
    let mut input = Input { files, ..Input::of("", String::new()) };
    input.program.roots.clear();
    for line in input.files.get("request.txt").cloned().unwrap_or_default().lines() {
        let (word, value) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "root" => input.program.roots.push(value.to_owned()),
            "feature" => drop(input.features.insert(value.to_owned())),
            "include" => input.program.include_dirs.push(value.to_owned()),
            "prelude" => input.program.prelude.push(value.to_owned()),
            "define" => {
                let (name, value) = value.split_once(' ').unwrap_or((value, ""));
                input.program.defines.push((name.to_owned(), value.to_owned()));
            }
            other => panic!("{other:?} is no word of request.txt"),
        }
    }
    input.files.retain(|path, _| !path.ends_with(".txt"));
    if input.program.roots.is_empty() {
        let top = input.files.keys().filter(|path| !path.contains('/') && !path.ends_with(".inc.glsl"));
        input.program.roots = top.cloned().collect();
    }
    input
}

fn folders(folder: &Path) -> Vec<PathBuf> {
    let entries = folder.read_dir().expect("the repository has it");
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    folders
}

fn files_below(folder: &Path, prefix: &str) -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    for entry in folder.read_dir().expect("the repository has it") {
        let path = entry.expect("an entry").path();
        let name = format!("{prefix}{}", path.file_name().unwrap_or_default().to_string_lossy());
        if path.is_dir() {
            files.extend(files_below(&path, &format!("{name}/")));
        } else {
            let bytes = std::fs::read(&path).expect("a file that can be read");
            files.insert(name, String::from_utf8_lossy(&bytes).into_owned());
        }
    }
    files
}
