//! CPU and wall time, and what the machine was doing meanwhile.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::DirEntry;
use std::time::Instant;

/// What a piece of work took, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Took {
    pub(crate) cpu_s: f64,
    pub(crate) wall_s: f64,
}

/// Median and least of several runs, by CPU time and by wall time apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    pub(crate) median: Took,
    pub(crate) least: Took,
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Times { median, least } = self;
        write!(
            f,
            "cpu {:8.1} ms (least {:8.1})  wall {:8.1} ms (least {:8.1})",
            median.cpu_s * 1e3,
            least.cpu_s * 1e3,
            median.wall_s * 1e3,
            least.wall_s * 1e3
        )
    }
}

/// CPU seconds of all threads of this process that live: rayon's workers do.
pub(crate) fn cpu_s() -> f64 {
    threads_cpu_s().values().sum()
}

/// CPU seconds of each thread, by its number.
pub(crate) fn threads_cpu_s() -> BTreeMap<OsString, f64> {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let of_task = |task: DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).unwrap_or_default();
        let ns = text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0);
        (task.file_name(), ns * 1e-9)
    };
    tasks.map(of_task).collect()
}

/// Runs `work` once.
pub(crate) fn once<T>(work: impl FnOnce() -> T) -> (T, Took) {
    let (cpu, wall) = (cpu_s(), Instant::now());
    let result = work();
    (result, Took { cpu_s: cpu_s() - cpu, wall_s: wall.elapsed().as_secs_f64() })
}

/// Runs `work` once to warm up, then `runs` times.
pub(crate) fn repeat<T>(runs: usize, mut work: impl FnMut() -> T) -> Times {
    drop(work());
    summary(&(0..runs).map(|_| once(&mut work).1).collect::<Vec<_>>())
}

/// Median and least.
pub(crate) fn summary(runs: &[Took]) -> Times {
    let sorted = |of: fn(&Took) -> f64| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        (values[values.len() / 2], values[0])
    };
    let (cpu, wall) = (sorted(|took| took.cpu_s), sorted(|took| took.wall_s));
    Times { median: Took { cpu_s: cpu.0, wall_s: wall.0 }, least: Took { cpu_s: cpu.1, wall_s: wall.1 } }
}

/// Cores, vectors and load, for the head of a report.
pub(crate) fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?").to_owned();
    format!("{cores} cores, {}, load average {load} at the start", kiln_sphere::simd::available())
}
