//! Files without a project: environments, cubes that any tool baked, shaders.

use std::path::{Path, PathBuf};

use kiln_check::{ChainKind, ChainSubject, Check, Finding, Subject, check_chain, check_environment};
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_image::{Cancel, Cancelled, Cube, DecodeError, DecodedEnvironment, Environment, Limits, ktx2};

use super::Session;
use crate::args::{HealthArgs, SubjectArgs};
use crate::commands::shader;

/// Bytes of memory that checking takes for each texel: decoded, mended, sorted.
const BYTES_PER_TEXEL: u64 = 48;

/// What may be decoded within `--memory`.
pub(super) fn limits(args: &HealthArgs) -> Limits {
    let usual = Limits::default();
    let texels = args.run.memory.map_or(usual.texels_max, |bytes| (bytes / BYTES_PER_TEXEL) as usize);
    Limits { texels_max: texels.min(usual.texels_max), ..usual }
}

pub(super) fn check(all: &mut Session, path: &Path) -> anyhow::Result<()> {
    if shader::is_shader(path) {
        return check_shader(all, path);
    }
    let name = path.display().to_string();
    let limits = limits(all.args);
    let bytes = match read(path, &limits) {
        Ok(bytes) => bytes,
        Err(reason) => {
            all.subjects.push(unreadable(&name, &reason));
            return Ok(());
        }
    };
    match chain_of(&bytes, &limits) {
        Some(Ok(chain)) => {
            let (source, with_pictures) = (all.source, all.with_pictures());
            all.add(&name, "chain", |cancel| {
                let kind = if chain.levels.len() > 1 || source.is_some() {
                    ChainKind::Radiance
                } else {
                    ChainKind::Single
                };
                let subject = ChainSubject {
                    name: &name,
                    kind,
                    levels: &chain.levels,
                    format: Some(chain.format),
                    scale_log2: chain.scale_log2,
                    source,
                    lookup: None,
                    asked: None,
                    measured: None,
                };
                check_chain(&subject, with_pictures, cancel)
            });
        }
        Some(Err(reason)) => all.subjects.push(unreadable(&name, &reason)),
        None => add_environment(all, &name, |cancel| {
            kiln_image::decode_environment(&bytes, None, &limits, cancel)
        }),
    }
    Ok(())
}

/// Decodes and checks an environment.
pub(super) fn add_environment(
    all: &mut Session,
    name: &str,
    decode: impl FnOnce(Cancel) -> Result<DecodedEnvironment, DecodeError>,
) {
    let with_pictures = all.with_pictures();
    all.add(name, "environment", |cancel| match decode(cancel) {
        Err(DecodeError::Cancelled(cancelled)) => Err(cancelled),
        Err(error) => Ok(unreadable(name, &error.to_string())),
        Ok(decoded) => {
            let mut subject = check_environment(name, &decoded, with_pictures, cancel)?;
            // Nobody needs to be told that a panorama is one.
            for note in decoded.notes.iter().skip(1) {
                subject.fact("note", note.clone());
            }
            let is_container = matches!(decoded.environment, Environment::Cube(_))
                && ["KTX1", "DDS"].contains(&decoded.format);
            if is_container {
                subject.skip(
                    "levels below the first",
                    format!("only level 0 of a {} file is read", decoded.format),
                );
            }
            Ok(subject)
        }
    });
}

/// A cube map with all its levels.
struct Chain {
    levels: Vec<Cube>,
    format: ktx2::Format,
    scale_log2: i32,
}

