//! Environments that ask for a time: how good can they be within it on this machine?
//!
//! The source is decoded (which the bake that follows finds in the store), looked at once, and the work of each candidate
//! counted ([`kiln_bake::cost`]); a small bake of known work says how fast the machine is. The best candidate that fits is
//! written to `kiln.lock`, and everything after that, here and elsewhere, reads the choice there.

use std::sync::atomic::Ordering;
use std::time::Instant;

use kiln_bake::cost::{SpeedTest, WantedMap, Work};
use kiln_bake::{AnalysisRequest, Cancel, Lobe, TexelFormat, forecast};
use kiln_build::{Engine, Error, RunOptions};
use kiln_image::{Environment, Panorama};

use crate::blob::decode_environment;
use crate::env_config::{EnvConfig, format_name};
use crate::environment::{plan_decode, sheen_alpha};
use crate::lock::{Lock, LockedEnv, digests};
use crate::plan::{Planner, plan, read_project};
use crate::{EnvDemand, Plan};

/// What was chosen for an environment, and what it should take.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Name of the environment.
    pub env: String,
    /// Milliseconds asked for.
    pub time_ms: f64,
    /// Milliseconds expected.
    pub expected_ms: f64,
    /// What `kiln.lock` says now.
    pub locked: LockedEnv,
    /// Whether the best of what fits was taken, and not the least of what does not.
    pub fits: bool,
}

/// Candidates, the best first: edge of the first level and error.
const CANDIDATES: [(usize, f64); 10] = [
    (256, 1e-4),
    (256, 3e-4),
    (256, 1e-3),
    (256, 3e-3),
    (256, 1e-2),
    (128, 3e-3),
    (128, 1e-2),
    (64, 1e-2),
    (64, 3e-2),
    (64, 1e-1),
];
/// Errors below it are lost in halves and shared exponents, which round by 2e-4 and more.
const ERROR_MIN_PACKED: f64 = 3e-4;
/// What of a bake the cores share (`cargo xtask bench bake scaling`); the rest is one after the other.
const SHARED: f64 = 0.9;
/// Runs of the speed test: the fastest counts, since others were held up.
const SPEED_RUNS: usize = 3;

/// Chooses for each environment that asks for a time and has no choice in `kiln.lock` that still holds, and writes the file.
/// Environments whose source cannot be read are left open.
///
/// # Errors
/// The tool could not do its work, or `kiln.lock` cannot be written.
pub fn settle(engine: &Engine, options: &RunOptions) -> Result<Vec<Choice>, Error> {
    engine.begin_plan(None);
    if !read_project(engine, &mut Vec::new()).envs.values().any(|env| env.time_ms.is_some()) {
        return Ok(Vec::new());
    }
    let plan = plan(engine, None)?;
    if plan.open.is_empty() {
        return Ok(Vec::new());
    }
    let mut choices = Vec::new();
    let speed = Speed::measure(options)?;
    for name in &plan.open {
        if let Some(choice) = choose(engine, &plan, name, speed, options)? {
            choices.push(choice);
        }
    }
    if options.cancel.load(Ordering::SeqCst) || choices.is_empty() {
        return Ok(Vec::new());
    }
    let mut lock = Lock::read(engine, &mut Vec::new());
    // What nobody asks for any more goes.
    lock.env.retain(|name, _| plan.project.envs.get(name).is_some_and(|env| env.time_ms.is_some()));
    lock.env.extend(choices.iter().map(|choice| (choice.env.clone(), choice.locked.clone())));
    lock.write(engine)?;
    Ok(choices)
}

/// How fast the machine is.
#[derive(Clone, Copy)]
struct Speed {
    /// Milliseconds on one core for each of the reference machine's.
    factor: f64,
    threads: f64,
}

impl Speed {
    fn measure(options: &RunOptions) -> Result<Speed, Error> {
        let threads = options.jobs.max(1) as f64;
        let test = SpeedTest::new();
        let mut best_ms = f64::INFINITY;
        for _ in 0..SPEED_RUNS {
            let begun = Instant::now();
            if test.run(Cancel::when(options.cancel)).is_err() {
                break;
            }
            best_ms = best_ms.min(begun.elapsed().as_secs_f64() * 1e3);
        }
        let factor = best_ms / wall_ms(SpeedTest::REFERENCE_MS, threads);
        Ok(Speed { factor: if factor.is_finite() { factor } else { 1.0 }, threads })
    }

    fn ms(self, work: &Work) -> f64 {
        wall_ms(work.reference_ms(), self.threads) * self.factor
    }
}

/// What so many milliseconds of one core take.
fn wall_ms(core_ms: f64, threads: f64) -> f64 {
    core_ms * (1.0 - SHARED + SHARED / threads)
}

