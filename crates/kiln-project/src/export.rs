//! Environments as an engine wants them: its law, its sizes, its files.

use std::collections::BTreeMap;

use kiln_bake::{Cancel, TexelFormat};
use kiln_build::{Engine, Error, RunOptions, Target};
use kiln_diagnostic::Diagnostic;
use kiln_export::{BakedEnvironment, DfgTable, ExportError, ExportFile, Preset, package_as};
use kiln_image::Cube;
use serde_json::Value;

use crate::build::{Built, build_apart};
use crate::{EnvConfig, LutConfig, Project, Range};

/// The files of every environment that could be made.
pub struct Exported {
    /// What was baked for it.
    pub built: Built,
    /// Environment to its files.
    pub files: BTreeMap<String, Vec<ExportFile>>,
}

/// Why there is no export.
#[derive(Debug, thiserror::Error)]
pub enum ExportFailure {
    /// The tool could not do its work.
    #[error(transparent)]
    Build(#[from] Error),
    /// The maps cannot be packaged.
    #[error("environment `{env}`: {error}")]
    Package {
        /// Which environment.
        env: String,
        /// Why.
        error: ExportError,
    },
    /// Somebody cancelled it.
    #[error("the export was cancelled")]
    Cancelled,
}

/// The environment as `preset` wants it baked: unrounded, as texels are encoded once, when they are packaged.
pub fn wished(env: &EnvConfig, preset: Preset) -> EnvConfig {
    let wish = preset.wish(env.size);
    EnvConfig {
        size: wish.specular_face,
        levels: Some(wish.specular_levels.max(1)),
        law: wish.law,
        skybox_size: Some(wish.skybox_face),
        irradiance_size: wish.irradiance_face.unwrap_or(env.irradiance_size),
        has_sheen: wish.sheen,
        sh_order: wish.sh_order.unwrap_or(env.sh_order),
        format: TexelFormat::Rgba32Float,
        range: Range::F32,
        ..env.clone()
    }
}

/// Bakes the environments of `project` for an engine and packages them. Scenes, shaders and tables are left out; nothing
/// is published.
///
/// # Errors
/// [`ExportFailure`]; what is wrong with the input is among the diagnostics of [`Exported::built`].
pub fn export(
    engine: &Engine,
    project: &Project,
    preset: Preset,
    format: Option<TexelFormat>,
    options: &RunOptions,
) -> Result<Exported, ExportFailure> {
    let table_size = preset.wish(1).dfg_size;
    let table = |size| ("dfg".to_owned(), LutConfig { size, ..crate::lut::DEFAULT });
    let project = Project {
        envs: project.envs.iter().map(|(name, env)| (name.clone(), wished(env, preset))).collect(),
        luts: table_size.map(table).into_iter().collect(),
        scenes: BTreeMap::new(),
        shaders: BTreeMap::new(),
        is_without_default_lut: true,
        ..project.clone()
    };
    let mut built = build_apart(engine, &project, options)?.ok_or(ExportFailure::Cancelled)?;
    let mut files = BTreeMap::new();
    let mut diagnostics = Vec::new();
    for (name, env) in &project.envs {
        let Some(baked) = assemble(engine, &built, name, env, table_size)? else { continue };
        let cancel = Cancel::when(options.cancel);
        let packaged = package_as(preset, &baked, format, cancel);
        let mut packaged = packaged.map_err(|error| ExportFailure::Package { env: name.clone(), error })?;
        diagnostics.extend(encoding_notes(name, &packaged));
        if let Some(sun) = built.targets.get(&format!("env/{name}/sun")) {
            let bytes = content(engine, sun, 0)?.to_vec();
            packaged.push(ExportFile { path: format!("{name}_sun.json"), bytes });
        }
        files.insert(name.clone(), packaged);
    }
    built.diagnostics.extend(diagnostics);
    Ok(Exported { built, files })
}

/// What an engine's formats cannot hold, and the scale that brings values into their range, as `conventions.json` has them:
/// never silent.
fn encoding_notes(env: &str, files: &[ExportFile]) -> Vec<Diagnostic> {
    let conventions = files.iter().find(|file| file.path == CONVENTIONS_FILE);
    let facts: Value =
        conventions.and_then(|file| serde_json::from_slice(&file.bytes).ok()).unwrap_or_default();
    let mut said = Vec::new();
    for file in facts["files"].as_array().into_iter().flatten() {
        let clamped = file["encoding_error"]["clamped_flux"].as_array().into_iter().flatten();
        let worst = clamped.filter_map(Value::as_f64).fold(0.0, f64::max);
        if worst > 0.0 {
            let (path, format) = (&file["path"], &file["format"]);
            said.push(Diagnostic::warning(format!(
                "env/{env}: {path}: {format} cannot hold all values: {worst:.2e} of the flux is cut"
            )));
        }
    }
    if let Some(scale) = facts["multiply_by"].as_f64().filter(|scale| *scale != 1.0) {
        let message = format!("env/{env}: values are stored divided by {scale}, see conventions.json");
        said.push(Diagnostic::note(message));
    }
    said
}

/// The file of a set that says how to read the others.
pub const CONVENTIONS_FILE: &str = "conventions.json";

/// The maps of an environment as values; `None` if one of them could not be made.
fn assemble(
    engine: &Engine,
    built: &Built,
    name: &str,
    env: &EnvConfig,
    table_size: Option<usize>,
) -> Result<Option<BakedEnvironment>, Error> {
    let target = |map: &str| built.targets.get(&format!("env/{name}/{map}"));
    let (Some(skybox), Some(specular), Some(irradiance), Some(sh)) =
        (target("skybox"), target("specular"), target("irradiance"), target("sh"))
    else {
        return Ok(None);
    };
    let sheen = if env.has_sheen { target("sheen") } else { None };
    if env.has_sheen != sheen.is_some() {
        return Ok(None);
    }
    let with_roughness = |levels: Vec<Cube>| -> Vec<(f64, Cube)> {
        levels.into_iter().enumerate().map(|(level, cube)| (env.roughness(level), cube)).collect()
    };
    let dfg = match (table_size, built.targets.get("lut/dfg")) {
        (Some(size), Some(table)) => Some(DfgTable { size, entries: pairs(&content(engine, table, 0)?) }),
        (Some(_), None) => return Ok(None),
        (None, _) => None,
    };
    let sh: Value = serde_json::from_slice(&content(engine, sh, 0)?).unwrap_or_default();
    let radiance_sh = serde_json::from_value(sh["radiance"].clone()).unwrap_or_default();
    Ok(Some(BakedEnvironment {
        name: name.to_owned(),
        skybox: levels(engine, skybox)?,
        specular: with_roughness(levels(engine, specular)?),
        sheen: sheen.map(|sheen| levels(engine, sheen)).transpose()?.map(with_roughness),
        irradiance: levels(engine, irradiance)?.into_iter().next(),
        radiance_sh,
        dfg,
    }))
}

fn content(engine: &Engine, target: &Target, part: usize) -> Result<std::sync::Arc<[u8]>, Error> {
    let lost = || Error::Lost { what: "a map to export".to_owned() };
    let part = target.parts.get(part).ok_or_else(lost)?;
    engine.store().get(&part.digest).ok_or_else(lost)
}

/// A cube target of 32-bit floats as values.
fn levels(engine: &Engine, target: &Target) -> Result<Vec<Cube>, Error> {
    let level = |part: usize| -> Result<Cube, Error> {
        let bytes = content(engine, target, part)?;
        let rgb: Vec<f32> =
            floats(&bytes).chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        let face_size = (rgb.len() / 18).isqrt();
        Cube::new(face_size, rgb).map_err(|_| Error::Lost { what: "a map to export".to_owned() })
    };
    (0..target.parts.len()).map(level).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|value| f32::from_le_bytes(*value)).collect()
}

fn pairs(bytes: &[u8]) -> Vec<[f32; 2]> {
    floats(bytes).as_chunks::<2>().0.to_vec()
}
