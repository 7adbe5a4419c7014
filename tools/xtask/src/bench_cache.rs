//! `cargo xtask bench cache`: what the build graph and its store cost, on generated projects.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant, SystemTime};

use crate::bench::{Bench, Running, SETTLING, lines_of, number, print_times, text};
use crate::shell::{cargo, output_of, step};

const RUNS: usize = 20;
const EDITS: usize = 20;

/// How large a generated project is.
#[derive(Clone, Copy)]
struct Size {
    environments: usize,
    scenes: usize,
    shaders: usize,
    /// Modules that each shader imports, of its own.
    modules: usize,
}

/// The project of the goal: 100 environments, 20 scenes, 200 shaders.
const GOAL: Size = Size { environments: 100, scenes: 20, shaders: 200, modules: 1 };

/// Prints every figure.
pub(crate) fn run() -> Result<(), String> {
    step("build", &mut cargo(&["build", "--release"]))?;
    let bench = Bench::new("bench-cache")?;
    println!(
        "\n{} cores; wall-clock times of whole processes unless said otherwise\n",
        crate::bench::cores()
    );
    bench.hashing()?;
    bench.goal()?;
    println!();
    for shaders in [100, 300, 1000] {
        bench.growth(Size { environments: 0, scenes: 0, shaders, modules: 9 })?;
    }
    println!();
    bench.overhead()?;
    cancellation()
}

/// How long a build goes on when it is not wanted any more: measured by a test, which knows the inside.
fn cancellation() -> Result<(), String> {
    let mut test =
        cargo(&["test", "--release", "--workspace", "cancelled_build_ends_soon", "--", "--nocapture"]);
    let printed = output_of(&mut test)?;
    printed.lines().filter(|line| line.contains("cancelled:")).for_each(|line| println!("{line}"));
    Ok(())
}

impl Bench {
    /// A gibibyte of source, beside the system's own tool.
    fn hashing(&self) -> Result<(), String> {
        let project = self.folder.join("hashing");
        write(&project, "kiln.toml", "version = 1\n[env.big]\nsource = \"big.hdr\"\n")?;
        let big = std::fs::File::create(project.join("big.hdr")).map_err(text)?;
        let bytes = 1_u64 << 30;
        big.set_len(bytes).map_err(text)?;
        let read = timed(Command::new("cat").arg(project.join("big.hdr")).stdout(Stdio::null()))?;
        let kiln = timed(self.kiln("hashing-cache").arg("plan").arg(&project).stdout(Stdio::null()))?;
        let peer = timed(Command::new("sha256sum").arg(project.join("big.hdr")).stdout(Stdio::null()));
        let speed = |ms: f64| bytes as f64 / 1e6 / ms;
        let peer =
            peer.map_or("sha256sum is not here".to_owned(), |ms| format!("sha256sum {:.2} GB/s", speed(ms)));
        println!(
            "a source of 1 GiB: first read from the disk (cat) {:.2} GB/s, then hashed by kiln plan {:.2} GB/s; beside it {peer}",
            speed(read),
            speed(kiln)
        );
        std::fs::remove_dir_all(&project).map_err(text)
    }

    fn goal(&self) -> Result<(), String> {
        let project = self.folder.join("goal");
        let files = generate(&project, GOAL)?;
        let cache = "goal-cache";
        println!("100 environments, 20 scenes, 200 shaders: {files} source files");
        let first = timed(self.kiln(cache).arg("bake").arg(&project).stdout(Stdio::null()))?;
        println!("  first bake: {:.1} s", first / 1e3);
        self.settle(&project, cache)?;
        let mut bakes = self.times(cache, &["bake"], &project)?;
        print_times("  kiln bake, nothing changed", &mut bakes);
        let mut plans = self.times(cache, &["plan"], &project)?;
        print_times("  kiln plan, nothing changed", &mut plans);
        let report = output_of(self.kiln(cache).arg("bake").arg(&project).arg("--json"))?;
        let actions = report.matches("\"status\": \"reused\"").count();
        println!(
            "  files hashed in a bake of nothing: {}; overhead {:.0} µs for each of {actions} reused actions",
            number(&report, "\"hashed\": ")?,
            bakes[bakes.len() / 2] * 1e3 / actions as f64
        );
        let mut stats = (0..RUNS).map(|_| stat_all(&project)).collect::<Result<Vec<f64>, _>>()?;
        print_times("  beside it: stat of every source, nothing else", &mut stats);
        self.touched(&project, cache)?;
        self.one_shader(&project, cache)?;
        self.watched(&project, cache, "  ")
    }

