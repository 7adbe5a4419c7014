//! `cargo xtask bench check`: how long `kiln check` takes on a panorama of 2048×1024.

use std::time::{Duration, Instant};

use crate::bench::{Bench, cores};
use crate::shell::{cargo, output_of, step};

/// What a person waits for without noticing.
const TARGET: Duration = Duration::from_secs(1);
const RUNS: usize = 5;

/// Prints the median and the slowest of five runs with and without the page; fails if the median misses its target.
pub(crate) fn run() -> Result<(), String> {
    step("build", &mut cargo(&["build", "--release", "--workspace", "--bins"]))?;
    let bench = Bench::new("bench-check")?;
    let project = bench.folder.join("project");
    output_of(bench.kiln("cache").args(["init", "--panorama-width", "2048"]).arg(&project))?;
    println!(
        "\n{} cores; wall-clock time of the whole program on this machine as busy as it is now",
        cores()
    );
    let mut median = Duration::ZERO;
    for has_page in [true, false] {
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let mut check = bench.kiln("cache");
            check.arg("check").arg(project.join("environments/sky.hdr"));
            if has_page {
                check.arg("--html").arg(bench.folder.join("report.html"));
            }
            let start = Instant::now();
            output_of(&mut check)?;
            times.push(start.elapsed());
        }
        times.sort();
        median = times[RUNS / 2];
        let what = if has_page { "with its page" } else { "report alone" };
        let [middle, slowest] = [median, times[RUNS - 1]].map(|time| time.as_secs_f64() * 1e3);
        println!(
            "kiln check, 2048×1024 .hdr, {what}: median {middle:.0} ms, slowest {slowest:.0} ms of {RUNS}"
        );
    }
    if median > TARGET { Err(format!("the median is over {} s", TARGET.as_secs())) } else { Ok(()) }
}
