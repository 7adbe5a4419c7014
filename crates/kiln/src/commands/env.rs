//! `kiln env`: environments without a project.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use kiln_build::{Engine, Target};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_project::{
    Built, EnvConfig, FACE_NAMES, Layout, Project, Range, RoughnessLaw, TexelPolicy, Written, build_apart,
    parse_project, write_outputs,
};
use serde_json::{Value, json};

use crate::args::EnvArgs;
use crate::commands::cube_picture as picture;
use crate::commands::export::{export_with_progress, finish, parse_format, with_progress};
use crate::out::say;
use crate::place::WrongInput;
use crate::{INPUT_IS_WRONG, place, report};

pub(crate) fn run(args: &EnvArgs) -> anyhow::Result<ExitCode> {
    let inputs = inputs(args)?;
    // The files get names of their own in a folder of their own, so that equal files share the cache wherever they lie.
    let folder = tempfile::tempdir().context("making a folder for links")?;
    let mut project = parse_project("version = 1").0;
    project.is_without_default_lut = true;
    for (name, files) in &inputs {
        let mut sources = Vec::new();
        for (index, file) in files.iter().enumerate() {
            let source = format!("{name}.{index}");
            link(file, &folder.path().join(&source))?;
            sources.push(source);
        }
        project.envs.insert(name.clone(), config(args, sources)?);
    }
    let engine = Engine::open(folder.path(), place::open_store()?).context("opening the cache")?;
    std::fs::create_dir_all(&args.out).with_context(|| format!("making {}", args.out.display()))?;
    let out = args.out.canonicalize().context("finding the folder of the maps")?;
    if let Some(preset) = args.preset {
        let format = args.format.as_deref().map(parse_format).transpose()?;
        let mut exported = export_with_progress(&engine, &project, preset, format, &args.run)?;
        exported.built.diagnostics = with_files(&exported.built.diagnostics, &inputs);
        return finish(&exported, &project, preset, &out, &args.run);
    }
    let _hold = engine.store().hold();
    let built = with_progress(&args.run, |options| build_apart(&engine, &project, options));
    let mut built = built.context("baking")?.context("the bake was cancelled")?;
    built.diagnostics = with_files(&built.diagnostics, &inputs);
    let maps = write_maps(&engine, &built, &project, &out)?;
    if let Some(picture) = args.picture {
        for (name, (targets, _)) in &maps {
            picture::write(&engine, &targets["skybox"], picture, &out.join(name))?;
        }
    }
    let failed: Vec<&String> = project.envs.keys().filter(|name| !maps.contains_key(*name)).collect();
    if args.run.json {
        let environments: serde_json::Map<String, Value> = maps
            .iter()
            .map(|(name, (targets, written))| {
                let facts = targets.iter().map(|(map, target)| (map.clone(), target.meta.clone()));
                let facts: serde_json::Map<String, Value> = facts.collect();
                (name.clone(), json!({"written": written.written, "kept": written.kept, "maps": facts}))
            })
            .collect();
        let diagnostics = &built.diagnostics;
        let report = json!({"environments": environments, "failed": failed, "diagnostics": diagnostics, "run_ms": built.run_ms});
        say!("{report:#}");
    } else {
        for (name, (targets, written)) in &maps {
            print_maps(name, targets, written, &out);
        }
        report::print_diagnostics(&built.diagnostics, true);
        let (ran, reused) = (built.report.ended.len(), built.report.reused_count());
        say!("{} ran, {reused} reused in {}", report::count(ran, "action"), report::duration(built.run_ms));
    }
    let is_good = failed.is_empty() && !has_errors(&built.diagnostics);
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) })
}

/// Environment to its files: one each, or six.
fn inputs(args: &EnvArgs) -> anyhow::Result<BTreeMap<String, Vec<PathBuf>>> {
    let wrong = |text: String| -> anyhow::Error { WrongInput(text).into() };
    for file in &args.files {
        if !file.is_file() {
            return Err(wrong(format!("{} is no file that can be read", file.display())));
        }
    }
    if let Some(name) = &args.name
        && (name.is_empty() || name_of_text(name) != *name)
    {
        return Err(wrong(format!(
            "--name `{name}`: names have letters, digits, `-` and `_` only, at most 64"
        )));
    }
    if args.faces {
        if args.layout != "auto" {
            return Err(wrong("--faces says the layout; leave --layout out".to_owned()));
        }
        if args.files.len() != FACE_NAMES.len() {
            let message =
                format!("--faces needs six files, {}, not {}", FACE_NAMES.join(" "), args.files.len());
            return Err(wrong(message));
        }
        let name = args.name.clone().unwrap_or_else(|| name_of(&args.files[0]));
        return Ok(BTreeMap::from([(name, args.files.clone())]));
    }
    if args.name.is_some() && args.files.len() > 1 {
        return Err(wrong(format!("--name names one environment, {} files were given", args.files.len())));
    }
    let mut inputs = BTreeMap::new();
    let mut taken = BTreeSet::new();
    for file in &args.files {
        let first = args.name.clone().unwrap_or_else(|| name_of(file));
        let others = (2..).map(|number| format!("{first}-{number}"));
        let name = std::iter::once(first.clone()).chain(others).find(|name| taken.insert(name.clone()));
        inputs.insert(name.unwrap_or(first), vec![file.clone()]);
    }
    Ok(inputs)
}

