//! `cargo xtask bench render [FRAMES]`: milliseconds a frame of real scenes and of its passes, and what each of their effects
//! costs.
//!
//! What an effect costs is the time that is saved when `[effects] forbid` takes it out of every variant: its code, its
//! bindings and its passes are gone then. Scenes are drawn at 1280×720 by whatever adapter `kiln render` finds, whose name is
//! printed; a frame ends when the device is done with it. Passes are timed by the device's own clocks, where it has some. On
//! hardware the passes that shade must fit into 1 ms at 1920×1080.

use std::collections::BTreeSet;
use std::path::Path;

use crate::bench::{Bench, text};
use crate::shell::{cargo, output_of, step};

/// Scenes of the corpus and what they stand for.
const SCENES: [(&str, &str); 5] = [
    ("ToyCar", "gltf/khronos-sample-assets/ToyCar/glTF/ToyCar.gltf"),
    ("ClearCoatTest", "gltf/khronos-sample-assets/ClearCoatTest"),
    ("TransmissionTest", "gltf/khronos-sample-assets/TransmissionTest"),
    ("SheenChair", "gltf/khronos-sample-assets/SheenChair"),
    ("Fox", "gltf/khronos-sample-assets/Fox"),
];

const PANORAMA: &str = "hdr/polyhaven-pmndrs/studio.hdr";

/// A frame at rest.
const WHOLE: [&str; 2] = ["--size", "1280x720"];
/// What a window of that size draws with while a slow picture moves.
const MOVING: [(&str, [&str; 3]); 2] = [
    ("moving, one sample a pixel", ["--single-sample", "--size", "1280x720"]),
    ("moving, a quarter of its width", ["--single-sample", "--size", "320x180"]),
];

/// Prints a table for each scene.
pub(crate) fn run(frames: usize) -> Result<(), String> {
    let corpus = std::env::var_os("KILN_CORPUS").ok_or("KILN_CORPUS must name the folder of real files")?;
    step("build", &mut cargo(&["build", "--release"]))?;
    let bench = Bench::new("bench-render")?;
    let project = bench.init("project", "64")?;
    std::os::unix::fs::symlink(&corpus, project.join("corpus")).map_err(text)?;
    let mut adapter = String::new();
    for (name, path) in SCENES {
        let Some(file) = first_scene(&Path::new(&corpus).join(path)) else {
            println!("\n{name}: not in the corpus");
            continue;
        };
        let below = file.strip_prefix(Path::new(&corpus)).unwrap_or(&file).display().to_string();
        write_project(&project, &below, None)?;
        let effects = effects(&bench, &project)?;
        let whole = frame_ms(&bench, &project, frames, &WHOLE, &mut adapter)?;
        println!("\n{name}, 1280x720, studio: {:.1} ms a frame (best {:.1})", whole.median, whole.best);
        for (pass, ms) in &whole.passes {
            println!("  pass {pass:<25} {ms:>7.1} ms");
        }
        for (what, options) in MOVING {
            let moving = frame_ms(&bench, &project, frames, &options, &mut adapter)?;
            println!(
                "  {what:<30} {:>7.1} ms   {:.1} times as fast",
                moving.median,
                whole.median / moving.median
            );
        }
        if !is_software(&adapter) {
            let hd = frame_ms(&bench, &project, frames, &["--size", "1920x1080"], &mut adapter)?;
            let shading = hd.passes.iter().filter(|(pass, _)| SHADING.contains(&pass.as_str()));
            let shading: f64 = shading.map(|(_, ms)| ms).sum();
            let verdict = if shading <= BUDGET_MS { "within" } else { "OVER" };
            println!("  shading at 1920x1080 {shading:>14.2} ms   {verdict} the budget of {BUDGET_MS} ms");
        }
        for effect in effects {
            // Beside each other, and the best of each: other work on the machine changes within minutes.
            write_project(&project, &below, None)?;
            let with = frame_ms(&bench, &project, frames, &WHOLE, &mut adapter)?;
            write_project(&project, &below, Some(&effect))?;
            let without = frame_ms(&bench, &project, frames, &WHOLE, &mut adapter)?;
            println!(
                "  without {effect:<22} {:>7.1} ms   it costs {:>6.1} ms",
                without.best,
                with.best - without.best
            );
        }
    }
    println!("\nmedians of {frames} frames after the first, costs from the best of them, on {adapter}");
    Ok(())
}

