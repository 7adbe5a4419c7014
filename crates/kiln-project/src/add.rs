//! Environments and scenes that somebody brings: their files are copied into the project, and kiln.toml names them.

use std::fs::{self, File, OpenOptions};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use kiln_build::{Digest, SOURCE_BYTES_MAX};
use kiln_diagnostic::{Diagnostic, has_errors};

use crate::replace::{read_text, replace_text};
use crate::{PROJECT_FILE, Project, Role, parse_project};

/// Where copies of environments go.
const ENV_FOLDER: &str = "environments";
/// Where copies of scenes go, each with its files in a folder of its own.
const SCENE_FOLDER: &str = "scenes";
/// Largest glTF file: it is read whole to learn what it refers to.
const SCENE_BYTES_MAX: u64 = 1 << 30;
/// Files that a glTF file may refer to.
const REFERENCES_MAX: usize = 10_000;
/// Same names that are tried with a number behind them.
const SUFFIX_MAX: usize = 10_000;
/// Letters of a name.
const NAME_CHARS_MAX: usize = 64;

/// What became of files that were brought.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Added {
    /// Groups of targets that they make, as `env/sky`, in the files' order; also of those that were there before.
    pub targets: Vec<String>,
    /// What was done, a sentence for each file.
    pub messages: Vec<String>,
    /// Why the others were not taken.
    pub refused: Vec<Diagnostic>,
}

/// Adds files to the project in `folder`: panoramas and cubes as `[env.NAME]`, glTF files with all they refer to as
/// `[scene.NAME]`. What lies in the project already is not copied. A file that is refused does not keep the others out; if
/// kiln.toml cannot be changed, no copy stays.
pub fn add_files(folder: &Path, paths: &[PathBuf]) -> Added {
    let mut added = Added::default();
    if let Err(fault) = try_add(folder, paths, &mut added) {
        added = Added { refused: vec![*fault], ..Added::default() };
    }
    added
}

fn try_add(folder: &Path, paths: &[PathBuf], added: &mut Added) -> Result<(), Box<Diagnostic>> {
    let before = read_text(folder, PROJECT_FILE)?;
    let folder = folder.canonicalize().map_err(|error| refusal(folder, &error.to_string()))?;
    let mut text = before.text.clone();
    let mut copies = Copies { folder: &folder, made: Vec::new() };
    // Scenes last: they name an environment.
    let mut sorted: Vec<&PathBuf> = paths.iter().collect();
    sorted.sort_by_key(|path| Kind::of(path) == Some(Kind::Scene));
    for path in sorted {
        let kept = copies.made.len();
        match add_file(&mut copies, &text, path) {
            Ok(addition) => {
                added.targets.push(addition.target);
                added.messages.push(addition.message);
                text = addition.project_text.unwrap_or(text);
            }
            Err(fault) => {
                copies.drop_after(kept);
                added.refused.push(*fault);
            }
        }
    }
    if text == before.text {
        return Ok(());
    }
    let replaced = replace_text(&folder, PROJECT_FILE, &before.digest, &text);
    if replaced.is_err() {
        copies.drop_after(0);
    }
    replaced
}

/// What one file makes of the project.
struct Addition {
    target: String,
    message: String,
    /// kiln.toml, if it changes.
    project_text: Option<String>,
}

fn add_file(copies: &mut Copies<'_>, text: &str, path: &Path) -> Result<Addition, Box<Diagnostic>> {
    let (kind, bytes) = examine(path)?;
    let name = |fallback: &str| stem_name(path).unwrap_or_else(|| fallback.to_owned());
    let (project, faults) = parse_project(text);
    if let Some(fault) = faults.into_iter().find(Diagnostic::is_error) {
        return Err(fault.with_note("kiln.toml takes nothing new while this is wrong").into());
    }
    let in_project = relative(copies.folder, path, &project)?;
    if let Some(known) = in_project.as_deref().and_then(|source| kind.named(&project, source)) {
        let (target, message) =
            (kind.target(&known), format!("{} is {} `{known}` already", shown(path), kind.noun()));
        return Ok(Addition { target, message, project_text: None });
    }
    let source = match in_project {
        Some(source) => source,
        None => copies.copy(kind, path, bytes)?,
    };
    let name = free(&name(kind.noun()), |name| kind.has(&project, name));
    let project_text = with_section(text, &project, kind, &name, &source)?;
    let message = format!("added {} `{name}`: {source}", kind.noun());
    Ok(Addition { target: kind.target(&name), message, project_text: Some(project_text) })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Env,
    Scene,
}

