//! `cargo xtask bench demand`: the corpus as one project, baked as its scenes need it and baked in full.
//!
//! In full means what a tool makes that does not look at scenes: of every environment the irradiance, each level of the GGX
//! chain and each of the Charlie chain, and both tables. The packs of scenes are the same in both forms. Shaders are compiled
//! for the sets of effects that occur, in both: the power set is counted and not built, since nobody could.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::bench::{Bench, children_cpu_seconds, text};
use crate::corpus::{name_of, panoramas};
use crate::shell::{cargo, output_of, step};

/// What issue 6 asks for at most, of the full form.
const CPU_AIM: f64 = 0.35;
const BYTES_AIM: f64 = 0.30;

/// How a project is baked.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Needed,
    Full,
}

/// A scene's name and its file, relative to the corpus.
type Scene = (String, String);

/// What a bake with an empty cache took.
struct Taken {
    actions: usize,
    cpu_s: f64,
    wall_s: f64,
    store_bytes: u64,
    published_bytes: u64,
    /// Kind of action to number and wall-clock seconds.
    by_action: BTreeMap<String, (usize, f64)>,
    /// Kind of target to bytes.
    by_target: BTreeMap<String, u64>,
    /// Scenes that cannot be drawn.
    refused: Vec<String>,
}

/// Bakes both forms, of all scenes and of one scene for each environment, and prints them side by side.
pub(crate) fn run() -> Result<(), String> {
    let corpus = std::env::var_os("KILN_CORPUS").ok_or("KILN_CORPUS must name the folder of real files")?;
    let corpus = PathBuf::from(corpus);
    step("build", &mut cargo(&["build", "--release"]))?;
    let bench = Bench::new("bench-demand")?;
    let project = bench.init("project", "64")?;
    std::os::unix::fs::symlink(&corpus, project.join("corpus")).map_err(text)?;
    let envs = panoramas(&corpus)?;
    let scenes = drawable(&bench, &project, &envs, scenes(&corpus)?)?;
    let features = feature_count(&bench, &project)?;
    println!("\n{} cores; empty caches; scenes are dealt to {} environments in turn", cores(), envs.len());
    println!(
        "shaders are compiled for the sets of effects that occur; the power set of {features} features has {}",
        1_u64 << features
    );
    for (what, count) in [("all scenes", scenes.len()), ("one scene for each environment", envs.len())] {
        // Evenly from the whole list, so that neighbours, which are alike, do not all come from one folder.
        let chosen: Vec<Scene> =
            (0..count.min(scenes.len())).map(|at| scenes[at * scenes.len() / count].clone()).collect();
        println!("\n== {what}: {} scenes, {} environments", chosen.len(), envs.len());
        let [needed, full] = [Form::Needed, Form::Full].map(|form| {
            write_project(&project, &envs, &chosen, form)?;
            bake(&bench, &project, if form == Form::Needed { "needed" } else { "full" })
        });
        compare(&needed?, &full?);
    }
    Ok(())
}

fn cores() -> usize {
    crate::bench::cores()
}

/// Every .gltf and .glb of the corpus.
fn scenes(corpus: &Path) -> Result<Vec<Scene>, String> {
    let mut files = Vec::new();
    list(&corpus.join("gltf"), &mut files)?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == "gltf" || extension == "glb"));
    files.sort();
    let named = files.iter().enumerate().map(|(at, file)| {
        let below = file.strip_prefix(corpus).unwrap_or(file).to_string_lossy().into_owned();
        (format!("s{at}_{}", name_of(&below)), below)
    });
    Ok(named.collect())
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    for entry in folder.read_dir().map_err(|error| format!("{}: {error}", folder.display()))? {
        let path = entry.map_err(text)?.path();
        if path.is_dir() { list(&path, files)? } else { files.push(path) }
    }
    Ok(())
}

