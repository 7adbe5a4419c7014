//! Every shipped shader with its features, and the tutorials' programs, in all languages that have a reference compiler.
//!
//! Start at [`run`]: `kiln shader emit` writes the files, `spirv-val` and `glslangValidator` read them.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::{Bench, number, text};
use crate::bench_shaders::Verdict;
use crate::shell::{has_program, output_of, root};

/// The tutorials' programs: a vertex and a fragment stage each.
const TUTORIALS: [[&str; 2]; 7] = [
    ["cubemap.vert", "equirectangular_to_cubemap.frag"],
    ["cubemap.vert", "irradiance_convolution.frag"],
    ["cubemap.vert", "prefilter.frag"],
    ["brdf.vert", "brdf.frag"],
    ["background.vert", "background.frag"],
    ["pbr.vert", "pbr.frag"],
    ["vulkan_filtercube.vert", "vulkan_prefilter.frag"],
];

/// How many files of one language were read, and how many were found right.
#[derive(Default)]
struct Count {
    right: usize,
    all: usize,
}

impl Count {
    fn add(&mut self, result: Result<(), String>) {
        self.all += 1;
        match result {
            Ok(()) => self.right += 1,
            Err(said) => println!("  {said}"),
        }
    }

    fn judge(&self, what: &str, verdict: &mut Verdict) {
        let is_met = self.right == self.all && self.all > 0;
        verdict.judge(&format!("{} of {} {what}", self.right, self.all), is_met);
    }
}

/// Emits and checks; what no program here can read is said.
pub(crate) fn run(bench: &Bench, verdict: &mut Verdict) -> Result<(), String> {
    println!("\nevery shipped shader with no, each and all of its features, and the tutorials");
    let out = bench.folder.join("emitted");
    let mut variants = Count::default();
    for (name, shader) in shipped()? {
        let mut report = bench.kiln("cache");
        let report =
            output_of(report.args(["shader", "variants", "--json"]).arg(&shader).current_dir(root()))?;
        // Of a library, which has no entry point, nothing is written.
        let asked = number(&report, "\"compiled\": ")? as usize;
        let emitted = emit(bench, &shader, &out.join(&name));
        let written = count(&out.join(&name), ".wgsl")?;
        variants.all += asked;
        variants.right += if emitted.is_ok() { written } else { 0 };
        emitted.err().iter().for_each(|said| println!("  {name}: {said}"));
    }
    variants
        .judge("variants of the shipped shaders are emitted as WGSL, SPIR-V, GLSL, HLSL and MSL", verdict);
    let mut tutorials = Count::default();
    for [vertex, fragment] in TUTORIALS {
        let stem = fragment.trim_end_matches(".frag");
        let project = bench.folder.join("tutorials").join(stem);
        copy_program(&project, &[vertex, fragment])?;
        tutorials.add(emit(bench, &project, &out.join(format!("tutorial-{stem}"))));
    }
    tutorials.judge("programs of the tutorials compile and are emitted", verdict);
    if let Some(file) = tutorial_without_program()? {
        return Err(format!("{file} is in no program of the tutorials"));
    }
    check_files(bench, &out, verdict)
}

/// Entry modules of `shaders/`, which are those that say a stage.
fn shipped() -> Result<Vec<(String, PathBuf)>, String> {
    let mut shaders = Vec::new();
    for folder in ["pbr", "bake"] {
        for entry in std::fs::read_dir(root().join("shaders").join(folder)).map_err(text)? {
            let path = entry.map_err(text)?.path();
            let content = std::fs::read_to_string(&path).map_err(text)?;
            if ["@fragment", "@vertex", "@compute"].iter().any(|stage| content.contains(stage)) {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                shaders.push((format!("{folder}-{stem}"), path));
            }
        }
    }
    shaders.sort();
    Ok(shaders)
}

