//! `cargo xtask bench`: the figures that README.md names, measured with the real program.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::shell::{cargo, kiln, output_of, root, step, target_dir};

const LIMIT: Duration = Duration::from_secs(60);
const SHADER: &str = "shaders/pbr/tonemap.wgsl";
const CONSTANT: &str = "const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);";
const NO_OP_RUNS: usize = 20;
const BAKE_RUNS: usize = 5;
/// A file that is younger than this may be hashed again.
pub(crate) const SETTLING: Duration = Duration::from_secs(3);

/// Prints p50 and p95 of save-to-frame, the no-op bake and the bake of one panorama.
pub(crate) fn run(edits: usize) -> Result<(), String> {
    step("build", &mut cargo(&["build", "--release"]))?;
    let bench = Bench::new("bench")?;
    println!("\n{} cores; every figure is wall-clock time on this machine as busy as it is now", cores());
    bench.one_panorama()?;
    bench.no_op()?;
    bench.edits(edits)
}

pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A folder of its own for what a bench makes.
pub(crate) struct Bench {
    pub(crate) folder: PathBuf,
}

/// A process that ends with this value.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Bench {
    pub(crate) fn new(name: &str) -> Result<Bench, String> {
        let folder = target_dir().join(name);
        // Left over from an earlier bench, or not there.
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("runtime")).map_err(|error| error.to_string())?;
        Ok(Bench { folder })
    }

    pub(crate) fn kiln(&self, cache: &str) -> Command {
        let mut command = Command::new(kiln());
        command
            .env("KILN_CACHE", self.folder.join(cache))
            .env("XDG_RUNTIME_DIR", self.folder.join("runtime"));
        command
    }

    pub(crate) fn init(&self, name: &str, width: &str) -> Result<PathBuf, String> {
        let project = self.folder.join(name);
        output_of(self.kiln("cache").arg("init").arg(&project).args(["--panorama-width", width]))?;
        Ok(project)
    }

    /// One 1024×512 panorama: skybox, irradiance 64, GGX chain from 256, SH, table; each run with an empty cache.
    fn one_panorama(&self) -> Result<(), String> {
        let project = self.init("one", "1024")?;
        let toml = "version = 1\n[env.sky]\nsource = \"environments/sky.hdr\"\n";
        std::fs::write(project.join("kiln.toml"), toml).map_err(|error| error.to_string())?;
        let mut times = Vec::new();
        for run in 0..BAKE_RUNS {
            let start = Instant::now();
            output_of(self.kiln(&format!("cache-{run}")).arg("bake").arg(&project))?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        print_times("kiln bake, one 1024×512 panorama, empty cache", &mut times);
        println!("{}", output_of(self.kiln("cache-timings").arg("bake").arg(&project).arg("--timings"))?);
        Ok(())
    }

    fn no_op(&self) -> Result<(), String> {
        let project = self.init("sample", "2048")?;
        output_of(self.kiln("cache").arg("bake").arg(&project))?;
        // Until its files have settled, a bake hashes them again.
        let start = Instant::now();
        while start.elapsed() < SETTLING {
            output_of(self.kiln("cache").arg("bake").arg(&project))?;
        }
        let mut times = Vec::new();
        for _ in 0..NO_OP_RUNS {
            let start = Instant::now();
            output_of(self.kiln("cache").arg("bake").arg(&project))?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        print_times("kiln bake of the sample, nothing changed", &mut times);
        Ok(())
    }

    /// Edits files under a running daemon and a headless preview at 640×360.
    fn edits(&self, count: usize) -> Result<(), String> {
        let project = self.init("edits", "1024")?;
        let mut daemon = self.kiln("cache");
        let daemon = daemon.arg("watch").arg(&project).args(["--json", "--no-output"]).stdout(Stdio::piped());
        let mut daemon = daemon.spawn().map_err(text)?;
        let lines = lines_of(&mut daemon)?;
        let _daemon = Running(daemon);
        let mut preview = self.kiln("cache");
        let preview = preview.arg("preview").arg(&project).args([
            "--headless",
            "--follow",
            "--size",
            "640x360",
            "--out",
        ]);
        let preview = preview.arg(self.folder.join("frames")).stdout(Stdio::null()).stderr(Stdio::null());
        let _preview = Running(preview.spawn().map_err(text)?);
        wait_for_frame(&lines)?;

        let shader = std::fs::read_to_string(project.join(SHADER)).map_err(text)?;
        let edited = |index: usize| {
            let constant =
                format!("const WHITE_BALANCE = vec3f(1.0, 1.0, {:.4});", 0.9 - index as f64 * 1e-3);
            shader.replace(CONSTANT, &constant).into_bytes()
        };
        self.measure("shader save → frame, 640×360", &project.join(SHADER), count, &lines, &edited)?;

        let skies = self.skies()?;
        // One byte of the header's comment differs each time, so that no result is in the cache.
        let edited = |index: usize| with_comment(&skies[index % 2], index);
        let sky = project.join("environments/sky.hdr");
        self.measure(
            "HDR save (1024×512, new texels each time) → frame, 640×360",
            &sky,
            count,
            &lines,
            &edited,
        )
    }

    /// Two panorama files of 1024×512 that differ in where the sun stands.
    pub(crate) fn skies(&self) -> Result<[Vec<u8>; 2], String> {
        let skies = [20.0, 50.0].map(|elevation: f64| {
            let other = self.folder.join(format!("sky-{elevation}"));
            let elevation = elevation.to_string();
            let mut init = self.kiln("cache");
            init.arg("init").arg(&other).args(["--panorama-width", "1024", "--sun-elevation", &elevation]);
            output_of(&mut init).and_then(|_| std::fs::read(other.join("environments/sky.hdr")).map_err(text))
        });
        let [low, high] = skies;
        Ok([low?, high?])
    }

    fn measure(
        &self,
        what: &str,
        file: &Path,
        count: usize,
        lines: &Receiver<String>,
        edited: &dyn Fn(usize) -> Vec<u8>,
    ) -> Result<(), String> {
        let mut times = Vec::new();
        for index in 0..count {
            let content = edited(index);
            let saved = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3;
            std::fs::write(file, content).map_err(|error| error.to_string())?;
            times.push(wait_for_frame(lines)? - saved);
        }
        print_times(what, &mut times);
        Ok(())
    }
}

/// An .hdr with another last texel: its mantissa and the comment line change with `index`.
pub(crate) fn with_comment(hdr: &[u8], index: usize) -> Vec<u8> {
    let mut bytes = hdr.to_vec();
    // The file ends with the exponent run of the last row, encoded as runs: `index` goes into the EXPOSURE line,
    // which scales all texels and so changes every map.
    let line = format!("EXPOSURE={}\n", 1.0 + index as f64 * 1e-3);
    if let Some(at) = bytes.windows(7).position(|window| window == b"FORMAT=") {
        bytes.splice(at..at, line.into_bytes());
    }
    bytes
}

pub(crate) fn lines_of(child: &mut Child) -> Result<Receiver<String>, String> {
    let output = child.stdout.take().ok_or("the daemon has no output")?;
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    Ok(lines)
}

/// Unix time in milliseconds at which the preview had drawn the next frame.
fn wait_for_frame(lines: &Receiver<String>) -> Result<f64, String> {
    let deadline = Instant::now() + LIMIT;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let line = lines.recv_timeout(left).map_err(|error| format!("no frame: {error}"))?;
        if line.contains("\"event\":\"frame\"") {
            let number =
                line.split("\"drawn_unix_ms\":").nth(1).and_then(|rest| rest.split([',', '}']).next());
            return number.and_then(|number| number.parse().ok()).ok_or(format!("no time in {line}"));
        }
    }
}