    /// Bakes until no file is young any more.
    fn settle(&self, project: &Path, cache: &str) -> Result<(), String> {
        let start = Instant::now();
        while start.elapsed() < SETTLING {
            output_of(self.kiln(cache).arg("bake").arg(project))?;
        }
        output_of(self.kiln(cache).arg("bake").arg(project))?;
        let report = output_of(self.kiln(cache).arg("bake").arg(project).arg("--json"))?;
        if number(&report, "\"hashed\": ")? == 0.0 {
            Ok(())
        } else {
            Err("unchanged files are hashed".to_owned())
        }
    }

    fn times(&self, cache: &str, arguments: &[&str], project: &Path) -> Result<Vec<f64>, String> {
        (0..RUNS)
            .map(|_| timed(self.kiln(cache).args(arguments).arg(project).stdout(Stdio::null())))
            .collect()
    }

    /// A touched file is hashed once, and nothing runs.
    fn touched(&self, project: &Path, cache: &str) -> Result<(), String> {
        let path = project.join("env/e7.hdr");
        let content = std::fs::read(&path).map_err(text)?;
        std::fs::write(&path, content).map_err(text)?;
        let report = output_of(self.kiln(cache).arg("bake").arg(project).arg("--json"))?;
        let ran = report.matches("\"status\": \"ran\"").count();
        println!("  one file touched: {} hashed, {ran} actions ran", number(&report, "\"hashed\": ")?);
        Ok(())
    }

    /// What a fresh process spends on one changed shader besides compiling it.
    fn one_shader(&self, project: &Path, cache: &str) -> Result<(), String> {
        let (mut totals, mut beyond) = (Vec::new(), Vec::new());
        for edit in 0..EDITS {
            write_shader(project, 3, GOAL.modules, edit + 1)?;
            let start = Instant::now();
            let report = output_of(self.kiln(cache).arg("bake").arg(project).arg("--json"))?;
            totals.push(start.elapsed().as_secs_f64() * 1e3);
            let work = number_after(&report, "\"status\": \"ran\"", "\"wall_ms\": ")?;
            beyond.push(number(&report, "\"plan_ms\": ")? + number(&report, "\"run_ms\": ")? - work);
        }
        print_times("  one changed shader, fresh process: kiln bake", &mut totals);
        print_times("  one changed shader, fresh process: plan and run beyond the compilation", &mut beyond);
        Ok(())
    }

    /// The same under a running daemon.
    fn watched(&self, project: &Path, cache: &str, indent: &str) -> Result<(), String> {
        let mut daemon = self.kiln(cache);
        let daemon = daemon.arg("watch").arg(project).args(["--json", "--no-output"]);
        let mut daemon = daemon.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(text)?;
        let lines = lines_of(&mut daemon)?;
        let _daemon = Running(daemon);
        published(&lines)?;
        let (mut totals, mut beyond) = (Vec::new(), Vec::new());
        for edit in 0..EDITS {
            write_shader(project, 5, 1, edit + 1000)?;
            let saved = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            let line = published(&lines)?;
            totals.push(number(&line, "\"published_unix_ms\":")? - saved.as_secs_f64() * 1e3);
            let work: f64 = number(&line, "\"wall_ms\":")?;
            beyond.push(number(&line, "\"plan_ms\":")? + number(&line, "\"run_ms\":")? - work);
        }
        print_times(&format!("{indent}one changed shader, running daemon: save → published"), &mut totals);
        print_times(
            &format!("{indent}one changed shader, running daemon: plan and run beyond the compilation"),
            &mut beyond,
        );
        Ok(())
    }