impl Kind {
    fn of(path: &Path) -> Option<Kind> {
        match extension(path).as_str() {
            "hdr" | "exr" | "ktx" | "ktx2" | "dds" => Some(Kind::Env),
            "gltf" | "glb" => Some(Kind::Scene),
            _ => None,
        }
    }

    fn noun(self) -> &'static str {
        match self {
            Kind::Env => "environment",
            Kind::Scene => "scene",
        }
    }

    fn table(self) -> &'static str {
        match self {
            Kind::Env => "env",
            Kind::Scene => "scene",
        }
    }

    fn target(self, name: &str) -> String {
        format!("{}/{name}", self.table())
    }

    fn has(self, project: &Project, name: &str) -> bool {
        match self {
            Kind::Env => project.envs.contains_key(name),
            Kind::Scene => project.scenes.contains_key(name),
        }
    }

    /// Its name in the project, if it has this source.
    fn named(self, project: &Project, source: &str) -> Option<String> {
        let mut envs = project.envs.iter().filter(|(_, env)| env.sources == [source]);
        let mut scenes = project.scenes.iter().filter(|(_, scene)| scene.source == source);
        match self {
            Kind::Env => envs.next().map(|(name, _)| name.clone()),
            Kind::Scene => scenes.next().map(|(name, _)| name.clone()),
        }
    }
}

/// What a file is, by its name and its first bytes, and its length.
fn examine(path: &Path) -> Result<(Kind, u64), Box<Diagnostic>> {
    let refuse = |why: &str| refusal(path, why);
    let metadata = fs::metadata(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => refuse("is not there"),
        _ => refuse(&format!("cannot be read: {error}")),
    })?;
    if metadata.is_dir() {
        return Err(refuse("is a folder").with_help("bring the .hdr, .exr, .gltf or .glb in it").into());
    }
    if !metadata.is_file() {
        return Err(refuse("is no ordinary file").into());
    }
    let kind = Kind::of(path).ok_or_else(|| {
        let help = "environments are .hdr, .exr, .ktx, .ktx2 and .dds files, scenes .gltf and .glb";
        refuse("is neither an environment nor a scene").with_help(help)
    })?;
    let limit = if kind == Kind::Scene { SCENE_BYTES_MAX } else { SOURCE_BYTES_MAX };
    let gib = |bytes: u64| bytes as f64 / (1_u64 << 30) as f64;
    if metadata.len() > limit {
        return Err(refuse(&format!(
            "has {:.1} GiB; files of up to {} GiB are taken",
            gib(metadata.len()),
            gib(limit)
        ))
        .into());
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(64).read_to_end(&mut start));
    read.map_err(|error| refuse(&format!("cannot be read: {error}")))?;
    let is_as_named = match extension(path).as_str() {
        "hdr" => start.starts_with(b"#?"),
        "exr" => start.starts_with(&[0x76, 0x2f, 0x31, 0x01]),
        "ktx" | "ktx2" => start.starts_with(b"\xabKTX "),
        "dds" => start.starts_with(b"DDS "),
        "glb" => start.starts_with(b"glTF"),
        _ => start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start).trim_ascii_start().starts_with(b"{"),
    };
    if !is_as_named {
        return Err(refuse(&format!("does not hold what .{} files begin with", extension(path))).into());
    }
    Ok((kind, metadata.len()))
}

fn refusal(path: &Path, why: &str) -> Diagnostic {
    Diagnostic::error(format!("{} {why}; it was not added", shown(path)))
}

/// A file's name for messages.
fn shown(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |extension| extension.to_string_lossy().to_lowercase())
}

/// A file's name without its extension, as far as kiln.toml takes it for a name.
fn stem_name(path: &Path) -> Option<String> {
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    let fits = |character: char| character.is_ascii_alphanumeric() || "-_".contains(character);
    let name: String = stem.chars().take(NAME_CHARS_MAX).map(|it| if fits(it) { it } else { ' ' }).collect();
    let name = name.split_whitespace().collect::<Vec<_>>().join("_");
    (!name.is_empty()).then_some(name)
}

/// The name, or the name with the first number behind it that is free.
fn free(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..SUFFIX_MAX).map(|number| format!("{name}-{number}"));
    std::iter::once(name.to_owned())
        .chain(numbered)
        .find(|name| !is_taken(name))
        .unwrap_or_else(|| name.to_owned())
}

