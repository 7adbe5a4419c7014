//! Tests of the whole crate: sources in, rendered diagnostics or canonical text out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::{Compiled, Outcome, Program, compile};

mod canonical;
mod cases;
mod compiler;
mod conditions;
#[path = "../../kiln-worker/tests/fuzz/damage.rs"]
mod damage;
mod diagnostics;
mod emit;
mod hostile;
mod imports;
mod lint;
mod mutations;
mod names;
mod parameters;
#[path = "../../kiln-worker/tests/fuzz/random.rs"]
mod random;
mod ranges;
mod shaders;
mod source_maps;
mod write_back;

/// A project in memory.
struct Files(BTreeMap<String, Arc<str>>);

impl Files {
    fn new(files: &[(&str, &str)]) -> Self {
        Files(files.iter().map(|(path, text)| ((*path).to_owned(), Arc::from(*text))).collect())
    }

    fn compile(&self, root: &str, features: &[&str]) -> Outcome {
        compile(&Program::of(root), &set(features), &mut |path| self.0.get(path).cloned())
    }
}

fn set(features: &[&str]) -> BTreeSet<String> {
    features.iter().map(|&feature| feature.to_owned()).collect()
}

/// All diagnostics as the user sees them.
fn rendered(outcome: &Outcome) -> String {
    let texts: Vec<String> = outcome.diagnostics.iter().map(ToString::to_string).collect();
    texts.join("\n")
}

#[track_caller]
fn compiled(outcome: Outcome) -> Compiled {
    let text = rendered(&outcome);
    outcome.compiled.unwrap_or_else(|| panic!("does not compile:\n{text}"))
}
