//! `cargo xtask bench shaders`: how soon a mistake in a shader is said, what a variant costs, and what an edit runs.
//!
//! Start at [`run`]. Everything is measured with the real program and its real processes, in projects of the bench's own.
//! A figure that misses its target is marked MISSED, and the command then fails.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::bench::{Bench, Running, cores, lines_of, number, print_times, text};
use crate::shader_files;
use crate::shell::{cargo, output_of, step};

/// Edits that break the long shader; each is mended again.
const EDITS: usize = 30;
const DIAGNOSTIC_MS_MAX: f64 = 20.0;
/// Lines that the long shader has at least, all its modules together.
const LINES_MIN: usize = 1000;
const VARIANTS: usize = 1000;
/// Variants that get a process of their own; the rate of all is taken to be theirs.
const OWN_PROCESSES: usize = 50;
const RATIO_MIN: f64 = 5.0;

/// Counts figures that miss their targets.
#[derive(Default)]
pub(crate) struct Verdict {
    missed: usize,
}

impl Verdict {
    /// Prints a target and whether it is met.
    pub(crate) fn judge(&mut self, target: &str, is_met: bool) {
        self.missed += usize::from(!is_met);
        println!("  target: {target}: {}", if is_met { "ok" } else { "MISSED" });
    }
}

/// Runs all parts.
pub(crate) fn run() -> Result<(), String> {
    step("build", &mut cargo(&["build", "--release"]))?;
    let bench = Bench::new("bench-shaders")?;
    println!("\n{} cores; wall-clock times of real processes on this machine as busy as it is now", cores());
    let mut verdict = Verdict::default();
    bench.first_diagnostic(&mut verdict)?;
    bench.variants(&mut verdict)?;
    bench.what_an_edit_runs(&mut verdict)?;
    shader_files::run(&bench, &mut verdict)?;
    match verdict.missed {
        0 => {
            println!("\nall targets met");
            Ok(())
        }
        missed => Err(format!("{missed} targets MISSED")),
    }
}

/// The module that is broken, and where.
const BROKEN_MODULE: &str = "shaders/lib/brdf.wgsl";
const SOUND: &str = "return 0.5 / max(light + view, GRAZING_MIN);";

impl Bench {
    /// A project of the shipped shaders and nothing to bake but them.
    pub(crate) fn shader_project(&self, name: &str, toml: &str) -> Result<PathBuf, String> {
        let project = self.init(name, "64")?;
        std::fs::write(project.join("kiln.toml"), format!("version = 1\n{toml}")).map_err(text)?;
        Ok(project)
    }

    /// Breaks and mends one module of a long shader under a running daemon.
    fn first_diagnostic(&self, verdict: &mut Verdict) -> Result<(), String> {
        let toml = "[shader.long]\nsource = \"shaders/pbr/long.wgsl\"\n";
        let project = self.shader_project("long", toml)?;
        let (lines_of_text, modules) = write_long_shader(self, &project)?;
        println!("\nsave → first diagnostic: a PBR shader of {lines_of_text} lines in {modules} modules");
        let mut daemon = self.kiln("cache");
        let daemon = daemon.arg("watch").arg(&project).args(["--json", "--no-output"]).stdout(Stdio::piped());
        let mut daemon = daemon.spawn().map_err(text)?;
        let lines = lines_of(&mut daemon)?;
        let _daemon = Running(daemon);
        let first = published(&lines)?;
        if first.line.contains(ERROR) {
            return Err(format!("the long shader is broken from the start: {}", first.line));
        }
        let path = project.join(BROKEN_MODULE);
        let sound = std::fs::read_to_string(&path).map_err(text)?;
        let (mut broken_ms, mut mended_ms, mut shares) = (Vec::new(), Vec::new(), Shares::default());
        for edit in 0..EDITS {
            // No two edits are alike, so none is answered from the cache.
            let broken =
                sound.replace(SOUND, &format!("return 0.5 / max(light + oops_{edit}, GRAZING_MIN);"));
            let (saved, saved_unix_ms) = save(&path, &broken)?;
            let answer = published(&lines)?;
            if !(answer.line.contains(ERROR) && answer.line.contains(&format!("oops_{edit}"))) {
                return Err(format!("no diagnostic of edit {edit}: {}", answer.line));
            }
            broken_ms.push(ms(answer.at - saved));
            shares.add(&answer, saved_unix_ms)?;
            let (saved, _) = save(
                &path,
                &sound.replace(SOUND, &format!("return 0.5{edit:04} / max(light + view, GRAZING_MIN);")),
            )?;
            let answer = published(&lines)?;
            if answer.line.contains(ERROR) {
                return Err(format!("edit {edit} is not mended: {}", answer.line));
            }
            mended_ms.push(ms(answer.at - saved));
        }
        print_times("  broken: write returned → JSON line with the diagnostic", &mut broken_ms);
        shares.print();
        print_times("  mended: write returned → JSON line without diagnostics", &mut mended_ms);
        let median = broken_ms[broken_ms.len() / 2];
        verdict.judge(
            &format!("median of the first diagnostic {median:.1} ms ≤ {DIAGNOSTIC_MS_MAX} ms, {lines_of_text} ≥ {LINES_MIN} lines"),
            median <= DIAGNOSTIC_MS_MAX && lines_of_text >= LINES_MIN,
        );
        Ok(())
    }