pub(crate) fn text(error: std::io::Error) -> String {
    error.to_string()
}

/// The number behind the first `key`.
pub(crate) fn number(text: &str, key: &str) -> Result<f64, String> {
    let (_, rest) = text.split_once(key).ok_or(format!("no {key}"))?;
    let end = rest.find(|character: char| !"0123456789.eE+-".contains(character)).unwrap_or(rest.len());
    rest[..end].parse().map_err(|error| format!("{key}: {error}"))
}

pub(crate) fn print_times(what: &str, times: &mut [f64]) {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
    println!("{what}: p50 {:.1} ms, p95 {:.1} ms, n = {}", at(0.5), at(0.95), times.len());
}

/// Builds with and without the preview, each in a folder of its own, and compares cost and size.
pub(crate) fn size() -> Result<(), String> {
    for (name, arguments) in [("without", vec!["--no-default-features"]), ("with", vec![])] {
        let target = root().join("target").join(format!("size-{name}"));
        // Left over from an earlier run, or not there.
        let _ = std::fs::remove_dir_all(&target);
        let (start, cpu_before) = (Instant::now(), children_cpu_seconds());
        let mut build = cargo(&["build", "--release", "--package", "kiln", "--quiet"]);
        let status = build.args(arguments).env("CARGO_TARGET_DIR", &target).status();
        if !status.map_err(|error| error.to_string())?.success() {
            return Err(format!("the build {name} the preview failed"));
        }
        let seconds = start.elapsed().as_secs_f64();
        let cpu = match (cpu_before, children_cpu_seconds()) {
            (Some(before), Some(after)) => format!("{:.0} CPU-seconds, ", after - before),
            _ => String::new(),
        };
        let binary = std::fs::metadata(target.join("release/kiln")).map_err(|error| error.to_string())?;
        let size = binary.len() as f64 / 1048576.0;
        println!(
            "{name} the preview: clean build {cpu}{seconds:.0} s on {} cores, binary {size:.1} MiB",
            cores()
        );
    }
    Ok(())
}

/// CPU time of all children that have ended, on Linux: a busy machine distorts it less than wall-clock time.
pub(crate) fn children_cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The fields after the program's name in parentheses; proc(5) counts them from 3, and cutime and cstime are 16 and 17.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(13);
    let ticks: f64 = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    // User-space clock ticks have been 100 a second on every Linux.
    Some(ticks / 100.0)
}