/// The path of a file that lies in the project, relative to it.
fn relative(folder: &Path, path: &Path, project: &Project) -> Result<Option<String>, Box<Diagnostic>> {
    let full = path.canonicalize().map_err(|error| refusal(path, &error.to_string()))?;
    let Ok(relative) = full.strip_prefix(folder) else { return Ok(None) };
    if relative.starts_with(&project.output_dir) {
        let why = format!("lies in `{}`, whose files Kiln overwrites", project.output_dir);
        return Err(refusal(path, &why).with_help("copy it elsewhere and bring the copy").into());
    }
    let relative = relative.to_str().filter(|path| !path.contains(['\\', '\n', '\r', '\t']));
    let relative = relative.ok_or_else(|| refusal(path, "has a path that kiln.toml cannot hold"))?;
    Ok(Some(relative.to_owned()))
}

/// kiln.toml with one section more, at its end; everything before it stays as it is.
fn with_section(
    text: &str,
    project: &Project,
    kind: Kind,
    name: &str,
    source: &str,
) -> Result<String, Box<Diagnostic>> {
    let mut lines = vec![format!("[{}.{name}]", kind.table()), format!("source = {}", quoted(source))];
    if kind == Kind::Scene {
        let fault = |what: &str| Diagnostic::error(format!("a scene needs {what}; `{name}` was not added"));
        let env = project
            .envs
            .keys()
            .next()
            .ok_or_else(|| fault("an environment").with_help("bring a panorama too"))?;
        let mut shaders = project.shaders.iter().filter(|(_, shader)| shader.role == Role::Material);
        let first = shaders.next().map(|(name, _)| name);
        let shader = project.shaders.get_key_value("pbr").map(|(name, _)| name).or(first);
        let shader = shader.ok_or_else(|| fault("a shader with the role `material`"))?;
        lines.push(format!("env = {}", quoted(env)));
        lines.push(format!("shader = {}", quoted(shader)));
    }
    let newline = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let gap = if text.is_empty() || text.ends_with('\n') { newline.to_owned() } else { newline.repeat(2) };
    let extended = format!("{text}{gap}{}{newline}", lines.join(newline));
    // `env = { … }` at the top takes no tables: what was there must be as it was, and the new one too.
    let (found, faults) = parse_project(&extended);
    let is_kept = project.envs.iter().all(|(name, env)| found.envs.get(name) == Some(env))
        && project.scenes.iter().all(|(name, scene)| found.scenes.get(name) == Some(scene))
        && found.shaders == project.shaders;
    if has_errors(&faults) || !is_kept || !kind.has(&found, name) {
        let fault = Diagnostic::error(format!("kiln.toml takes no `[{}.{name}]` at its end", kind.table()));
        return Err(fault
            .in_file(PROJECT_FILE)
            .with_help(format!("add it by hand: {}", lines[1..].join(", ")))
            .into());
    }
    Ok(extended)
}

/// A TOML basic string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Files and folders that were made in the project.
struct Copies<'a> {
    folder: &'a Path,
    made: Vec<PathBuf>,
}

impl Copies<'_> {
    /// Copies a file, with all it refers to; returns its path relative to the project.
    fn copy(&mut self, kind: Kind, path: &Path, bytes: u64) -> Result<String, Box<Diagnostic>> {
        let file = file_name(path);
        if kind == Kind::Env {
            return self.copy_alone(ENV_FOLDER, &file, path, bytes);
        }
        let references = references(path)?;
        if references.is_empty() {
            return self.copy_alone(SCENE_FOLDER, &file, path, bytes);
        }
        let own = stem_name(path).unwrap_or_else(|| "scene".to_owned());
        let own = free(&own, |name| self.folder.join(SCENE_FOLDER).join(name).exists());
        let target = self.folder.join(SCENE_FOLDER).join(&own);
        fs::create_dir_all(&target).map_err(|error| refusal(path, &format!("cannot be copied: {error}")))?;
        self.made.push(target.clone());
        copy_to(path, &target.join(&file), path, bytes)?;
        for Reference { from, to, bytes } in references {
            copy_to(&from, &target.join(to), path, bytes)?;
        }
        Ok(format!("{SCENE_FOLDER}/{own}/{file}"))
    }

    /// Copies a file, unless its copy is there already.
    fn copy_alone(
        &mut self,
        folder: &str,
        file: &str,
        from: &Path,
        bytes: u64,
    ) -> Result<String, Box<Diagnostic>> {
        let (stem, extension) = file.rsplit_once('.').unwrap_or((file, ""));
        let named = |stem: &str| format!("{folder}/{stem}.{extension}");
        let place = |stem: &str| self.folder.join(named(stem));
        let stem = free(stem, |stem| place(stem).exists() && !is_same(&place(stem), from, bytes));
        let to = place(&stem);
        if !to.exists() {
            copy_to(from, &to, from, bytes)?;
            self.made.push(to);
        }
        Ok(named(&stem))
    }

    /// Removes what was made after the first `kept`.
    fn drop_after(&mut self, kept: usize) {
        for made in self.made.drain(kept..) {
            // What cannot be removed is in nobody's way: kiln.toml does not name it.
            let _ = if made.is_dir() { fs::remove_dir_all(made) } else { fs::remove_file(made) };
        }
    }
}

