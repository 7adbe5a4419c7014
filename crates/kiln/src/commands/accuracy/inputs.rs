//! Which environments are looked at, and how each is baked.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use kiln_accuracy::{LobeKind, eevee_probe_law, level_count};
use kiln_diagnostic::has_errors;
use kiln_image::{
    Cancel, Environment, FACE_NAMES, Limits, Panorama, TexelPolicy, decode_environment,
    environment_from_faces, limit_radiance,
};
use kiln_project::{
    EnvConfig, PROJECT_FILE, RoughnessLaw, TexelFormat, panorama_of_cube, parse_project, suggest,
};

use super::wrong;
use crate::args::AccuracyArgs;
use crate::commands::env::parse_law;
use crate::commands::export::parse_format;
use crate::{place, report};

/// One environment and how it is baked.
pub(super) struct Input {
    pub(super) name: String,
    files: Vec<PathBuf>,
    config: EnvConfig,
    pub(super) lobes: Vec<LobeKind>,
    pub(super) face_size: usize,
    pub(super) law: RoughnessLaw,
    pub(super) error: f64,
    pub(super) format: TexelFormat,
}

/// Those of a project, or the one file.
pub(super) fn inputs(args: &AccuracyArgs, lobes: &[LobeKind]) -> anyhow::Result<Vec<Input>> {
    if args.source.is_dir() {
        return of_project(args, lobes);
    }
    if !args.source.is_file() {
        return Err(wrong(format!("{} is neither a project's folder nor a file", args.source.display())));
    }
    if !args.envs.is_empty() {
        return Err(wrong("--env picks environments of a project; a file is one".to_owned()));
    }
    let name = args.source.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let config = EnvConfig::new(vec![args.source.display().to_string()]);
    Ok(vec![input(args, lobes, name, vec![args.source.clone()], config)?])
}

fn of_project(args: &AccuracyArgs, lobes: &[LobeKind]) -> anyhow::Result<Vec<Input>> {
    let folder = place::project_folder(&args.source)?;
    let text = std::fs::read_to_string(folder.join(PROJECT_FILE)).context("reading kiln.toml")?;
    let (mut project, diagnostics) = parse_project(&text);
    if has_errors(&diagnostics) {
        report::print_diagnostics(&diagnostics, true);
        return Err(wrong("kiln.toml has errors".to_owned()));
    }
    for name in &args.envs {
        if !project.envs.contains_key(name) {
            let known = project.envs.keys().map(String::as_str);
            let help = suggest(name, known).map_or_else(String::new, |help| format!("\n  help: {help}"));
            return Err(wrong(format!("there is no [env.{name}] in kiln.toml{help}")));
        }
    }
    project.envs.retain(|name, _| args.envs.is_empty() || args.envs.contains(name));
    if project.envs.is_empty() {
        return Err(wrong("kiln.toml names no environment".to_owned()));
    }
    let of_env = |(name, config): (String, EnvConfig)| {
        let files = config.sources.iter().map(|source| folder.join(source)).collect();
        input(args, lobes, name, files, config)
    };
    project.envs.into_iter().map(of_env).collect()
}

fn input(
    args: &AccuracyArgs,
    lobes: &[LobeKind],
    name: String,
    files: Vec<PathBuf>,
    config: EnvConfig,
) -> anyhow::Result<Input> {
    let face_size = args.size.unwrap_or(config.size);
    if !face_size.is_power_of_two() || !(8..=1024).contains(&face_size) {
        return Err(wrong(format!("--size {face_size} is no power of two from 8 to 1024")));
    }
    let error = args.error.unwrap_or(config.error);
    if !(1e-7..=1.0).contains(&error) {
        return Err(wrong(format!("--error {error} is not from 1e-7 to 1")));
    }
    if args.probes.is_some_and(|probes| !(8..=100_000).contains(&probes)) {
        return Err(wrong("--probes goes from 8 to 100000".to_owned()));
    }
    let law = match args.law.as_deref() {
        Some("eevee-probe") => eevee_probe_law(level_count(face_size)),
        Some(law) => parse_law(law)?,
        None => config.law.clone(),
    };
    if matches!(&law, RoughnessLaw::Custom(list) if list.len() > face_size.ilog2() as usize + 1) {
        return Err(wrong(format!("a chain from {face_size} texels has no room for so many levels")));
    }
    let format = args.format.as_deref().map(parse_format).transpose()?.unwrap_or(config.format);
    let lobes = match lobes {
        [] if config.has_sheen => LobeKind::ALL.to_vec(),
        [] => vec![LobeKind::Ggx, LobeKind::Lambert],
        lobes => lobes.to_vec(),
    };
    Ok(Input { name, files, config, lobes, face_size, law, error, format })
}

impl Input {
    /// The radiance that maps are made of, as a bake reads it: repaired, cut where kiln.toml says so.
    pub(super) fn panorama(&self) -> anyhow::Result<Panorama> {
        let limits = Limits::default();
        let decoded = match self.files.as_slice() {
            [file] => {
                let bytes = read(file)?;
                let decoded = decode_environment(&bytes, self.config.layout, &limits, Cancel::NEVER);
                decoded.map_err(|error| wrong(format!("{}: {error}", file.display())))?
            }
            files => {
                let bytes = files.iter().map(|file| read(file)).collect::<anyhow::Result<Vec<_>>>()?;
                let faces: [&[u8]; 6] =
                    bytes.iter().map(Vec::as_slice).collect::<Vec<_>>().try_into().map_err(|_| {
                        wrong(format!("{}: six faces are {}", self.name, FACE_NAMES.join(" ")))
                    })?;
                let decoded = environment_from_faces(faces, &limits, Cancel::NEVER);
                decoded.map_err(|error| wrong(format!("{}: {error}", self.name)))?
            }
        };
        // Maps hold radiance whatever texels the sky box keeps.
        let policy = match self.config.texels {
            TexelPolicy::Error => TexelPolicy::Error,
            _ => TexelPolicy::Repair,
        };
        let fix = |error: kiln_image::TexelError| wrong(format!("{}: {error}", self.name));
        let mut panorama = match decoded.environment {
            Environment::Panorama(panorama) => panorama,
            Environment::Cube(mut cube) => {
                policy.apply(&mut cube, Cancel::NEVER).map_err(fix)?;
                panorama_of_cube(&cube, Cancel::NEVER).context("making a panorama of a cube")?
            }
        };
        policy.apply(&mut panorama, Cancel::NEVER).map_err(fix)?;
        if let Some(most) = self.config.radiance_max {
            limit_radiance(&mut panorama, most as f32, Cancel::NEVER).context("limiting radiance")?;
        }
        Ok(panorama)
    }
}

pub(super) fn read(file: &Path) -> anyhow::Result<Vec<u8>> {
    std::fs::read(file).map_err(|error| wrong(format!("cannot read {}: {error}", file.display())))
}