/// The scenes that Kiln draws: one that it refuses could need anything, and would turn the whole environment on.
fn drawable(
    bench: &Bench,
    project: &Path,
    envs: &[(String, String)],
    scenes: Vec<Scene>,
) -> Result<Vec<Scene>, String> {
    write_project(project, &envs[..1], &scenes, Form::Needed)?;
    let refused = bake(bench, project, "trial")?.refused;
    println!("{} glTF files; {} are refused and left out", scenes.len(), refused.len());
    Ok(scenes.into_iter().filter(|(name, _)| !refused.contains(name)).collect())
}

fn write_project(
    project: &Path,
    envs: &[(String, String)],
    scenes: &[Scene],
    form: Form,
) -> Result<(), String> {
    let mut toml = "version = 1\n[project]\nname = \"corpus\"\n".to_owned();
    for (name, file) in envs {
        toml.push_str(&format!("[env.{name}]\nsource = \"corpus/{file}\"\n"));
        if form == Form::Full {
            toml.push_str("bake = \"all\"\nsheen = true\n");
        }
    }
    for (at, (name, file)) in scenes.iter().enumerate() {
        let env = &envs[at % envs.len()].0;
        toml.push_str(&format!("[scene.{name}]\nsource = \"corpus/{file}\"\nenv = \"{env}\"\n"));
    }
    for shader in ["pbr", "background", "tonemap"] {
        toml.push_str(&format!("[shader.{shader}]\nsource = \"shaders/pbr/{shader}.wgsl\"\n"));
    }
    std::fs::write(project.join("kiln.toml"), toml).map_err(text)
}

/// Bakes with an empty cache and without files of an earlier bake.
fn bake(bench: &Bench, project: &Path, cache: &str) -> Result<Taken, String> {
    for folder in [bench.folder.join(cache), project.join("baked")] {
        // Left over from the form before, or not there.
        let _ = std::fs::remove_dir_all(folder);
    }
    let (start, cpu_before) = (Instant::now(), children_cpu_seconds().unwrap_or(f64::NAN));
    // Refused scenes end a bake with exit code 1; its report is whole all the same.
    let output = bench.kiln(cache).args(["bake", "--json", "--keep-going"]).arg(project).output();
    let report = String::from_utf8_lossy(&output.map_err(text)?.stdout).into_owned();
    let wall_s = start.elapsed().as_secs_f64();
    let cpu_s = children_cpu_seconds().unwrap_or(f64::NAN) - cpu_before;
    let bytes_below = |folder: &Path| {
        let mut files = Vec::new();
        list(folder, &mut files)?;
        Ok::<u64, String>(files.iter().filter_map(|file| Some(file.metadata().ok()?.len())).sum())
    };
    let mut taken = Taken {
        actions: 0,
        cpu_s,
        wall_s,
        store_bytes: bytes_below(&bench.folder.join(cache))?,
        published_bytes: bytes_below(&project.join("baked"))?,
        by_action: BTreeMap::new(),
        by_target: BTreeMap::new(),
        refused: Vec::new(),
    };
    taken.read(&report)?;
    // Children of kiln that compile are not waited for, and so are not in its CPU time.
    taken.cpu_s += taken.by_action.get("compile").map_or(0.0, |(_, seconds)| *seconds);
    Ok(taken)
}

impl Taken {
    /// Reads the report of `kiln bake --json`, which has a property a line and sorted keys.
    fn read(&mut self, report: &str) -> Result<(), String> {
        let (mut name, mut status, mut bytes) = (String::new(), String::new(), 0);
        for line in report.lines() {
            let Some((key, value)) = line.trim().trim_end_matches(',').split_once("\": ") else { continue };
            let value = value.trim_matches('"');
            match key.trim_start_matches('"') {
                "name" => name = value.to_owned(),
                "status" => status = value.to_owned(),
                "wall_ms" if status == "failed" => {
                    let scene = name.strip_prefix("pack scene/").map(str::to_owned);
                    self.refused.extend(scene);
                }
                "wall_ms" if status == "ran" => {
                    let wall_ms: f64 = value.parse().map_err(|error| format!("wall_ms {value}: {error}"))?;
                    let (count, seconds) = self.by_action.entry(kind_of(&name)).or_default();
                    *count += 1;
                    *seconds += wall_ms / 1e3;
                    self.actions += 1;
                }
                "bytes" => bytes = value.parse().unwrap_or(0),
                "kind" => *self.by_target.entry(value.to_owned()).or_default() += bytes,
                _ => {}
            }
        }
        if self.actions == 0 { Err("the bake ran nothing".to_owned()) } else { Ok(()) }
    }
}