    /// Many variants in one process, beside a process for each.
    fn variants(&self, verdict: &mut Verdict) -> Result<(), String> {
        let project = self.shader_project("variants", "[shader.pbr]\nsource = \"shaders/pbr/pbr.wgsl\"\n")?;
        let shader = project.join("shaders/pbr/pbr.wgsl");
        let features = features_of(self, &shader)?;
        let names: Vec<String> = (1..=VARIANTS).map(|bits| variant(&features, bits)).collect();
        let check = |names: &[String]| -> Result<(usize, f64), String> {
            let mut command = self.kiln("cache");
            command.args(["shader", "check", "--json"]).arg(&shader);
            names.iter().for_each(|name| _ = command.args(["-v", name]));
            let start = Instant::now();
            let report = output_of(&mut command)?;
            Ok((report.matches("\"ok\": true").count() - 1, start.elapsed().as_secs_f64()))
        };
        println!("\n{VARIANTS} of the 2^{} variants of pbr.wgsl", features.len());
        let (compiled, together_s) = check(&names)?;
        let together = compiled as f64 / together_s;
        println!(
            "  one process, a worker for each CPU: {compiled} compiled in {together_s:.2} s, {together:.0} a second"
        );
        let mut times = Vec::new();
        for name in names.iter().step_by(VARIANTS / OWN_PROCESSES) {
            times.push(check(std::slice::from_ref(name))?.1 * 1e3);
        }
        let apart = times.len() as f64 / (times.iter().sum::<f64>() / 1e3);
        print_times("  a process of its own, one after the other", &mut times);
        println!(
            "  a process each: {apart:.0} a second, measured on every {}th variant and taken to hold for all",
            VARIANTS / OWN_PROCESSES
        );
        verdict.judge(
            &format!(
                "{compiled} variants at {:.1} ≥ {RATIO_MIN} times the rate of a process each",
                together / apart
            ),
            together / apart >= RATIO_MIN,
        );
        Ok(())
    }

