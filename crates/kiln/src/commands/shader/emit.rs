//! `kiln shader emit`.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use anyhow::Context as _;
use kiln_build::{Disk, write_atomically};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_shader::Language;
use kiln_worker::Died;
use serde_json::json;

use super::exit_code;
use super::subject::{Subject, Variant, merged, subjects};
use crate::args::EmitArgs;
use crate::out::say;
use crate::place::WrongInput;
use crate::report;

/// A file to be written: name and content.
type File = (String, Vec<u8>);

pub(super) fn run(args: &EmitArgs) -> anyhow::Result<ExitCode> {
    let (subjects, mut diagnostics) = subjects(&args.subjects)?;
    if args.out.is_some() {
        check_names(&subjects)?;
    }
    let mut files: Vec<File> = Vec::new();
    for subject in &subjects {
        let mut variants = subject.compile()?;
        if args.subjects.variants.is_empty() && args.out.is_none() {
            // One text was asked for.
            variants.retain(|variant| variant.names.iter().any(|name| name == "base"));
        }
        diagnostics.extend(merged(&variants));
        for variant in &variants {
            files.extend(emit(args, subject, variant, &mut diagnostics)?);
        }
    }
    report::print_diagnostics(&diagnostics, false);
    match &args.out {
        Some(out) => write(out, &files)?,
        None if has_errors(&diagnostics) => {}
        None => print(args, &files)?,
    }
    Ok(exit_code(&diagnostics))
}

fn emit(
    args: &EmitArgs,
    subject: &Subject,
    variant: &Variant,
    diagnostics: &mut Vec<Diagnostic>,
) -> anyhow::Result<Vec<File>> {
    let mut files = Vec::new();
    let Some(compiled) = &variant.outcome.compiled else { return Ok(files) };
    let stem = stem(subject, variant);
    for &language in &args.to {
        let emitted = match kiln_worker::emit(compiled.wgsl.clone(), language) {
            Ok(Ok(emitted)) => emitted,
            Ok(Err(diagnostic)) => {
                diagnostics.push(diagnostic.in_file(subject.program.subject()));
                continue;
            }
            Err(Died::NoWorker(reason)) => anyhow::bail!("no shader compiler: {reason}"),
            Err(died) => {
                diagnostics.push(died.diagnostic(subject.program.subject()));
                continue;
            }
        };
        let facts: Vec<_> = emitted
            .iter()
            .map(|file| json!({"file": format!("{stem}{}", file.file_suffix), "notes": file.notes, "bindings": file.bindings}))
            .collect();
        files.extend(emitted.into_iter().map(|file| (format!("{stem}{}", file.file_suffix), file.bytes)));
        files.push((format!("{stem}.{language}.json"), format!("{:#}\n", json!(facts)).into_bytes()));
    }
    if args.source_map {
        let map = format!("{:#}\n", json!(variant.outcome.source_map));
        files.push((format!("{stem}.map.json"), map.into_bytes()));
    }
    Ok(files)
}

/// What the files of a shader are called: its name in a project, else that of its first file.
fn name(subject: &Subject) -> &str {
    let file = subject.name.rsplit('/').next().unwrap_or(&subject.name);
    file.split('.').next().unwrap_or(file)
}

/// `pbr`, or `pbr.sheen+clearcoat`: the shader's name and the variant's, if it is not the plain one.
fn stem(subject: &Subject, variant: &Variant) -> String {
    let name = name(subject);
    match variant.names.iter().find(|name| *name == "base").or(variant.names.first()) {
        Some(variant) if variant != "base" => format!("{name}.{variant}"),
        _ => name.to_owned(),
    }
}

/// Refuses shaders whose files would take each other's place, also where case makes no difference.
fn check_names(subjects: &[Subject]) -> Result<(), WrongInput> {
    let mut known: BTreeMap<String, &Subject> = BTreeMap::new();
    for subject in subjects {
        if let Some(other) = known.insert(name(subject).to_lowercase(), subject) {
            let [first, second] =
                [other, subject].map(|one| format!("`{}` of {}", one.name, one.base.display()));
            return Err(WrongInput(format!(
                "{first} and {second} would be written to the same files, {}.…\n  help: write them to a folder each",
                name(subject)
            )));
        }
    }
    Ok(())
}

fn write(out: &Path, files: &[File]) -> anyhow::Result<()> {
    for (name, bytes) in files {
        let path = out.join(name);
        write_atomically(&Disk, &path, bytes).with_context(|| format!("writing {}", path.display()))?;
        say!("{:<44} {:>10}", path.display(), report::size(bytes.len() as u64));
    }
    Ok(())
}

/// One text goes to standard output; binding maps and more than one file need a folder.
fn print(args: &EmitArgs, files: &[File]) -> anyhow::Result<()> {
    let mut texts = files.iter().filter(|(name, _)| !name.ends_with(".json"));
    match (texts.next(), texts.next()) {
        (Some((_, bytes)), None) if args.to != [Language::SpirV] && !args.source_map => {
            std::io::stdout().lock().write_all(bytes).context("writing to standard output")
        }
        (None, _) => Ok(()),
        _ => Err(WrongInput("say where the files go: --out DIR".to_owned()).into()),
    }
}