/// A file's name as an environment's: letters, digits, `-` and `_`.
fn name_of(file: &Path) -> String {
    let name = name_of_text(&file.file_stem().unwrap_or_default().to_string_lossy());
    if name.is_empty() { "env".to_owned() } else { name }
}

fn name_of_text(text: &str) -> String {
    let fit = |character: char| match character {
        character if character.is_ascii_alphanumeric() || "-_".contains(character) => character,
        _ => '-',
    };
    text.chars().take(64).map(fit).collect()
}

fn link(file: &Path, link: &Path) -> anyhow::Result<()> {
    let file = file.canonicalize().with_context(|| format!("finding {}", file.display()))?;
    #[cfg(unix)]
    std::os::unix::fs::symlink(file, link).context("linking a file")?;
    #[cfg(not(unix))]
    std::fs::copy(file, link).map(drop).context("copying a file")?;
    Ok(())
}

fn config(args: &EnvArgs, sources: Vec<String>) -> anyhow::Result<EnvConfig> {
    let wrong = |text: String| -> anyhow::Error { WrongInput(text).into() };
    let mut env = EnvConfig::new(sources);
    if !args.size.is_power_of_two() || args.size > 4096 {
        return Err(wrong(format!("--size {} is no power of two from 1 to 4096", args.size)));
    }
    if !(1e-7..=1.0).contains(&args.error) {
        return Err(wrong(format!("--error {} is not from 1e-7 to 1", args.error)));
    }
    if args.skybox_size.is_some_and(|size| !(1..=4096).contains(&size)) {
        return Err(wrong("--skybox-size goes from 1 to 4096".to_owned()));
    }
    if args.sh_order > 8 || !(1..=1024).contains(&args.irradiance_size) {
        return Err(wrong("--sh-order goes from 0 to 8, --irradiance-size from 1 to 1024".to_owned()));
    }
    env.layout = Layout::parse_choice(&args.layout).map_err(|error| wrong(error.to_string()))?;
    (env.size, env.error, env.skybox_size) = (args.size, args.error, args.skybox_size);
    (env.irradiance_size, env.has_sheen) = (args.irradiance_size, args.sheen);
    (env.sh_order, env.is_sh_windowed) = (args.sh_order, args.dering);
    env.levels = args.levels;
    env.law = parse_law(&args.law)?;
    let most = env.size.ilog2() as usize + 1;
    if env.level_count() == 0 || env.level_count() > most {
        let message =
            format!("a chain from {} texels has 1 to {most} levels, not {}", env.size, env.level_count());
        return Err(wrong(message));
    }
    if let Some(format) = &args.format {
        env.format = parse_format(format)?;
    }
    env.range = choice("--range", &args.range, &[("scale", Range::Scale), ("f32", Range::F32)])?;
    env.is_sun_extracted = choice("--sun", &args.sun, &[("keep", false), ("extract", true)])?;
    let policies =
        [("repair", TexelPolicy::Repair), ("error", TexelPolicy::Error), ("keep", TexelPolicy::Keep)];
    env.texels = choice("--texels", &args.texels, &policies)?;
    if args.max_radiance.is_some_and(|max| !(1e-30..=1e38).contains(&max)) {
        return Err(wrong("--max-radiance goes from 1e-30 to 1e38".to_owned()));
    }
    if env.is_sun_extracted && env.texels == TexelPolicy::Keep {
        return Err(wrong("--sun extract needs radiance: not with --texels keep".to_owned()));
    }
    if matches!(env.law, RoughnessLaw::Custom(_)) && args.levels.is_some() {
        return Err(wrong("a list in --law says the number of levels; leave --levels out".to_owned()));
    }
    refuse_what_a_preset_decides(args)?;
    env.radiance_max = args.max_radiance;
    Ok(env)
}

/// An engine's conventions leave no choice in these.
fn refuse_what_a_preset_decides(args: &EnvArgs) -> anyhow::Result<()> {
    let Some(preset) = args.preset else { return Ok(()) };
    let given = [
        ("--law", args.law != "linear"),
        ("--levels", args.levels.is_some()),
        ("--skybox-size", args.skybox_size.is_some()),
        ("--irradiance-size", args.irradiance_size != 64),
        ("--sheen", args.sheen),
        ("--sh-order", args.sh_order != 2),
        ("--dering", args.dering),
        ("--range", args.range != "scale"),
        ("--picture", args.picture.is_some()),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((flag, _)) => {
            Err(WrongInput(format!("{flag} has no effect with --for {preset}: its conventions decide"))
                .into())
        }
        None => Ok(()),
    }
}