    fn growth(&self, size: Size) -> Result<(), String> {
        let project = self.folder.join(format!("growth-{}", size.shaders));
        let files = generate(&project, size)?;
        let cache = format!("growth-cache-{}", size.shaders);
        output_of(self.kiln(&cache).arg("bake").arg(&project))?;
        self.settle(&project, &cache)?;
        println!("{files} source files, {} shaders", size.shaders);
        print_times("  kiln plan, fresh process, warm store", &mut self.times(&cache, &["plan"], &project)?);
        print_times("  kiln bake, nothing changed", &mut self.times(&cache, &["bake"], &project)?);
        self.watched(&project, &cache, "  ")
    }

    /// What running an action costs beyond the action: shaders of three lines, one job.
    fn overhead(&self) -> Result<(), String> {
        let size = Size { environments: 0, scenes: 0, shaders: 500, modules: 0 };
        let project = self.folder.join("overhead");
        generate(&project, size)?;
        let memory = PathBuf::from("/dev/shm/kiln-bench-cache");
        for (place, cache) in
            [("on the disk", self.folder.join("overhead-cache")), ("in memory (/dev/shm)", memory)]
        {
            // Left over from an earlier bench, or not there.
            let _ = std::fs::remove_dir_all(&cache);
            if cache.parent().is_some_and(|parent| !parent.is_dir()) {
                continue;
            }
            let mut bake = self.kiln("");
            let report = output_of(
                bake.env("KILN_CACHE", &cache).arg("bake").arg(&project).args(["--json", "-j", "1"]),
            )?;
            let work: f64 = report.lines().filter_map(|line| number(line, "\"wall_ms\": ").ok()).sum();
            let us = (number(&report, "\"run_ms\": ")? - work) * 1e3 / size.shaders as f64;
            println!(
                "overhead of an action that runs, cache {place}: {us:.0} µs; of it syncs of 3 files and their folders: {:.0} µs",
                3.0 * durable_write_us(&cache)?
            );
            std::fs::remove_dir_all(&cache).map_err(text)?;
        }
        Ok(())
    }
}

/// One file written as a store does, in microseconds: sync of the file and of its folder only.
fn durable_write_us(folder: &Path) -> Result<f64, String> {
    const COUNT: u32 = 100;
    let mut spent = Duration::ZERO;
    for index in 0..COUNT {
        let below = folder.join("probe").join((index % 16).to_string());
        std::fs::create_dir_all(&below).map_err(text)?;
        let path = below.join(index.to_string());
        std::fs::write(&path, [0; 500]).map_err(text)?;
        let start = Instant::now();
        std::fs::File::open(&path).and_then(|file| file.sync_data()).map_err(text)?;
        std::fs::File::open(&below).and_then(|folder| folder.sync_all()).map_err(text)?;
        spent += start.elapsed();
    }
    Ok(spent.as_secs_f64() * 1e6 / f64::from(COUNT))
}

fn write(project: &Path, name: &str, content: impl AsRef<[u8]>) -> Result<(), String> {
    let path = project.join(name);
    std::fs::create_dir_all(path.parent().unwrap_or(project)).map_err(text)?;
    std::fs::write(path, content).map_err(text)
}

