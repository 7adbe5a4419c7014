//! Rating a map that any tool baked.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use kiln_accuracy::{BruteForce, ErrorNorms, Level, LobeKind, Truth};
use kiln_image::{Cancel, Cube, Environment, Limits, decode_environment, ktx2};
use serde_json::json;

use super::inputs::{Input, read};
use super::wrong;
use crate::INPUT_IS_WRONG;
use crate::args::AccuracyArgs;
use crate::out::say;

/// Directions a level that are compared, unless told.
const PROBES: usize = 96;

pub(super) fn run(args: &AccuracyArgs, inputs: &[Input], map: &Path) -> anyhow::Result<ExitCode> {
    let [input] = inputs else {
        return Err(wrong("--against rates a map of one environment; pick it with --env".to_owned()));
    };
    let kind = input.lobes.first().copied().unwrap_or(LobeKind::Ggx);
    let Map { levels, first, of_law } = levels(map)?;
    let panorama = input.panorama()?;
    let force = BruteForce::new(&panorama, Cancel::NEVER).context("preparing the environment")?;
    let mut rated = Vec::new();
    for (index, cube) in levels.iter().enumerate() {
        let mip = first + index;
        let roughness = input.law.roughness(mip, of_law);
        // A mirror is the environment itself; Lambert's map has one level.
        if kind == LobeKind::Lambert && index > 0 || kind != LobeKind::Lambert && roughness == 0.0 {
            continue;
        }
        let lobe = kind.of_roughness(roughness);
        let level = Level { mip, mip_count: of_law, roughness, lobe, face_size: cube.face_size };
        let truth =
            Truth::new(&force, level, args.probes.unwrap_or(PROBES), Cancel::NEVER).context("measuring")?;
        rated.push((level, truth.compare_map(cube)));
    }
    if rated.is_empty() {
        let help = "give its roughness as --law 0.5, or rate it as irradiance with --lobes lambert";
        return Err(wrong(format!(
            "{} has one level, and by the law that is a mirror; {help}",
            map.display()
        )));
    }
    let all: Vec<ErrorNorms> = rated.iter().map(|(_, error)| *error).collect();
    let chain = ErrorNorms::of_chain(&all);
    if args.json {
        let levels: Vec<_> = rated
            .iter()
            .map(|(level, error)| {
                json!({"mip": level.mip, "face_size": level.face_size, "roughness": level.roughness, "error": error})
            })
            .collect();
        let report = json!({"map": map.display().to_string(), "environment": input.name, "lobe": kind.name(),
                            "law": input.law.name(), "levels": levels, "chain": chain});
        say!("{report:#}");
    } else {
        say!(
            "{} beside the exact {} of {}, roughness {}",
            map.display(),
            kind.name(),
            input.name,
            input.law.name()
        );
        say!("  {:>5} {:>6} {:>10} {:>9} {:>9} {:>9}", "mip", "faces", "roughness", "RMS", "95 %", "largest");
        for (level, error) in &rated {
            let Level { mip, face_size, roughness, .. } = level;
            let ErrorNorms { rms, p95, max } = error;
            say!("  {mip:>5} {face_size:>6} {roughness:>10.4} {rms:>9.1e} {p95:>9.1e} {max:>9.1e}");
        }
        say!("  {:>5} {:>17} {:>9.1e} {:>9.1e} {:>9.1e}", "chain", "", chain.rms, chain.p95, chain.max);
    }
    let worst = all
        .iter()
        .map(|error| error.rms)
        .fold(0.0, |a: f64, b| if b.is_nan() { f64::INFINITY } else { a.max(b) });
    if let Some(limit) = args.max_error.filter(|limit| worst > *limit) {
        eprintln!("error: {}: its error {worst:.2e} is above --max-error {limit:.2e}", map.display());
        return Ok(ExitCode::from(INPUT_IS_WRONG));
    }
    Ok(ExitCode::SUCCESS)
}

/// A map's levels, largest first.
struct Map {
    levels: Vec<Cube>,
    /// Mip of the law that the first is; above 0 in Kiln's own files where nothing reads the levels before.
    first: usize,
    /// Mips of the law.
    of_law: usize,
}

impl Map {
    fn of_levels(levels: Vec<Cube>) -> Map {
        let of_law = levels.len();
        Map { levels, first: 0, of_law }
    }
}

fn levels(map: &Path) -> anyhow::Result<Map> {
    if map.is_dir() {
        let entries = std::fs::read_dir(map).with_context(|| format!("reading {}", map.display()))?;
        let mut files: Vec<PathBuf> =
            entries.flatten().map(|entry| entry.path()).filter(|path| path.is_file()).collect();
        files.sort();
        if files.is_empty() {
            return Err(wrong(format!("{} holds no file; put a cube for each level in it", map.display())));
        }
        return Ok(Map::of_levels(
            files.iter().map(|file| first_level(file)).collect::<anyhow::Result<_>>()?,
        ));
    }
    let bytes = read(map)?;
    if map.extension().is_some_and(|extension| extension == "ktx2") {
        let broken = |error: ktx2::KtxError| wrong(format!("{}: {error}", map.display()));
        let texture = ktx2::read(&bytes).map_err(broken)?;
        // What Kiln divided its own files by.
        let scale = (number_of::<i32>(&texture.key_values, "KilnScaleLog2").unwrap_or(0) as f32).exp2();
        let level = |level: usize| {
            let mut cube = texture.cube(level).map_err(broken)?;
            cube.rgb.iter_mut().for_each(|value| *value *= scale);
            Ok(cube)
        };
        let levels = (0..texture.levels.len()).map(level).collect::<anyhow::Result<Vec<_>>>()?;
        let fact = |key: &str| number_of::<usize>(&texture.key_values, key);
        let of_law = fact("KilnLevels").unwrap_or(levels.len()).max(levels.len());
        return Ok(Map { first: fact("KilnFirstLevel").unwrap_or(0).min(of_law), of_law, levels });
    }
    Ok(Map::of_levels(vec![first_level(map)?]))
}

/// A number that Kiln's own files hold.
fn number_of<T: std::str::FromStr>(key_values: &[(String, String)], wanted: &str) -> Option<T> {
    key_values.iter().find(|(key, _)| key == wanted)?.1.parse().ok()
}

fn first_level(file: &Path) -> anyhow::Result<Cube> {
    let decoded = decode_environment(&read(file)?, None, &Limits::default(), Cancel::NEVER);
    let decoded = decoded.map_err(|error| wrong(format!("{}: {error}", file.display())))?;
    match decoded.environment {
        Environment::Cube(cube) => Ok(cube),
        Environment::Panorama(_) => {
            Err(wrong(format!("{} is a panorama; a map to rate is a cube", file.display())))
        }
    }
}