/// A file's name as any system and kiln.toml take it.
fn file_name(path: &Path) -> String {
    let stem = stem_name(path).unwrap_or_else(|| "file".to_owned());
    format!("{stem}.{}", extension(path))
}

/// Whether two files have the same content; `bytes` is the length of the second.
fn is_same(one: &Path, other: &Path, bytes: u64) -> bool {
    let digest = |path: &Path| File::open(path).and_then(|mut file| Digest::of_reader(&mut file)).ok();
    let has_length = fs::metadata(one).is_ok_and(|metadata| metadata.is_file() && metadata.len() == bytes);
    has_length && digest(one).is_some_and(|one| Some(one) == digest(other))
}

/// Copies a file of `bytes` to where nothing is; `subject` is what messages are about.
fn copy_to(from: &Path, to: &Path, subject: &Path, bytes: u64) -> Result<(), Box<Diagnostic>> {
    let copy = || -> std::io::Result<u64> {
        fs::create_dir_all(to.parent().unwrap_or(to))?;
        let source = File::open(from)?;
        let mut target = OpenOptions::new().write(true).create_new(true).open(to)?;
        // One byte more than expected tells of a file that still grows.
        let copied = std::io::copy(&mut source.take(bytes + 1), &mut target)?;
        target.sync_data()?;
        Ok(copied)
    };
    let fault = match copy() {
        Ok(copied) if copied == bytes => return Ok(()),
        Ok(_) => refusal(subject, "is being written").with_help("bring it again when it is whole"),
        Err(error) => refusal(subject, &format!("cannot be copied: {}: {error}", shown(from))),
    };
    // A part of it is of no use.
    let _ = fs::remove_file(to);
    Err(fault.into())
}

/// A file that a scene refers to.
struct Reference {
    from: PathBuf,
    /// Relative to the scene's folder.
    to: String,
    bytes: u64,
}

/// What a glTF file refers to; all of it must lie beside or below it, so that its copy finds it in the same way.
fn references(path: &Path) -> Result<Vec<Reference>, Box<Diagnostic>> {
    let bytes = fs::read(path).map_err(|error| refusal(path, &format!("cannot be read: {error}")))?;
    let name = shown(path);
    // Without a folder in its name, whatever leaves its folder counts as leaving the project.
    let (uris, faults) = kiln_scene::external_uris(&name, &bytes);
    if let Some(fault) = faults.into_iter().next() {
        let help = "copy the whole folder into the project and bring the scene from there";
        return Err(fault.with_note(format!("{name} was not added")).with_help(help).into());
    }
    if uris.len() > REFERENCES_MAX {
        return Err(refusal(path, &format!("refers to more than {REFERENCES_MAX} files")).into());
    }
    let mut found: Vec<Reference> = Vec::new();
    for uri in uris {
        let from = path.parent().unwrap_or(Path::new("")).join(&uri.path);
        let metadata = fs::metadata(&from).ok().filter(fs::Metadata::is_file);
        let bytes = metadata.map(|metadata| metadata.len());
        let bytes = bytes
            .ok_or_else(|| refusal(path, &format!("refers to `{}`, which is no file", uri.reference)))?;
        if !found.iter().any(|reference| reference.to == uri.path) {
            found.push(Reference { from, to: uri.path, bytes });
        }
    }
    if found.iter().map(|reference| reference.bytes).sum::<u64>() > SOURCE_BYTES_MAX {
        let gib = SOURCE_BYTES_MAX >> 30;
        return Err(refusal(path, &format!("refers to files of more than {gib} GiB together")).into());
    }
    Ok(found)
}
