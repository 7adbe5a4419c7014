//! Whether a build elsewhere makes the same bytes.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use kiln_build::{ActionRecord, Digest, Engine, Error, Forecast, Outcome, RunOptions, Store};
use serde::Serialize;

use crate::plan::plan;

/// What a verification found.
#[derive(Clone, Debug, Serialize)]
pub struct Verified {
    /// Targets that were built again.
    pub targets: Vec<String>,
    /// How many actions ran for them.
    pub actions: usize,
    /// Outputs compared.
    pub outputs: usize,
    /// Their length.
    pub bytes: u64,
    /// Those that are different.
    pub mismatches: Vec<Mismatch>,
}

/// An output that came out otherwise.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Mismatch {
    /// Which action made it.
    pub action: String,
    /// Its name.
    pub output: String,
    /// What the store has.
    pub stored: Option<Digest>,
    /// What the fresh build made.
    pub fresh: Option<Digest>,
}

/// Why nothing could be verified.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The tool could not do its work.
    #[error(transparent)]
    Build(#[from] Error),
    /// A target's actions have not all run from the sources as they are.
    #[error("{0} is not up to date: bake first")]
    OutOfDate(String),
    /// A target's sources have an error, so there is nothing to compare.
    #[error("the input of `{0}` is at fault: bake says how")]
    AtFault(String),
    /// The fresh folder cannot be made.
    #[error("cannot copy {path} to a fresh folder: {source}")]
    Copy {
        /// The source, relative to the project.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The run was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// Copies the project's sources to a fresh folder, builds what makes `targets` there with an empty store, and compares
/// every output with what the project's store has.
///
/// # Errors
/// [`VerifyError`]; outputs that differ are no error but the result.
pub fn verify(engine: &Engine, targets: &[String], options: &RunOptions) -> Result<Verified, VerifyError> {
    let here = plan(engine, None)?;
    let mut wanted = Vec::new();
    for target in targets {
        wanted.extend(here.actions_of(target).unwrap_or_default());
    }
    let (graph, ids) = here.graph.only(&here.graph.with_upstream(&wanted));
    for (id, forecast) in ids.iter().zip(engine.forecast(&graph)) {
        let name = || here.graph.action(*id).name.clone();
        match forecast {
            Forecast::UpToDate => {}
            Forecast::Failed | Forecast::Blocked { .. } => return Err(VerifyError::AtFault(name())),
            Forecast::Runs { .. } | Forecast::MayRun { .. } => return Err(VerifyError::OutOfDate(name())),
        }
    }
    // Nothing runs: all of it is up to date.
    let stored = engine.run(&graph, options)?;

    let fresh = tempfile::tempdir().map_err(|source| VerifyError::Copy { path: ".".to_owned(), source })?;
    let folder = copy_sources(engine, fresh.path())?;
    let fresh_engine = Engine::open(&folder, Store::open(&fresh.path().join("cache"))?)?;
    let there = plan(&fresh_engine, None)?;
    let mut wanted = Vec::new();
    for target in targets {
        wanted.extend(there.actions_of(target).unwrap_or_default());
    }
    let (fresh_graph, _) = there.graph.only(&there.graph.with_upstream(&wanted));
    let made = fresh_engine.run(&fresh_graph, options)?;
    if !made.is_complete() {
        return Err(VerifyError::Cancelled);
    }
    let mut verified = Verified {
        targets: targets.to_vec(),
        actions: made.ended.len(),
        outputs: 0,
        bytes: 0,
        mismatches: Vec::new(),
    };
    let fresh: HashMap<&str, &Outcome> = made
        .outcomes
        .iter()
        .filter_map(|outcome| Some((outcome.record.as_ref()?.name.as_str(), outcome)))
        .collect();
    for record in stored.outcomes.iter().filter_map(|outcome| outcome.record.as_ref()) {
        compare(engine, record, fresh.get(record.name.as_str()).copied(), &mut verified);
    }
    Ok(verified)
}

fn compare(engine: &Engine, record: &ActionRecord, fresh: Option<&Outcome>, verified: &mut Verified) {
    for output in &record.result.outputs {
        verified.outputs += 1;
        verified.bytes += output.bytes;
        // Intermediate results may be gone; what is there must be what its name says.
        let is_damaged = engine.store().contains(&output.digest, output.bytes)
            && engine.store().get(&output.digest).is_none();
        let stored = (!is_damaged).then_some(output.digest);
        let fresh = fresh.and_then(|fresh| fresh.output(&output.name)).map(|output| output.digest);
        if stored != fresh {
            verified.mismatch(record, &output.name, stored, fresh);
        }
    }
    let facts = |record: &ActionRecord| Digest::of(record.result.meta.to_string().as_bytes());
    let fresh = fresh.and_then(|fresh| fresh.record.as_deref()).map(facts);
    if fresh != Some(facts(record)) {
        verified.mismatch(record, "its facts", Some(facts(record)), fresh);
    }
}

impl Verified {
    fn mismatch(
        &mut self,
        record: &ActionRecord,
        output: &str,
        stored: Option<Digest>,
        fresh: Option<Digest>,
    ) {
        let (action, output) = (record.name.clone(), output.to_owned());
        self.mismatches.push(Mismatch { action, output, stored, fresh });
    }
}

/// The project's folder below `fresh`, with every source that the plan looked at, and those beside it that it names with
/// `..`.
fn copy_sources(engine: &Engine, fresh: &Path) -> Result<PathBuf, VerifyError> {
    let paths = engine.sources().looked_at();
    let ups =
        |path: &String| Path::new(path).components().filter(|part| *part == Component::ParentDir).count();
    let depth = paths.iter().map(ups).max().unwrap_or(0);
    let folder = (0..=depth).fold(fresh.to_owned(), |folder, _| folder.join("project"));
    for path in paths.iter().filter(|path| Path::new(path).is_relative()) {
        let (from, to) = (engine.folder().join(path), folder.join(path));
        if !from.is_file() {
            continue;
        }
        let copy = || {
            std::fs::create_dir_all(&folder)?;
            // `a/../b` needs `a`.
            std::fs::create_dir_all(to.parent().unwrap_or(&folder))?;
            std::fs::copy(&from, &to)
        };
        copy().map_err(|source| VerifyError::Copy { path: path.clone(), source })?;
    }
    Ok(folder)
}
