//! `cargo xtask bench bake` and `bench accuracy`: accuracy and cost of environment maps, measured by the crates' own benches.

use crate::shell::{cargo, step};

/// Runs the bench of a name with what follows it; it fails if a figure misses its target.
pub(crate) fn run(name: &str, arguments: &[&str]) -> Result<(), String> {
    // The whole workspace, as everything else is built: another choice of features would build its own copy of all.
    let mut bench = cargo(&["bench", "--workspace", "--bench", name, "--"]);
    step(&format!("bench {name}"), bench.args(arguments))
}
