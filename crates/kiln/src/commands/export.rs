//! `kiln export`: a project's environments in an engine's conventions.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use anyhow::Context as _;
use kiln_build::{Disk, Engine, RunOptions, write_atomically};
use kiln_diagnostic::has_errors;
use kiln_project::{
    CONVENTIONS_FILE, ExportFailure, ExportFile, Exported, FORMATS, PROJECT_FILE, Preset, Project,
    TexelFormat, parse_project, suggest,
};
use serde_json::{Value, json};

use crate::args::{ExportArgs, RunArgs};
use crate::commands::bake::{progress_bar, show_progress};
use crate::out::say;
use crate::place::WrongInput;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &ExportArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.dir)?;
    let text = std::fs::read_to_string(engine.folder().join(PROJECT_FILE)).context("reading kiln.toml")?;
    let (mut project, diagnostics) = parse_project(&text);
    if has_errors(&diagnostics) {
        report::print_diagnostics(&diagnostics, true);
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    for name in &args.envs {
        if !project.envs.contains_key(name) {
            let known = project.envs.keys().map(String::as_str);
            let help = suggest(name, known).map_or_else(String::new, |help| format!("\n  help: {help}"));
            return Err(WrongInput(format!("there is no [env.{name}] in kiln.toml{help}")).into());
        }
    }
    project.envs.retain(|name, _| args.envs.is_empty() || args.envs.contains(name));
    let format = args.format.as_deref().map(parse_format).transpose()?;
    let exported = export_with_progress(&engine, &project, args.preset, format, &args.run)?;
    finish(&exported, &project, args.preset, &args.out, &args.run)
}

/// A texel format by its name.
pub(crate) fn parse_format(name: &str) -> anyhow::Result<TexelFormat> {
    let known = FORMATS.iter().find(|(known, _)| *known == name);
    known.map(|(_, format)| *format).ok_or_else(|| {
        let names: Vec<&str> = FORMATS.iter().map(|(name, _)| *name).collect();
        WrongInput(format!("`{name}` is no texel format; there are {}", names.join(", "))).into()
    })
}

/// Bakes and packages, with a progress bar.
pub(crate) fn export_with_progress(
    engine: &Engine,
    project: &Project,
    preset: Preset,
    format: Option<TexelFormat>,
    run: &RunArgs,
) -> anyhow::Result<Exported> {
    let _hold = engine.store().hold();
    with_progress(run, |options| match kiln_project::export(engine, project, preset, format, options) {
        Ok(exported) => Ok(exported),
        Err(ExportFailure::Package { env, error }) => {
            Err(WrongInput(format!("environment `{env}`: {error}")).into())
        }
        Err(error) => Err(error).context("exporting"),
    })
}

/// Runs something that takes options and shows its progress.
pub(crate) fn with_progress<T>(run: &RunArgs, work: impl FnOnce(&RunOptions) -> T) -> T {
    let bar = progress_bar();
    let progress = show_progress(&bar);
    let cancel = AtomicBool::new(false);
    let options = RunOptions {
        jobs: place::jobs(run.jobs),
        memory_bytes: place::memory_bytes(run.memory),
        keep_going: true,
        cancel: &cancel,
        progress: &progress,
    };
    let result = work(&options);
    bar.finish_and_clear();
    result
}

/// Writes an export and says what it did. Environments that could not be made keep the files they have.
pub(crate) fn finish(
    exported: &Exported,
    project: &Project,
    preset: Preset,
    out: &Path,
    run: &RunArgs,
) -> anyhow::Result<ExitCode> {
    let mut written: BTreeMap<&str, Vec<Value>> = BTreeMap::new();
    for (name, files) in &exported.files {
        let folder = out.join(name);
        let _lock = kiln_project::lock_folder(&folder);
        remove_stale(&folder, files);
        for file in files {
            let is_new = write_if_changed(&folder, file)?;
            let facts = json!({"path": format!("{name}/{}", file.path), "bytes": file.bytes.len(), "written": is_new});
            written.entry(name).or_default().push(facts);
        }
    }
    let built = &exported.built;
    let failed: Vec<&String> =
        project.envs.keys().filter(|name| !exported.files.contains_key(*name)).collect();
    if run.json {
        let json = json!({
            "for": preset.name(),
            "environments": written,
            "failed": failed,
            "diagnostics": built.diagnostics,
            "run_ms": built.run_ms,
        });
        say!("{json:#}");
    } else {
        for (name, files) in &exported.files {
            let bytes: usize = files.iter().map(|file| file.bytes.len()).sum();
            let count = report::count(files.len(), "file");
            say!(
                "{name}: {count} for {preset}, {}, in {}",
                report::size(bytes as u64),
                out.join(name).display()
            );
            files
                .iter()
                .for_each(|file| say!("  {:<44} {:>10}", file.path, report::size(file.bytes.len() as u64)));
        }
        report::print_diagnostics(&built.diagnostics, true);
    }
    let is_good = failed.is_empty() && !has_errors(&built.diagnostics);
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}

/// Removes what an earlier export left in the folder and this one does not make: only files that its conventions name.
fn remove_stale(folder: &Path, files: &[ExportFile]) {
    let facts: Option<Value> =
        std::fs::read(folder.join(CONVENTIONS_FILE)).ok().and_then(|text| serde_json::from_slice(&text).ok());
    let facts = facts.unwrap_or_default();
    let paths = facts["files"].as_array().into_iter().flatten().flat_map(|file| match &file["path"] {
        Value::Array(paths) => paths.iter().filter_map(Value::as_str).collect::<Vec<_>>(),
        path => path.as_str().into_iter().collect(),
    });
    for path in paths.filter(|path| !files.iter().any(|file| file.path == **path)) {
        let is_here = Path::new(path).components().count() == 1 && !path.starts_with('.');
        if is_here {
            // It may be gone already.
            let _ = std::fs::remove_file(folder.join(path));
        }
    }
}

/// Whether the file was not there with this content.
fn write_if_changed(folder: &Path, file: &ExportFile) -> anyhow::Result<bool> {
    let path = folder.join(&file.path);
    if std::fs::read(&path).is_ok_and(|present| present == file.bytes) {
        return Ok(false);
    }
    write_atomically(&Disk, &path, &file.bytes).with_context(|| format!("writing {}", path.display()))?;
    Ok(true)
}
