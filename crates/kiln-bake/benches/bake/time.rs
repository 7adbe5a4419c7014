//! What a bake takes, warm: the figures README.md names, and how they grow.

use crate::Verdict;
use crate::accuracy::WANTED;
use crate::clock::{Times, Took, once, repeat, summary, threads_cpu_s};
use crate::panoramas::{resized, studio};
use kiln_bake::{Analysis, AnalysisRequest, Cancel, Lobe, analyse, irradiance, sh, skybox, specular_level};
use kiln_image::Panorama;
use kiln_sphere::simd::{self, Instructions};
use rayon::prelude::*;

const NEVER: Cancel = Cancel::NEVER;
const RUNS: usize = 7;
const IRRADIANCE_SIZE: usize = 64;
const SH_ORDER: usize = 2;
/// Band limit at which analysis is compared over sizes.
const FIXED_LIMIT: usize = 255;
/// How much more a texel of a larger panorama may take: its row's FFT has one more stage.
const LINEAR_MAX: f64 = 1.25;
const SPEED_UP_MIN: f64 = 1.7;
const VECTOR_LIMIT: usize = 1023;

/// What is baked.
#[derive(Clone, Copy)]
struct Job {
    /// Of the skybox, mip 0 of the chain.
    face_size: usize,
    /// Mips of the chain.
    level_count: usize,
    error: f64,
}

impl Job {
    fn alpha(&self, level: usize) -> f64 {
        (level as f64 / (self.level_count - 1) as f64).powi(2)
    }

    fn analyse(&self, panorama: &Panorama) -> Analysis {
        let request = AnalysisRequest { alpha_min: self.alpha(1), sheen_alpha_min: None, error: self.error };
        analyse(panorama, &request, NEVER).expect(WANTED)
    }

    /// GGX mips beyond the skybox; the degrees each took.
    fn specular(&self, analysis: &Analysis) -> Vec<usize> {
        let level = |level| {
            let map = specular_level(analysis, self.alpha(level), self.face_size >> level, NEVER);
            map.expect(WANTED).accuracy.band_limit
        };
        (1..self.level_count).into_par_iter().map(level).collect()
    }

    /// Everything, as a build runs it: maps that do not need each other side by side.
    fn run(&self, panorama: &Panorama) {
        let lighting = || {
            let analysis = self.analyse(panorama);
            let irradiance = || irradiance(&analysis, IRRADIANCE_SIZE, NEVER).expect(WANTED);
            rayon::join(|| self.specular(&analysis), irradiance);
            sh(&analysis, SH_ORDER);
        };
        rayon::join(lighting, || skybox(panorama, self.face_size, NEVER).expect(WANTED));
    }

    /// Where the time goes.
    fn parts(&self, panorama: &Panorama) {
        let analysis = self.analyse(panorama);
        println!("    analysis      {}", repeat(RUNS, || self.analyse(panorama)));
        println!("    ggx mips 1 …  {}", repeat(RUNS, || self.specular(&analysis)));
        let spectrum = |level| {
            Lobe::Ggx { alpha: self.alpha(level) }.kernel(analysis.band_limit(), NEVER).expect(WANTED)
        };
        let spectra = || (1..self.level_count).map(spectrum).collect::<Vec<_>>();
        println!("      of which κ  {}", repeat(RUNS, spectra));
        let lambert = || irradiance(&analysis, IRRADIANCE_SIZE, NEVER).expect(WANTED);
        println!("    irradiance    {}", repeat(RUNS, lambert));
        println!(
            "    skybox, mips  {}",
            repeat(RUNS, || skybox(panorama, self.face_size, NEVER).expect(WANTED))
        );
    }
}

pub(crate) fn run(verdict: &mut Verdict) {
    let studio = studio();
    println!("\n== Time, warm, of {}; medians of {RUNS} runs", studio.name);
    let one = if studio.panorama.width() == 1024 { studio.panorama } else { resized(&studio.panorama, 1024) };
    let two = resized(&one, 2048);
    let four = resized(&one, 4096);
    println!(
        "chain from the skybox (mip 0, with all its mips) on + irradiance {IRRADIANCE_SIZE} + SH, kernel spectra included"
    );
    let small = Job { face_size: 256, level_count: 9, error: 1e-3 };
    bakes("1024x512, 256, 9 mips", &one, small, Some(0.2), verdict);
    bakes("1024x512, 256, 9 mips", &one, Job { error: 1e-4, ..small }, Some(0.2), verdict);
    bakes("2048x1024, 256, 9 mips", &two, small, Some(0.4), verdict);
    bakes("2048x1024, 256, 9 mips", &two, Job { error: 1e-4, ..small }, None, verdict);
    let large = Job { face_size: 1024, level_count: 11, error: 1e-3 };
    bakes("4096x2048, 1024, 11 mips", &four, large, Some(4.0), verdict);
}

/// How work and time grow: with the error, the texels, the threads, the vectors.
pub(crate) fn scaling(verdict: &mut Verdict) {
    let studio = studio();
    println!("\n== How time grows, {}; medians of {RUNS} runs", studio.name);
    let [half, one, two, four] = [512, 1024, 2048, 4096].map(|width| resized(&studio.panorama, width));
    let job = Job { face_size: 256, level_count: 9, error: 1e-3 };
    vectors(&one, job);
    ladder(&one, job, verdict);
    growth([&half, &one, &two, &four], verdict);
    drop([two, four]);
    threads(&one, job, verdict);
}