/// Writes a project; returns how many sources it has.
fn generate(project: &Path, size: Size) -> Result<usize, String> {
    // Left over from an earlier bench, or not there.
    let _ = std::fs::remove_dir_all(project);
    let mut toml = String::from("version = 1\n");
    let mut files = 1;
    for index in 0..size.environments {
        write(project, &format!("env/e{index}.hdr"), panorama(index))?;
        toml += &format!("[env.e{index}]\nsource = \"env/e{index}.hdr\"\nsize = 16\nirradiance_size = 4\n");
        files += 1;
    }
    for index in 0..size.shaders {
        files += write_shader(project, index, size.modules, 0)?;
        toml += &format!("[shader.s{index}]\nsource = \"shaders/s{index}.wgsl\"\n");
    }
    for index in 0..size.scenes {
        write(project, &format!("scenes/c{index}.gltf"), scene(index))?;
        let (env, shader) = (index % size.environments.max(1), index % size.shaders.max(1));
        toml += &format!(
            "[scene.c{index}]\nsource = \"scenes/c{index}.gltf\"\nenv = \"e{env}\"\nshader = \"s{shader}\"\n"
        );
        files += 1;
    }
    if size.scenes > 0 {
        let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        write(
            project,
            "scenes/triangle.bin",
            corners.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>(),
        )?;
        files += 1;
    }
    write(project, "kiln.toml", toml)?;
    Ok(files)
}

/// A shader and the modules that it imports; `edit` is a constant in it. Returns how many files.
fn write_shader(project: &Path, index: usize, modules: usize, edit: usize) -> Result<usize, String> {
    let imports: String =
        (0..modules).map(|module| format!("import lib::m{index}_{module}::f{module};\n")).collect();
    let sum: String = (0..modules).map(|module| format!(" + f{module}()")).collect();
    let text = format!(
        "{imports}@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{ return vec4f(f32(i)); }}\n\
         @fragment fn fs_main() -> @location(0) vec4f {{ return vec4f({index}.0 + {edit}.0{sum}); }}\n"
    );
    write(project, &format!("shaders/s{index}.wgsl"), text)?;
    if edit == 0 {
        for module in 0..modules {
            let text = format!("fn f{module}() -> f32 {{ return {index}.0 + {module}.0; }}\n");
            write(project, &format!("shaders/lib/m{index}_{module}.wgsl"), text)?;
        }
    }
    Ok(1 + modules)
}

/// A Radiance file of 32 × 16 texels, without run lengths.
fn panorama(index: usize) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n".to_vec();
    for texel in 0..32 * 16_usize {
        let value = |step: usize| u8::try_from(128 + (texel * step + index) % 100).unwrap_or(128);
        bytes.extend([value(3), value(5), value(7), 128]);
    }
    bytes
}

fn scene(index: usize) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
"materials":[{{"name":"m{index}","pbrMetallicRoughness":{{"roughnessFactor":0.{index}5}}}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
"bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"uri":"triangle.bin","byteLength":36}}]}}"#
    )
}

/// Milliseconds that a process takes.
fn timed(command: &mut Command) -> Result<f64, String> {
    let start = Instant::now();
    let status = command.stderr(Stdio::null()).status().map_err(text)?;
    // A plan of a file that is no picture ends with 1, and has hashed it.
    if status.code().is_none_or(|code| code > 1) {
        Err(format!("{status}"))
    } else {
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }
}

/// Milliseconds that `stat` of every file below a folder takes, the listing not counted.
fn stat_all(project: &Path) -> Result<f64, String> {
    let mut files = Vec::new();
    let mut folders = vec![project.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).map_err(text)? {
            let path = entry.map_err(text)?.path();
            if path.is_dir() && !path.ends_with("baked") { folders.push(path) } else { files.push(path) }
        }
    }
    let start = Instant::now();
    for file in &files {
        std::hint::black_box(std::fs::metadata(file).map_err(text)?.len());
    }
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

fn published(lines: &Receiver<String>) -> Result<String, String> {
    loop {
        let line =
            lines.recv_timeout(Duration::from_secs(60)).map_err(|error| format!("not published: {error}"))?;
        if line.contains("\"event\":\"published\"") {
            return Ok(line);
        }
    }
}

/// The number behind the first `key` after `mark`.
fn number_after(text: &str, mark: &str, key: &str) -> Result<f64, String> {
    let (_, rest) = text.split_once(mark).ok_or(format!("no {mark}"))?;
    number(rest, key)
}