/// The chain of a KTX2 cube; `None` where the file is something else.
fn chain_of(bytes: &[u8], limits: &Limits) -> Option<Result<Chain, String>> {
    if !bytes.starts_with(&ktx2::IDENTIFIER) {
        return None;
    }
    let texture = match ktx2::read(bytes) {
        Ok(texture) if texture.faces == 6 => texture,
        // Other formats and flat pictures: level 0 as an environment, or the reason why not.
        _ => return None,
    };
    if texture.width.saturating_mul(texture.width).saturating_mul(6) > limits.texels_max {
        return Some(Err(format!(
            "its faces of {0} × {0} are over the limit of {1} texels",
            texture.width, limits.texels_max
        )));
    }
    let key = texture.key_values.iter().find(|(key, _)| key == "KilnScaleLog2");
    let scale_log2 = key.and_then(|(_, value)| value.parse().ok()).unwrap_or(0);
    let scale = (f64::from(scale_log2)).exp2() as f32;
    let mut levels = Vec::new();
    for (index, bytes) in texture.levels.iter().enumerate() {
        let size = (texture.width >> index).max(1);
        let values = texture.format.decode_image(size, size, bytes);
        let values = values.ok_or_else(|| format!("level {index} has another length than its size asks for"));
        let channels = texture.format.channels();
        let cube = values.and_then(|values| {
            // What a format has no channel for is no light.
            let colour = |texel: &[f32]| [0, 1, 2].map(|i| texel.get(i).copied().unwrap_or(0.0) * scale);
            let rgb = values.chunks_exact(channels).flat_map(colour).collect();
            Cube::new(size, rgb).map_err(|error| error.to_string())
        });
        match cube {
            Ok(cube) => levels.push(cube),
            Err(reason) => return Some(Err(reason)),
        }
    }
    Some(Ok(Chain { levels, format: texture.format, scale_log2 }))
}

/// A file's bytes, unless it is longer than anything within the limits.
pub(super) fn read(path: &Path, limits: &Limits) -> Result<Vec<u8>, String> {
    let length = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
    // 32-bit floats of four channels, and all levels of a chain.
    let most = limits.texels_max as u64 * 16 * 4 / 3 + (1 << 20);
    if length > most {
        return Err(format!("its {length} bytes are over the limit of {most}; `--memory` allows more"));
    }
    std::fs::read(path).map_err(|error| error.to_string())
}

pub(super) fn unreadable(name: &str, reason: &str) -> Subject {
    let mut subject = Subject::new(name, "file");
    subject.findings.push(Finding::new(Check::Unreadable, Severity::Error, reason.to_owned()));
    subject.skip("everything else", "the file cannot be read");
    subject
}

fn check_shader(all: &mut Session, path: &Path) -> anyhow::Result<()> {
    let args = SubjectArgs {
        files: vec![path.to_owned()],
        variants: Vec::new(),
        defines: Vec::new(),
        include_dirs: Vec::<PathBuf>::new(),
        prelude: Vec::new(),
    };
    add_shaders(all, &args, |name| name.to_owned())
}

/// Compiles and lints; the compiler's own limits on time and memory hold.
pub(super) fn add_shaders(
    all: &mut Session,
    args: &SubjectArgs,
    name_of: impl Fn(&str) -> String,
) -> anyhow::Result<()> {
    for linted in shader::lint_all(args)? {
        let name = name_of(&linted.name);
        all.add(&name, "shader", |_| Ok::<Subject, Cancelled>(shader_subject(&name, &linted)));
        if let Some(subject) = all.subjects.last_mut() {
            subject.ms = linted.ms;
        }
    }
    Ok(())
}

fn shader_subject(name: &str, linted: &shader::Linted) -> Subject {
    let mut subject = Subject::new(name, "shader");
    let files = linted.files.join(", ");
    subject.fact("variants", format!("{} of {} compile; {files}", linted.good, linted.variants));
    subject.findings.extend(linted.diagnostics.iter().map(finding));
    subject
}

/// A message of the compiler as a finding.
fn finding(diagnostic: &Diagnostic) -> Finding {
    let check = if diagnostic.is_error() { Check::ShaderCompile } else { Check::ShaderLint };
    let mut finding = Finding::new(check, diagnostic.severity, diagnostic.message.clone());
    finding.places = match (&diagnostic.file, &diagnostic.span) {
        (Some(file), Some(span)) => {
            vec![format!("{file}:{}:{}: {}", span.line, span.column, span.source_line.trim())]
        }
        (Some(file), None) => vec![file.clone()],
        (None, _) => Vec::new(),
    };
    finding.places.extend(diagnostic.notes.iter().cloned());
    finding.help = diagnostic.help.clone();
    finding
}
