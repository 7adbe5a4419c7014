//! `cargo xtask test`: everything that must hold.

use crate::packages::install_missing;
use crate::shell::{cargo, step};

/// Runs all tests, then fmt, clippy and docs, in one profile so that nothing is built twice.
pub(crate) fn run(may_install: bool) -> Result<(), String> {
    let missing = if may_install { install_missing() } else { Vec::new() };
    if !missing.is_empty() {
        eprintln!(
            "note: {} not found and not installed here; tests that need them say SKIPPED.\n  \
             help: sudo apt-get install {}",
            missing.join(", "),
            missing.join(" ")
        );
    }
    if std::env::var_os("KILN_CORPUS").is_none() {
        eprintln!("note: KILN_CORPUS is not set: tests on real files from elsewhere say SKIPPED");
    }
    step("fmt", &mut cargo(&["fmt", "--all", "--check"]))?;
    step("build", &mut cargo(&["test", "--release", "--workspace", "--no-run"]))?;
    let mut tests = cargo(&["test", "--release", "--workspace"]);
    if missing.is_empty() {
        // Nothing may be skipped for lack of a device where the device is known to be there.
        tests.env("KILN_REQUIRE_GPU", "1");
    }
    step("tests", &mut tests)?;
    step(
        "clippy",
        &mut cargo(&["clippy", "--release", "--workspace", "--all-targets", "--", "-D", "warnings"]),
    )?;
    step(
        "clippy without the preview",
        &mut cargo(&[
            "clippy",
            "--release",
            "--package",
            "kiln",
            "--no-default-features",
            "--",
            "-D",
            "warnings",
        ]),
    )?;
    let mut docs = cargo(&["doc", "--release", "--workspace", "--no-deps"]);
    step("docs", docs.env("RUSTDOCFLAGS", "-D warnings"))
}

/// The tests that kill processes and spoil files, with a count of their own, and their report.
pub(crate) fn faults(count: &str) -> Result<(), String> {
    let mut tests = cargo(&["test", "--release", "--workspace", "--", "faults", "--nocapture"]);
    step("faults", tests.env("KILN_FAULTS", count))
}

/// Mutants of each file, where none are asked for.
const MUTANTS: &str = "100000";

/// The tests that feed damaged files to the image decoders, with a count and a seed of their own.
pub(crate) fn fuzz(count: Option<&str>, seed: Option<&str>) -> Result<(), String> {
    let mut tests = cargo(&["test", "--release", "--workspace", "--lib", "--", "tests::mutation::"]);
    tests.env("KILN_FUZZ_COUNT", number(count.unwrap_or(MUTANTS))?);
    match seed {
        Some(seed) => tests.env("KILN_FUZZ_SEED", number(seed)?),
        None => tests.env_remove("KILN_FUZZ_SEED"),
    };
    step("fuzz", &mut tests)
}

/// Inputs of each kind that shaders are fuzzed with, where none are asked for.
const SHADERS: &str = "10000";

/// The tests that feed damaged and random shaders to the worker, likewise; they say what came of it.
pub(crate) fn fuzz_shaders(count: Option<&str>, seed: Option<&str>) -> Result<(), String> {
    let mut tests = cargo(&["test", "--release", "--workspace", "--test", "fuzz", "--", "--nocapture"]);
    tests.env("KILN_FUZZ_COUNT", number(count.unwrap_or(SHADERS))?);
    match seed {
        Some(seed) => tests.env("KILN_FUZZ_SEED", number(seed)?),
        None => tests.env_remove("KILN_FUZZ_SEED"),
    };
    step("fuzz shaders", &mut tests)
}

/// The tests that damage what daemon and clients say to each other, likewise.
pub(crate) fn fuzz_wire(count: Option<&str>, seed: Option<&str>) -> Result<(), String> {
    let arguments = ["test", "--release", "-p", "kiln-link", "--lib", "--", "tests::fuzz::", "--nocapture"];
    let mut tests = cargo(&arguments);
    tests.env("KILN_FUZZ_COUNT", number(count.unwrap_or(MUTANTS))?);
    match seed {
        Some(seed) => tests.env("KILN_FUZZ_SEED", number(seed)?),
        None => tests.env_remove("KILN_FUZZ_SEED"),
    };
    step("fuzz wire", &mut tests)
}

/// `count` deeds of a restless user, and what must be published after each.
pub(crate) fn soak(count: &str, seed: Option<&str>) -> Result<(), String> {
    let mut tests =
        cargo(&["test", "--release", "-p", "kiln", "--test", "e2e", "--", "soak::no_edit", "--nocapture"]);
    tests.env("KILN_SOAK_EDITS", number(count)?);
    match seed {
        Some(seed) => tests.env("KILN_SOAK_SEED", number(seed)?),
        None => tests.env_remove("KILN_SOAK_SEED"),
    };
    step("soak", &mut tests)
}

/// How fast a revision of 64 MiB crosses the socket, beside a plain copy and the hash alone.
pub(crate) fn wire() -> Result<(), String> {
    let arguments =
        ["test", "--release", "-p", "kiln-link", "--lib", "--", "tests::throughput::", "--nocapture"];
    let mut tests = cargo(&arguments);
    step("bench wire", tests.env("KILN_WIRE_MIB", "64"))
}

/// Swaps `count` shaders, lights and materials under a renderer, and prints what memory that takes.
pub(crate) fn swaps(count: &str) -> Result<(), String> {
    let arguments =
        ["test", "--release", "-p", "kiln-preview", "--lib", "--", "tests::swap::", "--nocapture"];
    let mut tests = cargo(&arguments);
    // One after another: memory and times are of one alone.
    tests.args(["--test-threads", "1"]).env("KILN_SWAPS", number(count)?);
    step("bench swap", &mut tests)
}

fn number(text: &str) -> Result<&str, String> {
    text.parse::<u64>().map(|_| text).map_err(|_| format!("`{text}` is no number"))
}