fn bakes(what: &str, panorama: &Panorama, job: Job, target_s: Option<f64>, verdict: &mut Verdict) {
    let times = repeat(RUNS, || job.run(panorama));
    let against = target_s.map_or_else(String::new, |target| {
        format!("  target {target} CPU-s{}", verdict.mark(times.median.cpu_s <= target))
    });
    println!("{what}, error {:e}: {times}{against}", job.error);
    job.parts(panorama);
}

/// A looser error must take less work, unless both are at the floor.
fn ladder(panorama: &Panorama, job: Job, verdict: &mut Verdict) {
    println!("\nError asked for and work: degrees of the analysis and of each mip, Σ (L + 1)² over the mips");
    let mut looser: Option<usize> = None;
    for error in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let job = Job { error, ..job };
        let times = repeat(3, || job.specular(&job.analyse(panorama)));
        let analysis = job.analyse(panorama);
        let limits = job.specular(&analysis);
        let work: usize = limits.iter().map(|limit| (limit + 1) * (limit + 1)).sum();
        let mark = verdict.mark(looser.is_none_or(|looser| looser < work));
        println!("{error:5.0e}: L {:4}, mips {limits:?}, work {work}{mark}", analysis.band_limit());
        println!("       {times}");
        looser = Some(work);
    }
}

/// Analysis at one band limit over ever more texels.
fn growth(panoramas: [&Panorama; 4], verdict: &mut Verdict) {
    println!(
        "\nAnalysis to L = {FIXED_LIMIT} over sizes, least CPU time a texel; the smallest are ruled by what depends on L alone"
    );
    let mut before = f64::INFINITY;
    for panorama in panoramas {
        let (width, height) = (panorama.width(), panorama.height());
        let analyse =
            || kiln_sphere::analyse(width, height, panorama.rgb(), FIXED_LIMIT, NEVER).expect(WANTED);
        let times = repeat(RUNS, analyse);
        let ns = times.least.cpu_s / (width * height) as f64 * 1e9;
        let mark = verdict.mark(ns <= LINEAR_MAX * before);
        println!("{width:5}x{height:<5} {times}  {ns:6.2} ns a texel{mark}");
        before = ns;
    }
}

/// Wall time in pools of one and two threads, turn about, so that both meet the same load.
fn threads(panorama: &Panorama, job: Job, verdict: &mut Verdict) {
    let pools =
        [1, 2].map(|count| rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads"));
    let mut runs = [const { Vec::<Took>::new() }; 2];
    for _ in 0..2 * RUNS {
        for (pool, runs) in pools.iter().zip(&mut runs) {
            runs.push(once(|| pool.install(|| job.run(panorama))).1);
        }
    }
    let [one, two] = runs.map(|runs| summary(&runs));
    let ratio = |of: fn(&Times) -> Took| of(&one).wall_s / of(&two).wall_s;
    let (median, least) = (ratio(|times| times.median), ratio(|times| times.least));
    println!("\nTwo threads against one, whole bake of 1024x512");
    println!("1 thread   {one}");
    println!("2 threads  {two}");
    let shared = balance(&pools[1], || job.run(panorama));
    println!(
        "work over the busiest of two threads' share of it: {shared:.2}, which idle cores would give at most"
    );
    if one.median.wall_s > 1.1 * one.median.cpu_s {
        println!(
            "(one thread waited: other programs had the cores, and two threads cannot show what they bring)"
        );
    }
    let mark = verdict.mark(least.max(median) >= SPEED_UP_MIN);
    println!("speed-up by least wall {least:.2}, by median {median:.2}, target {SPEED_UP_MIN}{mark}");
}

/// CPU time of all threads over that of the busiest, in many runs.
fn balance(pool: &rayon::ThreadPool, work: impl Fn() + Send + Sync) -> f64 {
    let before = threads_cpu_s();
    for _ in 0..RUNS {
        pool.install(&work);
    }
    let spent: Vec<f64> =
        threads_cpu_s().iter().map(|(thread, after)| after - before.get(thread).unwrap_or(&0.0)).collect();
    spent.iter().sum::<f64>() / spent.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// CPU time with fewer vector instructions.
fn vectors(panorama: &Panorama, job: Job) {
    println!(
        "\nVector instructions: whole bake of 1024x512, and a transform to L = {VECTOR_LIMIT}, nearly all of it vectors"
    );
    let (width, height) = (panorama.width(), panorama.height());
    let transform =
        || kiln_sphere::analyse(width, height, panorama.rgb(), VECTOR_LIMIT, NEVER).expect(WANTED);
    for limit in [Instructions::Baseline, Instructions::Avx2, Instructions::Best] {
        simd::limit_to(limit);
        let name = format!("{limit:?} ({})", simd::available());
        println!("{name:22} bake       {}", repeat(RUNS, || job.run(panorama)));
        println!("{:22} transform  {}", "", repeat(RUNS, transform));
    }
    if simd::available() != "AVX-512" {
        println!("AVX-512 was NOT available here: nothing above says anything of it");
    }
}
