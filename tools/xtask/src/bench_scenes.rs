//! `cargo xtask bench scenes`: time and memory of reading a large GLB, measured by `kiln-scene`'s own bench.

use crate::shell::{cargo, step};

/// Runs the bench with what follows `bench scenes`; it fails if a figure misses its target.
pub(crate) fn run(arguments: &[&str]) -> Result<(), String> {
    let mut bench = cargo(&["bench", "--package", "kiln-scene", "--bench", "load", "--"]);
    step("bench scenes", bench.args(arguments))
}