/// `prefilter env/sky/specular mip 3` is a `prefilter specular`, `decode env/sky` a `decode`.
fn kind_of(action: &str) -> String {
    let mut kind: Vec<&str> = action.split(' ').take_while(|word| !word.contains('/')).collect();
    let of_env = action.split(' ').find_map(|word| word.strip_prefix("env/"));
    let map = of_env.and_then(|env| Some(env.split_once('/')?.1));
    kind.extend(map.filter(|map| !action.starts_with(&format!("prefilter {map} "))));
    kind.join(" ")
}

fn compare(needed: &Taken, full: &Taken) {
    const MIB: f64 = 1048576.0;
    let row = |what: &str, [needed, full]: [f64; 2], unit: &str, aim: Option<f64>| {
        let aim = aim.map_or(String::new(), |aim| format!("  (aim: at most {:.0} %)", aim * 100.0));
        let share = if full == 0.0 { 100.0 } else { needed / full * 100.0 };
        println!("{what:32} {needed:10.1} {full:10.1} {unit:4} {share:6.1} %{aim}");
    };
    println!("{:32} {:>10} {:>10}", "", "needed", "full");
    row("actions", [needed.actions as f64, full.actions as f64], "", None);
    row("CPU time", [needed.cpu_s, full.cpu_s], "s", Some(CPU_AIM));
    row("wall-clock time", [needed.wall_s, full.wall_s], "s", None);
    let mib = |of: fn(&Taken) -> u64| [needed, full].map(|taken| of(taken) as f64 / MIB);
    row("published", mib(|taken| taken.published_bytes), "MiB", Some(BYTES_AIM));
    row("store", mib(|taken| taken.store_bytes), "MiB", Some(BYTES_AIM));
    println!("wall-clock time of actions, which share the cores, by kind:");
    let kinds = full
        .by_action
        .keys()
        .chain(needed.by_action.keys().filter(|kind| !full.by_action.contains_key(*kind)));
    for kind in kinds {
        let of = |taken: &Taken| taken.by_action.get(kind).copied().unwrap_or_default();
        let [(needed_count, needed_s), (full_count, full_s)] = [of(needed), of(full)];
        row(&format!("  {kind} ({needed_count}, {full_count})"), [needed_s, full_s], "s", None);
    }
    println!("bytes of targets by kind:");
    for kind in full.by_target.keys() {
        let of = |taken: &Taken| taken.by_target.get(kind).copied().unwrap_or(0) as f64 / MIB;
        row(&format!("  {kind}"), [of(needed), of(full)], "MiB", None);
    }
}

/// Features of the material shader.
fn feature_count(bench: &Bench, project: &Path) -> Result<u32, String> {
    let mut variants: Command = bench.kiln("trial");
    variants.args(["shader", "variants", "--json"]).arg(project.join("shaders/pbr/pbr.wgsl"));
    let printed = output_of(&mut variants)?;
    let features = printed.split_once("\"features\": [").ok_or("no features")?.1;
    let count = features.split(']').next().unwrap_or_default().matches('"').count() / 2;
    u32::try_from(count).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_count_by_what_they_make() {
        let kinds = [
            ("decode env/sky", "decode"),
            ("measure env/sky/specular", "measure specular"),
            ("prefilter env/sky/specular mip 3", "prefilter specular"),
            ("prefilter sheen env/sky/sheen mip 3", "prefilter sheen"),
            ("compile shader/pbr/base", "compile"),
        ];
        for (action, kind) in kinds {
            assert_eq!(kind_of(action), kind);
        }
    }
}
