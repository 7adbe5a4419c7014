//! A project: its environments, what was baked of them, its shaders.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use kiln_bake::ShCoefficients;
use kiln_build::{Engine, Target, Targets};
use kiln_check::{ChainKind, ChainSubject, Subject, check_chain, check_harmonics};
use kiln_diagnostic::Diagnostic;
use kiln_image::{
    Cancel, Cancelled, Cube, DecodeError, DecodedEnvironment, Environment, decode_environment,
    environment_from_faces,
};
use kiln_project::{EnvConfig, FORMATS, Project, TexelPolicy, Wishes, decode_level};
use kiln_sphere::{cube_face_st, panorama_uv};
use serde_json::Value;

use super::{Session, file};
use crate::args::SubjectArgs;
use crate::commands::export::with_progress;
use crate::{place, report};

pub(super) fn check(all: &mut Session, dir: &Path) -> anyhow::Result<()> {
    let engine = place::open_engine(dir)?;
    let _hold = engine.store().hold();
    let built = with_progress(&all.args.run, |options| {
        kiln_project::build_with(&engine, None, Wishes::default(), options)
    });
    let built = built.context("building")?.context("the build was cancelled")?;
    engine.save_memory().context("remembering the build")?;
    let project = &built.plan.project;
    all.allowances.extend(project.allowances.iter().cloned());
    let errors: Vec<Diagnostic> =
        built.diagnostics.iter().filter(|diagnostic| diagnostic.is_error()).cloned().collect();
    if !all.args.run.json {
        report::print_diagnostics(&errors, true);
    }
    for (name, env) in &project.envs {
        check_environment(all, &engine, name, env);
    }
    for (name, target) in built.targets.iter() {
        check_target(all, &engine, project, name, target);
    }
    for env in project.envs.keys().filter(|env| !is_baked(&built.targets, env)) {
        let mut subject = Subject::new(format!("env/{env}/specular"), "chain");
        subject.skip("chain", "nothing is baked of this environment: it has an error, or no scene reads it");
        all.subjects.push(subject);
    }
    let args = SubjectArgs {
        files: vec![dir.to_owned()],
        variants: Vec::new(),
        defines: Vec::new(),
        include_dirs: Vec::new(),
        prelude: Vec::new(),
    };
    file::add_shaders(all, &args, |name| format!("shader/{name}"))?;
    #[cfg(feature = "preview")]
    super::furnace::check(all, &engine, project)?;
    #[cfg(not(feature = "preview"))]
    {
        let mut subject = Subject::new("furnace", "furnace");
        let reason = match all.args.no_furnace {
            true => "`--no-furnace` leaves it out",
            false => "this kiln was built without the preview, which draws",
        };
        subject.skip("furnace", reason);
        all.subjects.push(subject);
    }
    Ok(())
}

fn is_baked(targets: &Targets, env: &str) -> bool {
    targets.contains_key(&format!("env/{env}/specular"))
}

fn check_environment(all: &mut Session, engine: &Engine, name: &str, env: &EnvConfig) {
    let name = format!("env/{name}");
    let limits = file::limits(all.args);
    let read = |source: &String| {
        file::read(&engine.folder().join(source), &limits).map_err(|reason| format!("{source}: {reason}"))
    };
    let files = match env.sources.iter().map(read).collect::<Result<Vec<_>, _>>() {
        Ok(files) => files,
        Err(reason) => return all.subjects.push(file::unreadable(&name, &reason)),
    };
    file::add_environment(all, &name, |cancel| decode(env, &files, &limits, cancel));
}

fn decode(
    env: &EnvConfig,
    files: &[Vec<u8>],
    limits: &kiln_image::Limits,
    cancel: Cancel,
) -> Result<DecodedEnvironment, DecodeError> {
    let files: Vec<&[u8]> = files.iter().map(Vec::as_slice).collect();
    match <[&[u8]; 6]>::try_from(files.as_slice()) {
        Ok(faces) => environment_from_faces(faces, limits, cancel),
        Err(_) => decode_environment(files.first().copied().unwrap_or_default(), env.layout, limits, cancel),
    }
}

