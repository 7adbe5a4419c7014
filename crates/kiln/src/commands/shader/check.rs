//! `kiln shader check`.

use std::process::ExitCode;
use std::time::Instant;

use kiln_diagnostic::Severity;
use serde_json::{Value, json};

use super::subject::{merged, subjects};
use crate::args::CheckArgs;
use crate::out::say;
use crate::{INPUT_IS_WRONG, report};

pub(super) fn run(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let (subjects, mut diagnostics) = subjects(&args.subjects)?;
    let mut shaders: Vec<Value> = Vec::new();
    let (mut good, mut all) = (0, 0);
    for subject in &subjects {
        let mut variants = if args.no_lint { subject.compile()? } else { subject.lint()? };
        for variant in variants.iter_mut().filter(|variant| variant.outcome.is_library) {
            // A module for others to import is checked all the same.
            variant.outcome.diagnostics.retain(|diagnostic| !diagnostic.is_error());
        }
        let mut found = subject.unknown_features();
        found.extend(merged(&variants));
        all += variants.len();
        good += variants.iter().filter(|variant| variant.is_good()).count();
        let facts = variants.iter().map(|variant| json!({"names": variant.names, "ok": variant.is_good()}));
        shaders.push(json!({
            "shader": subject.name,
            "base": subject.base,
            "files": subject.program.roots,
            "features": subject.features,
            "variants": facts.collect::<Vec<_>>(),
        }));
        diagnostics.extend(found);
    }
    let least = if args.deny_warnings { Severity::Warning } else { Severity::Error };
    let is_bad = diagnostics.iter().any(|diagnostic| diagnostic.severity >= least);
    let ms = start.elapsed().as_secs_f64() * 1e3;
    if args.json {
        say!("{:#}", json!({"shaders": shaders, "diagnostics": diagnostics, "ok": !is_bad, "ms": ms}));
    } else {
        report::print_diagnostics(&diagnostics, true);
        let (files, variants) = (report::count(subjects.len(), "shader"), report::count(all, "variant"));
        let verdict = if good == all {
            "all compile".to_owned()
        } else {
            format!("{} of them {} not compile", all - good, if all - good == 1 { "does" } else { "do" })
        };
        say!("{files}, {variants}: {verdict}; {}", report::duration(ms));
    }
    Ok(if is_bad { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS })
}