fn emit(bench: &Bench, shader: &Path, out: &Path) -> Result<(), String> {
    let mut emit = bench.kiln("cache");
    emit.args(["shader", "emit", "--to", "wgsl,spirv,glsl,hlsl,msl", "--out"]).arg(out).arg(shader);
    output_of(emit.current_dir(root())).map(drop)
}

fn copy_program(project: &Path, files: &[&str]) -> Result<(), String> {
    std::fs::create_dir_all(project).map_err(text)?;
    for file in files {
        std::fs::copy(tutorials().join(file), project.join(file)).map_err(text)?;
    }
    let toml = format!("version = 1\n[shader.tutorial]\nsource = {files:?}\n");
    std::fs::write(project.join("kiln.toml"), toml).map_err(text)
}

fn tutorials() -> PathBuf {
    root().join("tests/shaders/tutorials")
}

/// A file of the tutorials that [`TUTORIALS`] forgets.
fn tutorial_without_program() -> Result<Option<String>, String> {
    for entry in std::fs::read_dir(tutorials()).map_err(text)? {
        let name = entry.map_err(text)?.file_name().to_string_lossy().into_owned();
        let is_shader = [".vert", ".frag"].iter().any(|end| name.ends_with(end));
        if is_shader && !TUTORIALS.iter().flatten().any(|file| *file == name) {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// Files below a folder whose names end so.
fn files(folder: &Path, end: &str) -> Result<Vec<PathBuf>, String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).map_err(text)? {
            let path = entry.map_err(text)?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_string_lossy().ends_with(end) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

fn count(folder: &Path, end: &str) -> Result<usize, String> {
    if folder.is_dir() { files(folder, end).map(|files| files.len()) } else { Ok(0) }
}

/// Has every file read by whoever knows its language.
fn check_files(bench: &Bench, out: &Path, verdict: &mut Verdict) -> Result<(), String> {
    let (mut wgsl, mut same) = (Count::default(), 0);
    for file in files(out, ".wgsl")? {
        let mut check = bench.kiln("cache");
        let again = check.args(["shader", "emit", "--to", "wgsl", "-v", "base"]).arg(&file);
        let again = output_of(again.current_dir(out));
        let content = std::fs::read_to_string(&file).map_err(text)?;
        same += usize::from(again.as_ref() == Ok(&content));
        wgsl.add(again.map(drop));
    }
    wgsl.judge("WGSL files compile again", verdict);
    // Where a `let` names a constant, more is worked out the second time.
    println!("  {same} of them to the same text");
    let glsl: [(&str, &[&str]); 2] = [(".vert.glsl", &["-S", "vert"]), (".frag.glsl", &["-S", "frag"])];
    check_with("spirv-val", &[(".spv", &["--target-env", "vulkan1.1"])], "SPIR-V modules", out, verdict)?;
    let compute: (&str, &[&str]) = (".comp.glsl", &["-S", "comp"]);
    check_with("glslangValidator", &[glsl[0], glsl[1], compute], "GLSL stages", out, verdict)
}

/// `forms`: what files are called, and the arguments that read them.
fn check_with(
    program: &str,
    forms: &[(&str, &[&str])],
    what: &str,
    out: &Path,
    verdict: &mut Verdict,
) -> Result<(), String> {
    if !has_program(program) {
        println!("  SKIPPED: {program} is not installed, nothing reads the {what}");
        return Ok(());
    }
    let mut count = Count::default();
    for (end, arguments) in forms {
        for file in files(out, end)? {
            count.add(read_with(program, arguments, &file));
        }
    }
    count.judge(&format!("{what} pass {program}"), verdict);
    Ok(())
}

fn read_with(program: &str, arguments: &[&str], file: &Path) -> Result<(), String> {
    let output = Command::new(program).args(arguments).arg(file).output().map_err(text)?;
    // One of the two says it on standard output, the other on standard error.
    let said =
        [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{program} refuses {}: {said}", file.display()))
    }
}