fn choice<T: Copy>(flag: &str, word: &str, choices: &[(&str, T)]) -> anyhow::Result<T> {
    let found = choices.iter().find(|(known, _)| *known == word);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        WrongInput(format!("{flag} is {}, not `{word}`", words.join(" or "))).into()
    })
}

/// A law by its name, or a list.
pub(crate) fn parse_law(text: &str) -> anyhow::Result<RoughnessLaw> {
    let list: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let law = match (text, list) {
        ("linear", _) => Ok(RoughnessLaw::Linear),
        ("filament", _) => Ok(RoughnessLaw::Filament),
        ("eevee", _) => Ok(RoughnessLaw::Eevee),
        (_, Ok(list)) => RoughnessLaw::custom(list).map_err(|error| format!("--law: {error}")),
        _ => Err(format!("--law is linear, filament, eevee or a list as 0,0.25,1, not `{text}`")),
    };
    law.map_err(|message| WrongInput(message).into())
}

/// Messages about a link, as messages about the file that it leads to.
fn with_files(diagnostics: &[Diagnostic], inputs: &BTreeMap<String, Vec<PathBuf>>) -> Vec<Diagnostic> {
    let file_of = |source: &str| {
        let (name, index) = source.rsplit_once('.')?;
        Some(inputs.get(name)?.get(index.parse::<usize>().ok()?)?.display().to_string())
    };
    let named = diagnostics.iter().map(|diagnostic| {
        let mut diagnostic = diagnostic.clone();
        if let Some(file) = diagnostic.file.as_deref().and_then(file_of) {
            diagnostic.file = Some(file);
        }
        diagnostic
    });
    named.collect()
}

/// An environment's targets by map, and what was written of them.
type Maps = (BTreeMap<String, Target>, Written);

/// Writes each environment that was made into a folder of its own; the others keep what they have there.
fn write_maps(
    engine: &Engine,
    built: &Built,
    project: &Project,
    out: &Path,
) -> anyhow::Result<BTreeMap<String, Maps>> {
    let mut maps = BTreeMap::new();
    for name in project.envs.keys() {
        let prefix = format!("env/{name}/");
        let wanted = built.plan.targets.iter().filter(|spec| spec.name.starts_with(&prefix)).count();
        let of_env = |(target_name, target): (&String, &Target)| {
            Some((target_name.strip_prefix(&prefix)?.to_owned(), target.clone()))
        };
        let targets: BTreeMap<String, Target> = built.targets.iter().filter_map(of_env).collect();
        if targets.len() < wanted {
            continue;
        }
        let folder = out.join(name);
        let written = write_outputs(engine, &targets, &folder.to_string_lossy()).context("writing maps")?;
        maps.insert(name.clone(), (targets, written));
    }
    Ok(maps)
}

fn print_maps(name: &str, targets: &BTreeMap<String, Target>, written: &Written, out: &Path) {
    let source = targets.get("skybox").and_then(|skybox| skybox.meta.get("source"));
    let fact = |key: &str| source.and_then(|source| source.get(key)?.as_str()).unwrap_or_default();
    let place = out.join(name);
    say!("{name}: {} {} ({}), in {}", fact("layout"), fact("size"), fact("format"), place.display());
    for (map, target) in targets {
        let fact = |key: &str| target.meta.get(key).and_then(Value::as_u64);
        let format = target.meta.get("format").and_then(Value::as_str).unwrap_or("json");
        let size = fact("size").map_or_else(String::new, |size| format!("{size}"));
        let levels =
            fact("levels").map_or_else(String::new, |levels| report::count(levels as usize, "level"));
        let largest = |list: &str, key: &str| {
            let values = target.meta.get(list).and_then(Value::as_array).into_iter().flatten();
            values.filter_map(|value| value.get(key)?.as_f64()).reduce(f64::max)
        };
        let errors = [
            ("bound", largest("details", "rms_bound")),
            ("measured", largest("measured", "rms")),
            ("rounding", largest("details", "rounding_rms")),
        ];
        let errors = errors.into_iter().filter_map(|(what, error)| Some(format!("{what} {:.1e}", error?)));
        let errors: Vec<String> = errors.collect();
        say!("  {map:<12} {size:>5} {levels:<9} {format:<10} {}", errors.join("  "));
    }
    let count = report::count(written.written.len(), "file");
    say!("  {count} written, {} as they were; {}", written.kept, report::size(written.manifest.bytes()));
}