fn choose(
    engine: &Engine,
    plan: &Plan,
    name: &str,
    speed: Speed,
    options: &RunOptions,
) -> Result<Option<Choice>, Error> {
    let (env, demand) = (&plan.project.envs[name], &plan.envs[name]);
    let Some(time_ms) = env.time_ms else { return Ok(None) };
    let mut planner = Planner::default();
    let decode = plan_decode(&mut planner, engine, name, env);
    let report = engine.run(&planner.graph, options)?;
    let decoded = report.outcome(decode).output("environment").and_then(|it| engine.store().get(&it.digest));
    let Some(decoded) = decoded else { return Ok(None) };
    let cancel = Cancel::when(options.cancel);
    let panorama = match decode_environment(&decoded, cancel)? {
        Environment::Panorama(panorama) => panorama,
        Environment::Cube(cube) => match kiln_bake::panorama_of_cube(&cube, cancel) {
            Ok(panorama) => panorama,
            Err(_) => return Ok(None),
        },
    };
    let mut chosen = None;
    for candidate in candidates(env) {
        let Some(counted) = count(&panorama, &candidate, demand, cancel) else { return Ok(None) };
        let expected_ms = speed.ms(&counted.work);
        let fits = expected_ms <= time_ms;
        let locked = LockedEnv {
            source: digests(engine, env),
            time_ms,
            error: candidate.error,
            size: candidate.size,
            format: format_name(env.format).to_owned(),
            method: "convolution".to_owned(),
            band_limit: counted.band_limit,
            bright_texels: counted.bright_texels,
        };
        chosen = Some(Choice { env: name.to_owned(), time_ms, expected_ms, locked, fits });
        if fits {
            break;
        }
    }
    Ok(chosen)
}

/// The environment with each quality that it may have.
fn candidates(env: &EnvConfig) -> Vec<EnvConfig> {
    let is_packed = env.format != TexelFormat::Rgba32Float;
    let with = |&(size, error): &(usize, f64)| {
        let size = if env.is_size_open { size } else { env.size };
        EnvConfig { size, error, ..env.clone() }
    };
    let mut found: Vec<EnvConfig> = CANDIDATES.iter().map(with).collect();
    found.retain(|candidate| !is_packed || candidate.error >= ERROR_MIN_PACKED);
    found.sort_by(|a, b| b.size.cmp(&a.size).then(a.error.total_cmp(&b.error)));
    found.dedup_by(|a, b| (a.size, a.error) == (b.size, b.error));
    found
}

struct Counted {
    work: Work,
    band_limit: usize,
    bright_texels: usize,
}

/// The work of what is read of an environment; `None` if it was cancelled.
fn count(panorama: &Panorama, env: &EnvConfig, demand: &EnvDemand, cancel: Cancel) -> Option<Counted> {
    let ggx = |level: usize| {
        let roughness = env.roughness(level);
        let lobe = Lobe::Ggx { alpha: roughness * roughness };
        (roughness > 0.0).then_some(WantedMap { lobe, face_size: env.face_size(level) })
    };
    let charlie = |level: usize| {
        let lobe = Lobe::Charlie { alpha: sheen_alpha(env.roughness(level)) };
        WantedMap { lobe, face_size: env.face_size(level) }
    };
    let levels = |of: &[crate::Reasons]| {
        let read = EnvDemand::levels(of);
        read.start.min(env.level_count())..read.end.min(env.level_count())
    };
    let mut maps: Vec<WantedMap> = levels(&demand.specular).filter_map(ggx).collect();
    if !demand.light.is_empty() {
        maps.push(WantedMap { lobe: Lobe::Lambert, face_size: env.irradiance_size });
    }
    let sheen: Vec<WantedMap> = levels(&demand.sheen).map(charlie).collect();
    let least = (0..env.level_count()).map(|level| env.roughness(level)).find(|it| *it > 0.0).unwrap_or(1.0);
    let skybox = env.skybox_size.unwrap_or((panorama.width() / 4).next_power_of_two());
    // The first level of the chain is the environment itself, made apart where it is larger than the skybox.
    let mirror = if env.size > skybox { 6 * env.size * env.size } else { 0 };
    let skybox_texels = 8 * skybox * skybox + mirror;
    let size = (panorama.width(), panorama.height());
    let request = AnalysisRequest { alpha_min: least * least, sheen_alpha_min: None, error: env.error };
    let seen = forecast(panorama, &request, cancel).ok()?;
    let mut work = Work::of_maps(size, &seen, env.error, &maps, skybox_texels, cancel).ok()?;
    if !sheen.is_empty() {
        let alpha = Some(sheen_alpha(env.roughness(0)));
        let request = AnalysisRequest { alpha_min: 1.0, sheen_alpha_min: alpha, error: env.error };
        let seen = forecast(panorama, &request, cancel).ok()?;
        work = work.plus(Work::of_maps(size, &seen, env.error, &sheen, 0, cancel).ok()?);
    }
    Some(Counted { work, band_limit: seen.band_limit, bright_texels: seen.bright_texels })
}
