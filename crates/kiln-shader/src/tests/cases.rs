//! Programs of `tests/shaders/glsl` and `tests/shaders/wgsl`, one folder each, against what stands in their `expected.txt`:
//! diagnostics as the user sees them, warnings of the lint among them, or the interface and the canonical WGSL.
//!
//! `KILN_UPDATE_SNAPSHOTS=1` writes the files anew.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::glsl::is_glsl;
use crate::{BindingKind, Outcome, Program, Reflection, lint, scan};

/// What a case is compiled with: the file `request.txt` has a word and its value on each line.
#[derive(Clone, Debug, Default)]
pub struct Case {
    pub files: BTreeMap<String, Arc<str>>,
    pub roots: Vec<String>,
    features: BTreeSet<String>,
    defines: Vec<(String, String)>,
    include_dirs: Vec<String>,
    prelude: Vec<String>,
}

impl Case {
    pub fn of(files: &[(&str, &str)]) -> Case {
        let files = files.iter().map(|(path, text)| ((*path).to_owned(), Arc::from(*text)));
        Case::new(files.collect())
    }

    fn new(files: BTreeMap<String, Arc<str>>) -> Case {
        let mut case = Case { files, ..Case::default() };
        for line in case.files.get("request.txt").cloned().unwrap_or_default().lines() {
            let (word, value) = line.split_once(' ').unwrap_or((line, ""));
            let value = value.to_owned();
            match word {
                "root" => case.roots.push(value),
                "feature" => drop(case.features.insert(value)),
                "include" => case.include_dirs.push(value),
                "prelude" => case.prelude.push(value),
                "define" => {
                    let (name, value) = value.split_once(' ').unwrap_or((&value, ""));
                    case.defines.push((name.to_owned(), value.to_owned()));
                }
                other => panic!("{other:?} is no word of request.txt"),
            }
        }
        if case.roots.is_empty() {
            let is_root = |path: &str| is_glsl(path) || path == "main.wgsl";
            let top = case.files.keys().filter(|path| is_root(path) && !path.contains('/'));
            case.roots = top.filter(|path| !path.ends_with(".inc.glsl")).cloned().collect();
        }
        case
    }

    fn program(&self) -> Program {
        let Case { roots, defines, include_dirs, prelude, .. } = self.clone();
        Program { roots, defines, include_dirs, prelude }
    }

    pub fn compile(&self) -> Outcome {
        let mut asked = BTreeSet::new();
        lint(&self.program(), &self.features, &mut |path| {
            assert!(asked.insert(path.to_owned()), "{path} is read twice");
            self.files.get(path).cloned()
        })
    }

    pub fn scan(&self) -> Vec<crate::Dependency> {
        scan(&self.program(), &mut |path| self.files.get(path).cloned()).dependencies
    }
}

/// Folders of cases.
const LANGUAGES: [&str; 2] = ["glsl", "wgsl"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/shaders")
}

/// All files below `folder`, by their path relative to it.
fn files_in(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Arc<str>>) {
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            files_in(&path, &format!("{name}/"), files);
        } else {
            files.insert(name, Arc::from(std::fs::read_to_string(&path).unwrap()));
        }
    }
}

/// All cases, by name, as `glsl/arrays`.
pub fn cases() -> BTreeMap<String, Case> {
    let mut cases = BTreeMap::new();
    for language in LANGUAGES {
        for entry in folder().join(language).read_dir().unwrap() {
            let path = entry.unwrap().path();
            let mut files = BTreeMap::new();
            files_in(&path, "", &mut files);
            files.remove("expected.txt");
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            cases.insert(format!("{language}/{name}"), Case::new(files));
        }
    }
    cases
}

/// What a snapshot holds.
pub fn summary(outcome: &Outcome) -> String {
    let mut text = String::new();
    for diagnostic in &outcome.diagnostics {
        let _ = writeln!(text, "{diagnostic}\n");
    }
    for dependency in outcome.dependencies.iter().filter(|dependency| !dependency.found) {
        let _ = writeln!(text, "missing {}", dependency.path);
    }
    for feature in &outcome.features {
        let _ = writeln!(text, "feature {feature}");
    }
    if let Some(compiled) = &outcome.compiled {
        interface(&mut text, &compiled.reflection);
        let _ = write!(text, "\n{}", compiled.wgsl);
    }
    text
}

fn interface(text: &mut String, reflection: &Reflection) {
    for entry in &reflection.entry_points {
        let _ = writeln!(text, "entry {} {:?} {:?}", entry.name, entry.stage, entry.workgroup_size);
        for input in &entry.inputs {
            let _ = writeln!(text, "    {} {}: {}", input.location, input.name, input.ty);
        }
    }
    for binding in &reflection.bindings {
        let place = format!("{}.{}", binding.group, binding.binding);
        let BindingKind::Uniform { size_bytes, members } = &binding.kind else {
            let _ = writeln!(text, "{place} {}: {:?} {:?}", binding.name, binding.kind, binding.stages);
            continue;
        };
        let _ = writeln!(text, "{place} {}: uniform, {size_bytes} bytes {:?}", binding.name, binding.stages);
        for member in members {
            let _ = writeln!(text, "    {} {}: {}", member.offset_bytes, member.name, member.ty);
        }
    }
    for constant in &reflection.overrides {
        let _ = writeln!(text, "override {}: {} = {:?}", constant.name, constant.ty, constant.default);
    }
    for parameter in &reflection.parameters {
        let _ = writeln!(
            text,
            "parameter {}: {:?} from {:?}",
            parameter.name, parameter.widget, parameter.default
        );
    }
}

/// Why `actual` is not what `path` holds; writes it there instead if `update` says so.
fn mismatch(path: &Path, actual: &str, update: bool) -> Option<String> {
    if update {
        std::fs::write(path, actual).unwrap();
    }
    let expected = std::fs::read_to_string(path).unwrap_or_default();
    (expected != actual)
        .then(|| format!("{}\n--- expected\n{expected}\n--- actual\n{actual}", path.display()))
}

#[test]
fn programs_match_their_snapshots() {
    let update = std::env::var_os("KILN_UPDATE_SNAPSHOTS").is_some();
    let mut wrong = Vec::new();
    let (mut accepted, mut refused) = (0, 0);
    for (name, case) in cases() {
        let outcome = case.compile();
        let has_errors = kiln_diagnostic::has_errors(&outcome.diagnostics);
        assert!(outcome.compiled.is_some() != has_errors, "{name}: {}", summary(&outcome));
        accepted += usize::from(!has_errors);
        refused += usize::from(has_errors);
        wrong.extend(mismatch(&folder().join(&name).join("expected.txt"), &summary(&outcome), update));
    }
    assert!(wrong.is_empty(), "{} of {} differ\n{}", wrong.len(), accepted + refused, wrong.join("\n"));
    assert!(accepted > 20 && refused > 20, "{accepted} accepted, {refused} refused");
}

#[test]
fn snapshot_check_sees_another_text_and_a_missing_file() {
    let path = folder().join("glsl/tutorial_330/expected.txt");
    let expected = std::fs::read_to_string(&path).unwrap();
    assert_eq!(mismatch(&path, &expected, false), None);
    assert!(mismatch(&path, &expected.replacen('1', "2", 1), false).is_some());
    assert!(mismatch(&folder().join("no_such_case/expected.txt"), &expected, false).is_some());
}