    /// Edits that change nothing compile the shaders that include the module, and nothing else.
    fn what_an_edit_runs(&self, verdict: &mut Verdict) -> Result<(), String> {
        let shaders = ["pbr", "background", "tonemap"];
        let mut toml: String = shaders
            .iter()
            .map(|name| format!("[shader.{name}]\nsource = \"shaders/pbr/{name}.wgsl\"\n"))
            .collect();
        toml += "[env.sky]\nsource = \"environments/sky.hdr\"\nsize = 16\nirradiance_size = 4\n";
        toml += "[scene.balls]\nsource = \"scenes/material_balls.gltf\"\nenv = \"sky\"\nshader = \"pbr\"\n";
        let project = self.shader_project("edits", &toml)?;
        let bake = || output_of(self.kiln("cache").arg("bake").arg(&project).arg("--json"));
        let first = bake()?;
        println!(
            "\nwhat an edit runs: {} actions, {} shaders, a scene and an environment",
            actions(&first).count(),
            shaders.len()
        );
        let mut before = first;
        for (what, module, from, to, is_same) in [
            (
                "a comment",
                BROKEN_MODULE,
                SOUND,
                "// A comment.\n    return 0.5 / max(light + view, GRAZING_MIN);",
                true,
            ),
            (
                "a renamed local",
                BROKEN_MODULE,
                "let ratio = a / max(a * a * n_dot_h * n_dot_h + n_cross_h_squared, ALPHA_MIN * ALPHA_MIN);\n    return ratio * ratio / PI;",
                "let quotient = a / max(a * a * n_dot_h * n_dot_h + n_cross_h_squared, ALPHA_MIN * ALPHA_MIN);\n    return quotient * quotient / PI;",
                true,
            ),
            ("a comment", "shaders/lib/frame.wgsl", "struct ", "// A comment.\nstruct ", true),
            // The twin that shows that a change would be seen.
            (
                "another white balance",
                "shaders/pbr/tonemap.wgsl",
                "vec3f(1.0, 1.0, 1.0)",
                "vec3f(1.0, 1.0, 0.5)",
                false,
            ),
        ] {
            edit(&project.join(module), from, to)?;
            let mut including = BTreeSet::new();
            for name in shaders {
                let files = files_of(self, &project.join(format!("shaders/pbr/{name}.wgsl")))?;
                including.extend(files.iter().any(|file| file == module).then_some(name));
            }
            let expected: BTreeSet<String> = actions(&before)
                .map(|(name, _)| name)
                .filter(|action| {
                    including.iter().any(|name| action.starts_with(&format!("compile shader/{name}/")))
                })
                .map(str::to_owned)
                .collect();
            let after = bake()?;
            let ran: BTreeSet<String> = actions(&after)
                .filter(|(_, status)| *status == "ran")
                .map(|(name, _)| name.to_owned())
                .collect();
            println!("  {what} in {module}, which {including:?} include: ran {} compile actions", ran.len());
            let is_only_compiled = !expected.is_empty() && ran == expected;
            let same = if is_same { "the same" } else { "other" };
            verdict.judge(
                &format!("exactly those ran, and the published digests are {same}"),
                is_only_compiled && (targets(&before) == targets(&after)) == is_same,
            );
            before = after;
        }
        Ok(())
    }
}

/// How a diagnostic that counts looks in a line of `kiln watch --json`.
const ERROR: &str = "\"severity\":\"error\"";

/// What the daemon published.
struct Answer {
    line: String,
    at: Instant,
    unix_ms: f64,
}

fn published(lines: &Receiver<String>) -> Result<Answer, String> {
    loop {
        let line =
            lines.recv_timeout(Duration::from_secs(60)).map_err(|error| format!("not published: {error}"))?;
        if line.contains("\"event\":\"published\"") {
            return Ok(Answer { line, at: Instant::now(), unix_ms: unix_ms() });
        }
    }
}

fn save(path: &Path, content: &str) -> Result<(Instant, f64), String> {
    std::fs::write(path, content).map_err(text)?;
    Ok((Instant::now(), unix_ms()))
}

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

/// Where the time between a save and its diagnostic goes, by the daemon's own account.
#[derive(Default)]
struct Shares {
    noticed: Vec<f64>,
    plan: Vec<f64>,
    compile: Vec<f64>,
    run_beyond: Vec<f64>,
    waiting: Vec<f64>,
    line: Vec<f64>,
}

impl Shares {
    fn add(&mut self, answer: &Answer, saved_unix_ms: f64) -> Result<(), String> {
        let of = |key: &str| number(&answer.line, &format!("\"{key}\":"));
        let (noticed, published) = (of("noticed_unix_ms")?, of("published_unix_ms")?);
        let (plan, run, compile) = (of("plan_ms")?, of("run_ms")?, of("wall_ms")?);
        self.noticed.push(noticed - saved_unix_ms);
        self.plan.push(plan);
        self.compile.push(compile);
        self.run_beyond.push(run - compile);
        self.waiting.push(published - noticed - plan - run);
        self.line.push(answer.unix_ms - published);
        Ok(())
    }