/// The file itself, or the first .gltf or .glb below a folder.
fn first_scene(path: &Path) -> Option<std::path::PathBuf> {
    if path.is_file() {
        return Some(path.to_owned());
    }
    let mut entries: Vec<_> = path.read_dir().ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    entries.sort();
    let is_scene = |path: &std::path::PathBuf| {
        path.is_file() && path.extension().is_some_and(|ending| ending == "gltf" || ending == "glb")
    };
    let found = entries.iter().find(|path| is_scene(path)).cloned();
    found.or_else(|| entries.iter().filter(|path| path.is_dir()).find_map(|path| first_scene(path)))
}

fn write_project(project: &Path, scene: &str, forbidden: Option<&str>) -> Result<(), String> {
    let mut toml = format!(
        "version = 1\n[project]\nname = \"render\"\n[env.studio]\nsource = \"corpus/{PANORAMA}\"\n\
         [scene.shown]\nsource = \"corpus/{scene}\"\nenv = \"studio\"\n"
    );
    for shader in ["pbr", "background", "tonemap"] {
        toml.push_str(&format!("[shader.{shader}]\nsource = \"shaders/pbr/{shader}.wgsl\"\n"));
    }
    if let Some(effect) = forbidden {
        toml.push_str(&format!("[effects]\nforbid = [\"{effect}\"]\n"));
    }
    std::fs::write(project.join("kiln.toml"), toml).map_err(text)
}

/// Every effect that some variant is compiled for.
fn effects(bench: &Bench, project: &Path) -> Result<BTreeSet<String>, String> {
    let plan = output_of(bench.kiln("cache").args(["plan", "--json"]).arg(project))?;
    let variants = plan.lines().filter_map(|line| {
        line.split_once("\"compile shader/pbr/").and_then(|(_, rest)| rest.split('"').next())
    });
    let named = variants.flat_map(|variant| variant.split('+')).filter(|effect| *effect != "base");
    Ok(named.map(str::to_owned).collect())
}

/// Passes that shade materials.
const SHADING: [&str; 3] = ["scene", "opaque", "transmissive and blended"];
/// What they may take together on hardware.
const BUDGET_MS: f64 = 1.0;

/// Whether an adapter draws on the CPU, by its description.
fn is_software(adapter: &str) -> bool {
    ["llvmpipe", "SwiftShader", "WARP"].iter().any(|name| adapter.contains(name))
}

struct Times {
    median: f64,
    best: f64,
    /// Medians of each pass, in order.
    passes: Vec<(String, f64)>,
}

fn median(times: &mut [f64]) -> Option<f64> {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}

fn frame_ms(
    bench: &Bench,
    project: &Path,
    frames: usize,
    options: &[&str],
    adapter: &mut String,
) -> Result<Times, String> {
    let mut command = bench.kiln("cache");
    command.args(["render", "--json", "--frames", &(frames + 1).to_string()]).args(options).arg("--out");
    let report = output_of(command.arg(bench.folder.join("frames")).arg(project))?;
    let value = |line: &str, key: &str| {
        let rest = line.trim().strip_prefix(&format!("\"{key}\": "))?;
        Some(rest.trim_end_matches(',').trim_matches('"').to_owned())
    };
    if let Some(name) = report.lines().find_map(|line| value(line, "adapter")) {
        *adapter = name;
    }
    // The first frame makes the driver compile.
    let times = report.lines().filter_map(|line| value(line, "draw_ms")?.parse::<f64>().ok()).skip(1);
    let mut times: Vec<f64> = times.collect();
    let middle = median(&mut times).ok_or("kiln render drew nothing")?;
    let mut passes: Vec<(String, Vec<f64>)> = Vec::new();
    let (mut frame, mut pass) = (0, String::new());
    for line in report.lines() {
        frame += usize::from(value(line, "draw_ms").is_some());
        if let Some(name) = value(line, "pass") {
            pass = name;
        }
        let Some(ms) = value(line, "ms").and_then(|ms| ms.parse().ok()).filter(|_| frame > 1) else {
            continue;
        };
        match passes.iter_mut().find(|(name, _)| *name == pass) {
            Some((_, times)) => times.push(ms),
            None => passes.push((pass.clone(), vec![ms])),
        }
    }
    let passes = passes.into_iter().filter_map(|(pass, mut times)| Some((pass, median(&mut times)?)));
    Ok(Times { median: middle, best: times[0], passes: passes.collect() })
}
