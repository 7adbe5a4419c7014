//! `cargo xtask bench loop`: where the time between a save and its picture goes, stage by stage.

use std::path::Path;
use std::process::Stdio;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::bench::{Bench, Running, cores, lines_of, number, text};
use crate::shell::{cargo, step};

const LIMIT: Duration = Duration::from_secs(60);
const SHADER: &str = "shaders/pbr/tonemap.wgsl";
const CONSTANT: &str = "const WHITE_BALANCE = vec3f(1.0, 1.0, 1.0);";

/// Stages of an edit, as its events tell them.
const STAGES: [&str; 11] = [
    "save → noticed",
    "noticed → planned",
    "planned → built",
    "built → published",
    "published → received",
    "received → pipelines and uploads ready",
    "ready → drawn",
    "save → ready, without the first action's own time (compiling, decoding)",
    "save → first maps published, without decoding",
    "save → all published",
    "save → drawn",
];

/// Prints percentiles of every stage, for shaders and for panoramas, `count` edits each.
pub(crate) fn run(count: usize) -> Result<(), String> {
    step("build", &mut cargo(&["build", "--release"]))?;
    println!("\n{} cores; every figure is wall-clock time on this machine as busy as it is now", cores());
    let bench = Bench::new("bench-loop")?;
    let project = bench.init("project", "1024")?;
    let mut daemon = bench.kiln("cache");
    daemon.arg("watch").arg(&project).args(["--json", "--no-output"]).stdout(Stdio::piped());
    let mut daemon = daemon.spawn().map_err(text)?;
    let lines = lines_of(&mut daemon)?;
    let _daemon = Running(daemon);
    let mut preview = bench.kiln("cache");
    preview.arg("preview").arg(&project).args(["--headless", "--follow", "--size", "64x36", "--out"]);
    let preview =
        preview.arg(bench.folder.join("frames")).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let mut preview = preview.map_err(text)?;
    let pictures = lines_of(&mut preview)?;
    let _preview = Running(preview);
    let talk = Talk { lines, pictures };
    talk.wait_for_frame()?;
    let shader = std::fs::read_to_string(project.join(SHADER)).map_err(text)?;
    let edited = |index: usize| {
        let constant = format!("const WHITE_BALANCE = vec3f(1.0, 1.0, {:.6});", 0.9 - index as f64 * 1e-5);
        shader.replace(CONSTANT, &constant).into_bytes()
    };
    measure("shader", &project.join(SHADER), count, &talk, &edited)?;
    let skies = bench.skies()?;
    let edited = |index: usize| crate::bench::with_comment(&skies[index % 2], index);
    measure("panorama 1024×512", &project.join("environments/sky.hdr"), count, &talk, &edited)
}

fn measure(
    what: &str,
    file: &Path,
    count: usize,
    talk: &Talk,
    edited: &dyn Fn(usize) -> Vec<u8>,
) -> Result<(), String> {
    let mut stages: Vec<Vec<f64>> = vec![Vec::new(); STAGES.len()];
    for index in 0..count {
        let content = edited(index);
        let saved = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3;
        std::fs::write(file, content).map_err(text)?;
        let Edit { first_ms, published, frame } = talk.wait_for_frame()?;
        let of_work = |key: &str| number(&published, &format!("\"{key}\":"));
        let of_frame = |key: &str| number(&frame, &format!("\"{key}\":"));
        let (noticed, plan, run) = (of_work("noticed_unix_ms")?, of_work("plan_ms")?, of_work("run_ms")?);
        let at = of_work("published_unix_ms")?;
        let [received, ready, drawn] = ["received_unix_ms", "ready_unix_ms", "drawn_unix_ms"]
            .map(|key| of_frame(key).unwrap_or(f64::NAN));
        let times = [
            noticed - saved,
            plan,
            run,
            at - noticed - plan - run,
            received - at,
            ready - received,
            drawn - ready,
            ready - saved - of_work("wall_ms").unwrap_or(0.0),
            first_ms - saved - of_work("wall_ms").unwrap_or(0.0),
            at - saved,
            drawn - saved,
        ];
        stages.iter_mut().zip(times).for_each(|(stage, time)| stage.push(time));
    }
    println!("\n{what}, n = {count}");
    for (name, times) in STAGES.iter().zip(&mut stages) {
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
        println!("  {name}: p50 {:.1} ms, p95 {:.1} ms, p99 {:.1} ms", at(0.5), at(0.95), at(0.99));
    }
    Ok(())
}

/// What came of an edit.
struct Edit {
    /// When the first revision of it was published, Unix time in milliseconds: what is shown comes before the rest.
    first_ms: f64,
    /// The line about the whole revision.
    published: String,
    /// The line about the first frame of it.
    frame: String,
}

/// What the daemon and the preview say.
struct Talk {
    lines: Receiver<String>,
    pictures: Receiver<String>,
}

impl Talk {
    /// The next whole revision that was published, and the first frame of it. Returns when the preview is idle again: an edit does not
    /// wait for the picture of the one before.
    fn wait_for_frame(&self) -> Result<Edit, String> {
        let deadline = Instant::now() + LIMIT;
        let (mut published, mut first_ms) = (None, None);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let line = self.lines.recv_timeout(left).map_err(|error| format!("no frame: {error}"))?;
            if line.contains("\"event\":\"published\"") {
                first_ms.get_or_insert(number(&line, "\"published_unix_ms\":")?);
                published = line.contains("\"building\":[]").then_some(line);
            } else if line.contains("\"event\":\"frame\"")
                && let Some(published) = &published
                && number(&line, "\"revision\":")? >= number(published, "\"revision\":")?
            {
                let picture = format!("revision_{:04}.png", number(&line, "\"revision\":")?);
                self.wait_for_picture(&picture, deadline)?;
                let first_ms = first_ms.unwrap_or(f64::NAN);
                return Ok(Edit { first_ms, published: published.clone(), frame: line });
            }
        }
    }

    fn wait_for_picture(&self, name: &str, deadline: Instant) -> Result<(), String> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let line = self.pictures.recv_timeout(left).map_err(|error| format!("no {name}: {error}"))?;
            if line.ends_with(name) {
                return Ok(());
            }
        }
    }
}
