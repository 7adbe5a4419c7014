//! Hostile and random shaders for the real worker process: it answers or dies within its limits, and the host goes on.
//!
//! `cargo xtask fuzz shaders 100000 7` makes a long run of it, with another seed (`KILN_FUZZ_COUNT`, `KILN_FUZZ_SEED`).
//! Inputs that show something wrong are kept in `target/fuzz`, each in a folder named after its seed.

#![cfg(target_os = "linux")]
#![expect(clippy::print_stderr, reason = "a run says what it did")]

mod check;
mod corpus;
mod damage;
mod generate;
mod mutate;
mod random;

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use check::{CPU_MAX, Checker, MEMORY_KIB_MAX, Report};
use corpus::Input;
use generate::Dialect;
use kiln_worker::{Limits, Workers};
use random::Random;

/// Inputs of each kind, unless KILN_FUZZ_COUNT says otherwise.
const COUNT: u64 = 150;
const SEED: u64 = 20_261_122;

/// CPU time is counted for all children of this process, so one test at a time has any.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn number(variable: &str, otherwise: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")),
        Err(_) => otherwise,
    }
}

/// Each input has a seed of its own, so that a finding is made again by a run of one.
fn seeds() -> impl Iterator<Item = u64> {
    let first = number("KILN_FUZZ_SEED", SEED);
    (0..number("KILN_FUZZ_COUNT", COUNT)).map(move |index| first.wrapping_add(index))
}

#[track_caller]
fn fuzz(what: &str, mut input: impl FnMut(&mut Random) -> Input) -> Report {
    let _alone = alone();
    let mut checker = Checker::usual();
    for seed in seeds() {
        checker.check(seed, &input(&mut Random::new(seed)));
    }
    let summary = checker.report.summary(what);
    eprintln!("{summary}");
    assert!(checker.report.findings.is_empty(), "{summary}texts are in {}", check::folder().display());
    checker.report
}

#[test]
fn damaged_shaders_are_answered_or_end_the_worker_alone() {
    let inputs = corpus::inputs();
    assert!(inputs.len() > 80, "only {} shaders to damage", inputs.len());
    let report = fuzz("damaged shaders", |random| mutate::mutate(random.pick(&inputs), &inputs, random));
    assert!(report.refused > report.inputs / 4, "the damage does not bite: {} refused", report.refused);
}

#[test]
fn shaders_of_the_repository_are_sound() {
    let _alone = alone();
    let mut checker = Checker::usual();
    for (seed, input) in corpus::inputs().iter().enumerate() {
        checker.check(seed as u64, input);
    }
    let summary = checker.report.summary("shaders of the repository");
    eprintln!("{summary}");
    assert!(checker.report.findings.is_empty() && checker.report.deaths.is_empty(), "{summary}");
}

#[test]
fn random_wgsl_programs_compile_and_are_written_in_all_languages() {
    let report = fuzz("random WGSL", |random| generate::program(Dialect::Wgsl, random));
    assert_eq!(report.valid_compiled, report.inputs);
}

#[test]
fn random_glsl_programs_compile_and_are_written_in_all_languages() {
    let report = fuzz("random GLSL", |random| generate::program(Dialect::Glsl, random));
    assert_eq!(report.valid_compiled, report.inputs);
}

const SOUND: &str = "@fragment fn fs_main() -> @location(0) vec4f { return vec4f(1.0); }";

#[track_caller]
fn check_finds(checker: impl FnOnce() -> Checker, input: &Input, expected: &str) {
    let _alone = alone();
    let mut checker = checker();
    checker.check(0, input);
    let findings = checker.report.findings.join("\n");
    assert!(findings.contains(expected), "no {expected:?} in {findings:?}");
}

#[test]
fn checker_finds_a_worker_that_spins_for_too_long() {
    // Its host would let it go on for longer than the check allows.
    let limits = Limits { cpu: Duration::from_millis(800), wall: Duration::from_secs(60) };
    let workers = Workers::new("sh".into(), &["-c", "while :; do :; done"], limits);
    let checker = || Checker::new(workers, Duration::from_millis(300), MEMORY_KIB_MAX);
    check_finds(checker, &Input::of("a.wgsl", SOUND.to_owned()), "of CPU");
}

#[test]
fn checker_finds_a_host_that_does_not_go_on() {
    let workers = Workers::new("sh".into(), &["-c", "kill -SEGV $$"], Limits::USUAL);
    let checker = || Checker::new(workers, CPU_MAX, MEMORY_KIB_MAX);
    check_finds(checker, &Input::of("a.wgsl", SOUND.to_owned()), "the next task is not done");
}

#[test]
fn checker_finds_a_worker_that_takes_or_may_take_too_much_memory() {
    let limited = Workers::new(env!("CARGO_BIN_EXE_kiln-worker").into(), &[], Limits::USUAL);
    let checker = || Checker::new(limited, CPU_MAX, 1024);
    check_finds(checker, &Input::of("a.wgsl", SOUND.to_owned()), "may use 1048576 KiB");
}

#[test]
fn checker_finds_a_valid_program_that_is_refused() {
    let input = Input { is_valid: true, ..Input::of("a.wgsl", SOUND.replace("1.0", "oops")) };
    check_finds(Checker::usual, &input, "a valid program is refused");
}
