//! `cargo xtask bench bake`: accuracy and cost of environment maps, measured by `kiln-bake`'s own bench.

use crate::shell::{cargo, step};

/// Runs the bench with what follows `bench bake`; it fails if a figure misses its target.
pub(crate) fn run(arguments: &[&str]) -> Result<(), String> {
    // The whole workspace, as everything else is built: another choice of features would build its own copy of all.
    let mut bench = cargo(&["bench", "--workspace", "--bench", "bake", "--"]);
    step("bench bake", bench.args(arguments))
}
