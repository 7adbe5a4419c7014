//! Real processes killed at any moment, and real files spoilt: nothing wrong is ever served.
//!
//! `cargo xtask faults COUNT` runs the same with larger counts.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use kiln_build::Digest;
use serde_json::Value;

use crate::harness::{LIMIT, Process, Project, text};

/// How often each fault is injected: `KILN_FAULTS`, else a few times.
fn fault_count() -> usize {
    std::env::var("KILN_FAULTS").ok().and_then(|count| count.parse().ok()).unwrap_or(24)
}

/// Numbers that are the same in every run (xorshift64*).
struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) % limit
    }
}

/// A project that bakes in a few milliseconds; `variant` says what its sources are.
fn set_variant(project: &Project, variant: usize) {
    let size = if variant.is_multiple_of(2) { 16 } else { 8 };
    let toml = format!(
        "version = 1\n[env.sky]\nsource = \"environments/sky.hdr\"\nsize = {size}\nirradiance_size = 4\n\
         [shader.tonemap]\nsource = \"shaders/pbr/tonemap.wgsl\"\n[shader.background]\nsource = \"shaders/pbr/background.wgsl\"\n"
    );
    project.write("kiln.toml", toml);
    let shader = include_str!("../../shaders/pbr/tonemap.wgsl");
    let white = format!("vec3f(1.0, 1.0, {:.1})", 1.0 - (variant % 3) as f64 * 0.1);
    project.write("shaders/pbr/tonemap.wgsl", shader.replace("vec3f(1.0, 1.0, 1.0)", &white));
    let exposure = format!("EXPOSURE={}.0\nFORMAT=", 1 + variant % 5);
    let panorama = sky();
    let at = panorama.windows(7).position(|window| window == b"FORMAT=").unwrap();
    let panorama = [&panorama[..at], exposure.as_bytes(), &panorama[at + 7..]].concat();
    project.write("environments/sky.hdr", panorama);
}

fn sky() -> Vec<u8> {
    let texel = |index: usize| 0.25 + (index % 7) as f32 * 0.125;
    let image = kiln_image::Image::new(64, 32, (0..64 * 32 * 3).map(texel).collect()).unwrap();
    kiln_image::hdr::encode(&image)
}

const VARIANTS: usize = 30;

/// The manifests that undisturbed bakes write.
fn references() -> Vec<String> {
    let project = Project::sample();
    let manifest = |variant| {
        set_variant(&project, variant);
        let (code, report) = project.bake();
        assert_eq!(code, 0, "{:#}", report["diagnostics"]);
        project.read("baked/manifest.json")
    };
    (0..VARIANTS).map(manifest).collect()
}

/// Whether every file that the manifest names is there, whole. A file that is about to be replaced is not named.
fn outputs_are_whole(project: &Project) -> Result<(), String> {
    let Ok(manifest) = std::fs::read(project.path("baked/manifest.json")) else { return Ok(()) };
    let manifest: Value =
        serde_json::from_slice(&manifest).map_err(|error| format!("the manifest: {error}"))?;
    for target in manifest["targets"].as_object().ok_or("no targets")?.values() {
        for (path, file) in target["files"].as_object().ok_or("no files")? {
            let bytes = std::fs::read(project.path("baked").join(path))
                .map_err(|error| format!("{path}: {error}"))?;
            if file["sha256"] != Digest::of(&bytes).to_string() {
                return Err(format!("{path} is not what the manifest says"));
            }
        }
    }
    Ok(())
}