fn check_target(all: &mut Session, engine: &Engine, project: &Project, name: &str, target: &Target) {
    let Some((env, map)) = name.strip_prefix("env/").and_then(|rest| rest.split_once('/')) else { return };
    let Some(config) = project.envs.get(env) else { return };
    let read = |index: usize| engine.store().get(&target.parts.get(index)?.digest);
    match map {
        "skybox" | "specular" | "sheen" | "irradiance" => {
            let with_pictures = all.with_pictures();
            all.add(name, "chain", |cancel| {
                let levels: Option<Vec<Cube>> =
                    (0..target.parts.len()).map(|index| level(target, index, &read(index)?)).collect();
                let Some(levels) = levels else {
                    let mut subject = Subject::new(name, "chain");
                    subject.skip("chain", "a level is missing in the cache; `kiln doctor --deep` says more");
                    return Ok(subject);
                };
                let source = read_source(engine, config, cancel)?;
                // Where a policy changes the light on the way, its mean is another one.
                let is_changed = config.is_sun_extracted || config.radiance_max.is_some();
                let facts = match &source {
                    Some(source) if !is_changed => Some(kiln_check::mean_radiance(source, cancel)?),
                    _ => None,
                };
                let of_source = |direction: [f64; 3]| {
                    source.as_ref().map_or([0.0; 3], |source| radiance(&source.environment, direction))
                };
                let subject = ChainSubject {
                    name,
                    kind: match map {
                        "irradiance" => ChainKind::Single,
                        "sheen" => ChainKind::Sheen,
                        _ => ChainKind::Radiance,
                    },
                    levels: &levels,
                    format: format(target),
                    scale_log2: number(target, "scale_log2").unwrap_or(0) as i32,
                    source: facts,
                    lookup: source.is_some().then_some(&of_source),
                    asked: Some(config.error),
                    measured: measured(target),
                };
                check_chain(&subject, with_pictures, cancel)
            });
        }
        "sh" => {
            let text = read(0);
            let irradiance = text.and_then(|text| harmonics(&text, "irradiance_over_pi"));
            match irradiance {
                Some(irradiance) => {
                    all.add(name, "harmonics", |_| {
                        Ok::<_, Cancelled>(check_harmonics(name, "irradiance", &irradiance))
                    });
                }
                None => {
                    let mut subject = Subject::new(name, "harmonics");
                    subject.skip("harmonics", "the coefficients are missing in the cache");
                    all.subjects.push(subject);
                }
            }
        }
        _ => {}
    }
}

fn number(target: &Target, key: &str) -> Option<i64> {
    target.meta.get(key).and_then(Value::as_i64)
}

fn format(target: &Target) -> Option<kiln_image::ktx2::Format> {
    let name = target.meta.get("format").and_then(Value::as_str)?;
    FORMATS.iter().find(|(known, _)| *known == name).map(|(_, format)| format.ktx2())
}

fn level(target: &Target, index: usize, bytes: &Arc<[u8]>) -> Option<Cube> {
    let first = number(target, "first_level").unwrap_or(0) as usize;
    let size = (usize::try_from(number(target, "size")?).ok()? >> (first + index)).max(1);
    let name = target.meta.get("format").and_then(Value::as_str)?;
    let format = FORMATS.iter().find(|(known, _)| *known == name)?.1;
    decode_level(bytes, size, format, number(target, "scale_log2").unwrap_or(0) as i32)
}

/// The largest error among the levels that the bake measured.
fn measured(target: &Target) -> Option<f64> {
    let levels = target.meta.get("measured").and_then(Value::as_array).into_iter().flatten();
    levels.filter_map(|level| level.get("rms")?.as_f64()).reduce(f64::max)
}

/// What maps were made of, mended as the bake mends it.
fn read_source(
    engine: &Engine,
    env: &EnvConfig,
    cancel: Cancel,
) -> Result<Option<DecodedEnvironment>, Cancelled> {
    let files: Option<Vec<Vec<u8>>> =
        env.sources.iter().map(|source| std::fs::read(engine.folder().join(source)).ok()).collect();
    let Some(files) = files else { return Ok(None) };
    let mut decoded = match decode(env, &files, &kiln_image::Limits::default(), cancel) {
        Ok(decoded) => decoded,
        Err(DecodeError::Cancelled(cancelled)) => return Err(cancelled),
        Err(_) => return Ok(None),
    };
    if env.texels == TexelPolicy::Repair {
        kiln_image::repair_texels(&mut decoded, cancel)?;
    }
    Ok(Some(decoded))
}

/// The texel in a direction.
fn radiance(environment: &Environment, direction: [f64; 3]) -> [f32; 3] {
    let index = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
    match environment {
        Environment::Panorama(panorama) => {
            let [u, v] = panorama_uv(direction);
            panorama.texel(index(u, panorama.width()), index(v, panorama.height()))
        }
        Environment::Cube(cube) => {
            let (face, [s, t]) = cube_face_st(direction);
            cube.texel(face, index(0.5 * (s + 1.0), cube.face_size), index(0.5 * (t + 1.0), cube.face_size))
        }
    }
}

fn harmonics(text: &[u8], key: &str) -> Option<ShCoefficients> {
    let facts: Value = serde_json::from_slice(text).ok()?;
    let coefficients: Vec<[f64; 3]> = serde_json::from_value(facts.get(key)?.clone()).ok()?;
    let order = usize::isqrt(coefficients.len()).checked_sub(1)?;
    Some(ShCoefficients { order, coefficients })
}
