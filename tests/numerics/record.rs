//! The worst error of each case, kept in the repository.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use crate::support::{Comparison, gpu, repository};

/// A record holds for the compiler and machine it was made on; `f64` sums differ in their last digits elsewhere.
const SLACK: f64 = 1.05;
/// Errors below are rounding of `f64`.
const LEAST: f64 = 1e-15;
/// Another driver than the one that the record was made on rounds differently.
const OTHER_DRIVER: f64 = 16.0;
/// That one.
const RECORDED_ON: &str = "llvmpipe";

/// Test and place (`f64`, `wgsl`, `encoded`) to the worst relative error.
pub type Record = BTreeMap<(String, String), f64>;

pub fn path() -> PathBuf {
    repository().join("tests/numerics/record.tsv")
}

pub fn is_updating() -> bool {
    std::env::var_os("KILN_UPDATE_RECORD").is_some_and(|value| value == "1")
}

pub fn parse(text: &str) -> Record {
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let entry = |line: &str| {
        let mut fields = line.split('\t').map(str::to_owned);
        let (test, place, error) = (fields.next()?, fields.next()?, fields.next()?.parse().ok()?);
        Some(((test, place), error))
    };
    lines.map(|line| entry(line).unwrap_or_else(|| panic!("no entry: {line}"))).collect()
}

pub fn read() -> Record {
    parse(&std::fs::read_to_string(path()).unwrap_or_default())
}

/// Why an error is worse than its record.
fn regression(record: &Record, test: &str, place: &str, error: f64, slack: f64) -> Option<String> {
    let Some(&known) = record.get(&(test.to_owned(), place.to_owned())) else {
        return Some(format!(
            "{test} ({place}) has no record; KILN_UPDATE_RECORD=1 makes one of {error:.2e}"
        ));
    };
    // Written with `<=`, so NaN fails.
    let is_good = error <= (known * slack).max(LEAST);
    (!is_good).then(|| format!("{test} ({place}): the worst error is {error:.3e}, on record is {known:.3e}"))
}

/// Holds a case to its record.
#[track_caller]
pub fn hold(test: &str, place: &str, error: f64) {
    static WRITING: Mutex<()> = Mutex::new(());
    assert!(error.is_finite(), "{test} ({place}): the worst error is {error}");
    if is_updating() {
        let _lock = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        let mut record = read();
        record.insert((test.to_owned(), place.to_owned()), error);
        let line =
            |((test, place), error): (&(String, String), &f64)| format!("{test}\t{place}\t{error:.3e}\n");
        let lines: String = record.iter().map(line).collect();
        std::fs::write(path(), format!("# Worst relative errors by test and place: see record.rs\n{lines}"))
            .unwrap();
        crate::table::update(&record);
        return;
    }
    let is_other = place == "wgsl" && !gpu().is_some_and(|gpu| gpu.description().contains(RECORDED_ON));
    let slack = if is_other { OTHER_DRIVER } else { SLACK };
    if let Some(reason) = regression(&read(), test, place, error, slack) {
        panic!("{reason}");
    }
}

/// Runs functions of the shader library beside their truths, and holds the worst of them to the record. Each must tell its
/// wrong formula from the truth.
#[track_caller]
pub fn hold_wgsl(test: &str, comparisons: &[Comparison]) {
    let Some(gpu) = gpu() else { return };
    let mut worst = 0.0f64;
    for comparison in comparisons {
        let [right, wrong] = comparison.measure(gpu);
        let function = comparison.function;
        assert!(
            right.error <= comparison.tolerance,
            "{test}: {function} is off by {:e} at {:?}",
            right.error,
            right.at
        );
        assert!(wrong.error > comparison.tolerance, "{test}: {function} cannot tell a wrong formula");
        worst = worst.max(right.error);
    }
    hold(test, "wgsl", worst);
}

/// Relative error, of the size `least` where the truth is smaller.
pub fn relative(actual: f64, expected: f64, least: f64) -> f64 {
    let error = (actual - expected).abs() / expected.abs().max(least);
    if error.is_nan() { f64::INFINITY } else { error }
}

/// The worst of relative errors.
pub fn worst(errors: impl IntoIterator<Item = f64>) -> f64 {
    errors
        .into_iter()
        .fold(0.0, |worst, error| if error.is_nan() { f64::INFINITY } else { f64::max(worst, error) })
}

#[test]
fn record_rejects_a_larger_error_a_missing_one_and_nan() {
    let record = parse("# comment\ncase\twgsl\t1.000e-6\n");
    assert_eq!(regression(&record, "case", "wgsl", 1.01e-6, SLACK), None);
    for (test, error) in [("case", 1.2e-6), ("other", 1e-9), ("case", f64::NAN)] {
        assert!(regression(&record, test, "wgsl", error, SLACK).is_some(), "{test} {error}");
    }
}