fn spawn(project: &Project, arguments: &[&str]) -> Process {
    let mut command = project.command(arguments);
    Process(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}

/// Waits for a moment within the process's life, then kills it; false if it was faster.
fn kill_after(child: &mut Child, moment: Duration) -> bool {
    let start = Instant::now();
    while start.elapsed() < moment {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    true
}

#[test]
fn processes_killed_at_random_moments_leave_nothing_wrong_or_half() {
    let references = references();
    let mut chance = Chance(0x6b69_6c6e);
    let projects = [Project::sample(), Project::sample()];
    // Both work on one cache.
    let shared = projects[0].beside("cache");
    projects.iter().for_each(|project| set_variant(project, 0));
    let start = Instant::now();
    assert_eq!(projects[0].bake().0, 0);
    let usual = start.elapsed().max(Duration::from_millis(20));
    let (mut kills, mut checks) = (0, 0);
    let mut variants = [0; 2];
    while kills < fault_count() {
        let victim = chance.below(2) as usize;
        let project = &projects[victim];
        variants[victim] = chance.below(VARIANTS as u64) as usize;
        set_variant(project, variants[victim]);
        let command = ["bake", "watch", "bake", "gc"][chance.below(4) as usize];
        let arguments: &[&str] = if command == "gc" { &["gc", "--max-size", "0"] } else { &[command, "DIR"] };
        let mut process = project.command(arguments);
        process.env("KILN_CACHE", &shared).stdout(Stdio::null()).stderr(Stdio::null());
        let mut process = Process(process.spawn().unwrap());
        let moment = usual.mul_f64(chance.below(1300) as f64 / 1000.0);
        kills += usize::from(kill_after(&mut process.0, moment));
        if let Err(wrong) = outputs_are_whole(project) {
            panic!("after {kills} kills, `{command}` killed at {moment:?}: {wrong}");
        }
        if kills % 8 == 0 {
            for (project, variant) in projects.iter().zip(variants) {
                let output = project.command(&["bake", "DIR"]).env("KILN_CACHE", &shared).output().unwrap();
                assert!(output.status.success(), "after {kills} kills: {}", text(&output.stderr));
                assert!(!text(&output.stderr).contains("damaged"), "{}", text(&output.stderr));
                let same = project.read("baked/manifest.json") == references[variant];
                assert!(same, "after {kills} kills variant {variant} came out otherwise");
                checks += 1;
            }
        }
    }
    eprintln!(
        "{kills} processes killed, {checks} bakes afterwards equal to undisturbed ones, 0 wrong or half files"
    );
}

#[test]
fn flipped_bit_in_any_cached_file_is_healed_by_the_next_bake() {
    let project = Project::sample();
    set_variant(&project, 0);
    assert_eq!(project.bake().0, 0);
    let reference = project.read("baked/manifest.json");
    let mut chance = Chance(7);
    let mut noticed = 0;
    for _ in 0..fault_count() {
        let mut files = Vec::new();
        let mut folders = vec![project.beside("cache")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.retain(|path| std::fs::metadata(path).unwrap().len() > 0);
        files.sort();
        let file = &files[chance.below(files.len() as u64) as usize];
        let mut bytes = std::fs::read(file).unwrap();
        let bit = chance.below(bytes.len() as u64 * 8) as usize;
        bytes[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(file, bytes).unwrap();
        // All is written again, so that every artefact is read.
        std::fs::remove_dir_all(project.path("baked")).unwrap();
        let (code, report) = project.bake();
        assert_eq!(code, 0, "{}: {:#}", file.display(), report["diagnostics"]);
        noticed += report["damaged"].as_u64().unwrap();
        assert_eq!(project.read("baked/manifest.json"), reference, "{}", file.display());
        outputs_are_whole(&project).unwrap();
    }
    eprintln!(
        "{} bits flipped, {noticed} found by reading, every bake equal to the undisturbed one",
        fault_count()
    );
    assert!(noticed > 0);
}

/// The failing twin of both: an output file that is not what the manifest says is seen.
#[test]
fn torn_output_is_seen_by_the_check() {
    let project = Project::sample();
    set_variant(&project, 0);
    project.bake();
    outputs_are_whole(&project).unwrap();
    let path = project.path("baked/env/sky/specular.ktx2");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(outputs_are_whole(&project).unwrap_err().contains("env/sky/specular.ktx2"));
}

#[test]
fn daemon_and_bakes_on_one_project_agree() {
    let references = references();
    let project = Project::sample();
    set_variant(&project, 0);
    let watch = project.watch();
    watch.published();
    for (variant, reference) in references.iter().enumerate().take(6).skip(1) {
        set_variant(&project, variant);
        let bakes = [spawn(&project, &["bake", "DIR"]), spawn(&project, &["bake", "DIR"])];
        for mut bake in bakes {
            assert!(bake.0.wait().unwrap().success());
        }
        // The daemon writes the same files; when it is done they are those of this variant.
        let deadline = Instant::now() + LIMIT;
        while project.read("baked/manifest.json") != *reference || outputs_are_whole(&project).is_err() {
            assert!(Instant::now() < deadline, "variant {variant} does not come");
            std::thread::yield_now();
        }
    }
    watch.interrupt();
}
