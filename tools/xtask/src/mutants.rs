//! `cargo xtask mutants`: each guard against a hard case is taken away once, and the tests of `tests/numerics` must notice.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::mutant_list::{MUTANTS, Mutant};
use crate::shell::{cargo, output_of, root};

/// A file with a guard removed; its text comes back when this goes.
struct Changed {
    path: PathBuf,
    text: String,
}

impl Changed {
    fn new(mutant: &Mutant) -> Result<Changed, String> {
        let path = root().join(mutant.file);
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", mutant.file))?;
        let count = text.matches(mutant.guard).count();
        if count == 0 {
            return Err(format!("{} has no `{}`: correct the list of mutants", mutant.file, mutant.guard));
        }
        // Of several the first: the list names them so that it is the one meant.
        let mutated = text.replacen(mutant.guard, mutant.without, 1);
        std::fs::write(&path, mutated).map_err(|error| format!("{}: {error}", mutant.file))?;
        Ok(Changed { path, text })
    }
}

impl Drop for Changed {
    fn drop(&mut self) {
        if let Err(error) = std::fs::write(&self.path, &self.text) {
            eprintln!("{} could not be restored: {error}; `git checkout` has it", self.path.display());
        }
    }
}

/// Runs mutants whose file or name holds `filter`: those of shaders at once, as shaders are read when the tests run; with
/// `native` those of Rust code too, each of which is compiled.
pub(crate) fn run(native: bool, filter: &str) -> Result<(), String> {
    let tests = executable()?;
    let chosen: Vec<&Mutant> = MUTANTS
        .iter()
        .filter(|mutant| native || mutant.is_shader())
        .filter(|mutant| mutant.file.contains(filter) || mutant.name.contains(filter))
        .collect();
    if !passes(&tests)? {
        return Err("the tests fail without any mutant".to_owned());
    }
    let (mut survivors, mut unseen) = (Vec::new(), 0);
    for mutant in &chosen {
        let changed = Changed::new(mutant)?;
        let is_noticed = if mutant.is_shader() { !passes(&tests)? } else { !compiles_and_passes() };
        drop(changed);
        let verdict = match (is_noticed, mutant.unseen) {
            (true, _) => "killed",
            (false, "") => "SURVIVED",
            (false, _) => "unseen",
        };
        println!("{verdict:9} {:60} {}", mutant.name, mutant.file);
        if verdict == "unseen" {
            unseen += 1;
            println!("          {}", mutant.unseen);
        }
        if verdict == "SURVIVED" {
            survivors.push(mutant.name);
        }
    }
    let skipped = MUTANTS.iter().filter(|mutant| !chosen.iter().any(|it| it.name == mutant.name)).count();
    let killed = chosen.len() - survivors.len() - unseen;
    println!("{killed} of {} mutants killed, {unseen} known to be unseen, {skipped} not run", chosen.len());
    match survivors.len() {
        0 => Ok(()),
        count => Err(format!("{count} guards may go unnoticed: {}", survivors.join("; "))),
    }
}

/// The built tests.
fn executable() -> Result<PathBuf, String> {
    let mut build = cargo(&[
        "test",
        "--release",
        "--workspace",
        "--test",
        "numerics",
        "--no-run",
        "--message-format=json",
    ]);
    let messages = output_of(build.stderr(Stdio::inherit()))?;
    let executable = |line: &str| {
        let rest = line.split("\"executable\":\"").nth(1)?;
        rest.split('"').next().map(PathBuf::from)
    };
    let is_it =
        |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("numerics"));
    messages.lines().filter_map(executable).find(is_it).ok_or_else(|| "cargo built no tests".to_owned())
}

/// Tests that read no shader, and take longest.
const NATIVE_ALONE: [&str; 2] = ["inputs::", "transforms::"];

fn passes(tests: &Path) -> Result<bool, String> {
    let mut command = Command::new(tests);
    command.args(NATIVE_ALONE.iter().flat_map(|module| ["--skip", module]));
    command
        .env("KILN_REQUIRE_GPU", "1")
        .env_remove("KILN_UPDATE_RECORD")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    Ok(command.status().map_err(|error| format!("the tests cannot be started: {error}"))?.success())
}

/// A mutant that the compiler refuses is noticed as well.
fn compiles_and_passes() -> bool {
    let mut tests = cargo(&["test", "--release", "--workspace", "--test", "numerics"]);
    tests.env("KILN_REQUIRE_GPU", "1").stdout(Stdio::null()).stderr(Stdio::null());
    tests.status().is_ok_and(|status| status.success())
}
