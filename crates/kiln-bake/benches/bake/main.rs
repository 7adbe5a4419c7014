//! `cargo xtask bench bake`: what a bake costs and how exact it is, beside a plain sampled estimator.
//!
//! ```text
//! … [accuracy] [sampled] [model] [time] [scaling] [--huge] [--only NAME]
//! ```
//!
//! Without a section's name all run. `--huge` measures the memory of a 16384×8192 panorama too, in a process of its own.
//! `--only` leaves the panoramas whose name holds NAME. Real panoramas come from the folder that KILN_CORPUS names; what
//! is not there is said. A figure that misses its target is marked MISSED, and the program then ends with exit code 1.
//!
//! CPU seconds are the scheduler's account of all threads of this process (`/proc/self/task/*/schedstat`), so time
//! that other programs take from it is not in them; that those fill caches and clock the cores down still shows. Times
//! are medians of several runs, with the least beside them.

#![expect(clippy::print_stdout, reason = "a bench prints")]

mod accuracy;
mod clock;
mod huge;
mod model;
mod panoramas;
mod sampled;
mod time;

use std::process::ExitCode;

/// Counts what missed its target.
#[derive(Default)]
pub(crate) struct Verdict {
    missed: usize,
}

impl Verdict {
    /// "" or a mark, for the end of a line.
    pub(crate) fn mark(&mut self, is_met: bool) -> &'static str {
        self.missed += usize::from(!is_met);
        if is_met { "" } else { "  MISSED" }
    }
}

fn main() -> ExitCode {
    // Cargo adds `--bench`.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let has = |name: &str| arguments.iter().any(|argument| argument == name);
    if has(huge::CHILD) {
        huge::child();
        return ExitCode::SUCCESS;
    }
    let only = arguments.iter().skip_while(|argument| *argument != "--only").nth(1);
    let only = only.map_or("", String::as_str);
    let sections = ["accuracy", "sampled", "model", "time", "scaling"];
    let is_all = !sections.iter().any(|section| has(section)) && !has("--huge");
    let mut verdict = Verdict::default();
    println!("{}", clock::machine());
    if is_all || has("accuracy") {
        accuracy::run(only, &mut verdict);
    }
    if is_all || has("sampled") {
        sampled::run(only);
    }
    if is_all || has("model") {
        model::run(only);
    }
    if is_all || has("time") {
        time::run(&mut verdict);
    }
    if is_all || has("scaling") {
        time::scaling(&mut verdict);
    }
    if has("--huge") {
        huge::run(&mut verdict);
    }
    match verdict.missed {
        0 => {
            println!("\nall targets met");
            ExitCode::SUCCESS
        }
        missed => {
            println!("\n{missed} figures MISSED their target");
            ExitCode::FAILURE
        }
    }
}