    fn print(&mut self) {
        print_times("    of it until the daemon notices", &mut self.noticed);
        print_times("    of it quiet time (until no more files change) and publishing", &mut self.waiting);
        print_times("    of it planning", &mut self.plan);
        print_times("    of it compiling, in the worker", &mut self.compile);
        print_times("    of it running beyond that: hashes, records", &mut self.run_beyond);
        print_times("    of it until the line is read", &mut self.line);
    }
}

/// `pbr.wgsl` with an entry point that calls into more of the shipped libraries, which makes it long enough; returns how
/// many lines and modules that is.
fn write_long_shader(bench: &Bench, project: &Path) -> Result<(usize, usize), String> {
    let root = project.join("shaders/pbr/long.wgsl");
    let shader = std::fs::read_to_string(project.join("shaders/pbr/pbr.wgsl")).map_err(text)?;
    let more = "import lib::iridescence::ior_of_f0;\nimport lib::sampling::pdf_ggx;\nimport lib::sphere::octahedral_direction;\n";
    let entry = "@fragment fn fs_more(@location(0) uv: vec2f) -> @location(0) vec4f {\n    \
                 return vec4f(ior_of_f0(octahedral_direction(uv)), pdf_ggx(uv.x, uv.y, 0.5));\n}\n";
    std::fs::write(&root, format!("{more}{shader}\n{entry}")).map_err(text)?;
    let files = files_of(bench, &root)?;
    let count = |file: &String| std::fs::read_to_string(project.join(file)).map(|text| text.lines().count());
    Ok((files.iter().map(count).sum::<Result<usize, _>>().map_err(text)?, files.len()))
}

/// The files that a shader is made of, as its reflection says.
fn files_of(bench: &Bench, shader: &Path) -> Result<Vec<String>, String> {
    let mut reflect = bench.kiln("cache");
    let report = output_of(reflect.args(["shader", "reflect", "--json", "-v", "base"]).arg(shader))?;
    texts(&report, "\"files\": [").ok_or(format!("no files in {report}"))
}

/// The strings of the first list behind `key`.
fn texts(report: &str, key: &str) -> Option<Vec<String>> {
    let list = report.split_once(key)?.1.split(']').next()?;
    Some(list.split('"').skip(1).step_by(2).map(str::to_owned).collect())
}

fn edit(path: &Path, from: &str, to: &str) -> Result<(), String> {
    let before = std::fs::read_to_string(path).map_err(text)?;
    match before.replacen(from, to, 1) {
        after if after == before => Err(format!("{} does not hold {from:?}", path.display())),
        after => std::fs::write(path, after).map_err(text),
    }
}

/// Names and states of the actions in a report of `kiln bake --json`.
fn actions(report: &str) -> impl Iterator<Item = (&str, &str)> {
    let value = |line: &'_ str, key: &str| -> Option<(usize, usize)> {
        let rest = line.trim_start().strip_prefix(key)?;
        let start = line.len() - rest.len();
        Some((start, start + rest.find('"')?))
    };
    let mut name = "";
    report.lines().filter_map(move |line| {
        if let Some((start, end)) = value(line, "\"name\": \"") {
            name = &line[start..end];
        }
        let (start, end) = value(line, "\"status\": \"")?;
        Some((name, &line[start..end]))
    })
}

/// The part of a report that names what is published, with digests.
fn targets(report: &str) -> &str {
    let rest = report.split_once("\"targets\": {").map_or("", |(_, rest)| rest);
    rest.split_once("\"written\"").map_or(rest, |(targets, _)| targets)
}

/// Features that a shader's conditions name.
fn features_of(bench: &Bench, shader: &Path) -> Result<Vec<String>, String> {
    let report =
        output_of(bench.kiln("cache").args(["shader", "variants", "--json", "-v", "base"]).arg(shader))?;
    texts(&report, "\"features\": [").ok_or(format!("no features in {report}"))
}

/// The set of features that a number's bits pick.
fn variant(features: &[String], bits: usize) -> String {
    let picked = features.iter().enumerate().filter(|(index, _)| bits >> index & 1 == 1);
    picked.map(|(_, feature)| feature.as_str()).collect::<Vec<_>>().join("+")
}
