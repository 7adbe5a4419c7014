//! `kiln shader variants`.

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;

use kiln_build::Digest;
use serde_json::{Value, json};

use super::exit_code;
use super::subject::{Variant, merged, subjects};
use crate::args::VariantsArgs;
use crate::out::say;
use crate::report;

pub(super) fn run(args: &VariantsArgs) -> anyhow::Result<ExitCode> {
    let (subjects, mut diagnostics) = subjects(&args.subjects)?;
    let mut shaders: Vec<Value> = Vec::new();
    for subject in &subjects {
        let variants = subject.compile()?;
        diagnostics.extend(merged(&variants));
        let mut texts: BTreeMap<Option<Digest>, Vec<&Variant>> = BTreeMap::new();
        for variant in &variants {
            let compiled = variant.outcome.compiled.as_ref();
            texts.entry(compiled.map(|shader| Digest::of(shader.wgsl.as_bytes()))).or_default().push(variant);
        }
        let Counts { asked, compiled, broken, shared, artefacts } = Counts::new(&variants);
        shaders.push(json!({
            "shader": subject.name,
            "features": subject.features,
            "asked": asked,
            "compiled": compiled,
            "broken": broken,
            "shared": shared,
            "artefacts": artefacts,
            "variants": texts.iter().map(|(digest, variants)| json!({
                "sha256": digest.map(|digest| digest.to_string()),
                "bytes": size_of(variants[0]),
                "names": names(variants),
            })).collect::<Vec<_>>(),
        }));
        if args.json {
            continue;
        }
        let features: Vec<&str> = subject.features.iter().map(String::as_str).collect();
        let features = if features.is_empty() { "none".to_owned() } else { features.join(", ") };
        say!("{}\n  features: {features}", subject.name);
        for (digest, variants) in &texts {
            let digest =
                digest.map_or("does not compile".to_owned(), |digest| digest.to_string()[..12].to_owned());
            let bytes = size_of(variants[0]).map_or_else(String::new, |bytes| report::size(bytes as u64));
            say!("  {digest:<16} {bytes:>9}   {}", names(variants).join(" = "));
        }
        let broken = if broken > 0 { format!(", {broken} broken") } else { String::new() };
        say!("  {asked} asked, {compiled} compiled, {shared} shared, {artefacts} artefacts{broken}");
    }
    if args.json {
        say!("{:#}", json!({"shaders": shaders, "diagnostics": diagnostics}));
    } else {
        report::print_diagnostics(&diagnostics, false);
    }
    Ok(exit_code(&diagnostics))
}

/// How many feature sets there are of each kind.
struct Counts {
    /// Those that were asked for.
    asked: usize,
    /// Those of them that compile and can differ from each other.
    compiled: usize,
    /// Those that were asked for and do not compile.
    broken: usize,
    /// Those that were asked for and are one with another.
    shared: usize,
    /// Different texts.
    artefacts: usize,
}

impl Counts {
    fn new(variants: &[Variant]) -> Counts {
        let asked = |variants: &[&Variant]| variants.iter().map(|variant| variant.names.len()).sum::<usize>();
        let (good, bad): (Vec<_>, Vec<_>) =
            variants.iter().partition(|variant| variant.outcome.compiled.is_some());
        let (sound, broken) = (asked(&good), asked(&bad));
        let texts = good.iter().filter_map(|variant| Some(&variant.outcome.compiled.as_ref()?.wgsl));
        let artefacts = texts.collect::<BTreeSet<_>>().len();
        Counts { asked: sound + broken, compiled: good.len(), broken, shared: sound - artefacts, artefacts }
    }
}

fn names(variants: &[&Variant]) -> Vec<String> {
    variants.iter().flat_map(|variant| variant.names.iter().cloned()).collect()
}

fn size_of(variant: &Variant) -> Option<usize> {
    Some(variant.outcome.compiled.as_ref()?.wgsl.len())
}
