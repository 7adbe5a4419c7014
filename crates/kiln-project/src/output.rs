//! Baked files for engines and `manifest.json` for CI.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Component, Path};
use std::sync::Arc;

use kiln_build::{
    Digest, Engine, Error, FilesOfTarget, Store, Target, TargetState, Targets, write_atomically,
};
use kiln_image::ktx2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::env_config::FORMATS;
use crate::plan::Wishes;

/// Version of the manifest's form.
const MANIFEST_SCHEMA: u32 = 1;
/// Version of the code that makes files of targets: raise it whenever the same target may give other bytes.
const WRITER_RECIPE: u32 = 1;
/// Name of the manifest in the folder of baked files.
pub const MANIFEST_FILE: &str = "manifest.json";

/// What a folder of baked files holds: sorted, without times or absolute paths, so that it can be committed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this form.
    pub schema: u32,
    /// Version of the code that made the files.
    #[serde(default)]
    pub writer: u32,
    /// Target name to what it is.
    pub targets: BTreeMap<String, ManifestTarget>,
}

/// One target in the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManifestTarget {
    /// As `cube` or `shader`.
    pub kind: String,
    /// Digest of kind, facts and contents.
    pub sha256: Digest,
    /// Whether it matches its sources.
    pub state: TargetState,
    /// Files, relative to the manifest, with the digest and length of each.
    pub files: BTreeMap<String, ManifestFile>,
    /// Sizes, formats, stated errors, recipe and parameters.
    pub facts: Value,
}

/// A file in the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManifestFile {
    /// Digest of the file.
    pub sha256: Digest,
    /// Its length.
    pub bytes: u64,
}

impl Manifest {
    /// Reads a manifest from its text; `None` if it is none, or of another schema.
    pub fn parse(text: &[u8]) -> Option<Manifest> {
        let manifest: Option<Manifest> = serde_json::from_slice(text).ok();
        manifest.filter(|manifest| manifest.schema == MANIFEST_SCHEMA)
    }

    /// Length of all files.
    pub fn bytes(&self) -> u64 {
        self.targets.values().map(ManifestTarget::bytes).fold(0, u64::saturating_add)
    }

    fn text(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec_pretty(self).unwrap_or_default();
        text.push(b'\n');
        text
    }
}

impl ManifestTarget {
    /// Length of its files.
    pub fn bytes(&self) -> u64 {
        self.files.values().map(|file| file.bytes).fold(0, u64::saturating_add)
    }
}

/// What [`write_outputs`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// Files written, relative to the folder.
    pub written: Vec<String>,
    /// Files that were there already with the right content.
    pub kept: usize,
    /// Files of earlier builds that no target makes any more.
    pub removed: Vec<String>,
    /// What the folder holds now.
    pub manifest: Manifest,
}

/// The manifest that [`write_outputs`] would write.
///
/// # Errors
/// A target's content cannot be read from the store.
pub fn manifest_of(engine: &Engine, targets: &Targets) -> Result<Manifest, Error> {
    let mut manifest = empty_manifest();
    for (name, target) in targets.iter().filter(|(name, _)| !Wishes::is_extra(name)) {
        let sha256 = target.digest();
        let files = known_files(engine, name, target, sha256)?;
        manifest.targets.insert(name.clone(), manifest_target(target, sha256, &files));
    }
    Ok(manifest)
}

/// Writes every file that is not there as the targets make it, and the manifest. What a manifest in the folder says is
/// not believed.
///
/// # Errors
/// A file cannot be read from the store or written.
pub fn write_outputs(engine: &Engine, targets: &Targets, output_dir: &str) -> Result<Written, Error> {
    let folder = engine.folder().join(output_dir);
    // Two processes would mix their files.
    let _lock = lock_folder(&folder);
    let outputs = engine.outputs();
    outputs.refresh();
    let old_text = std::fs::read(folder.join(MANIFEST_FILE)).unwrap_or_default();
    let old = Manifest::parse(&old_text).unwrap_or_default();
    let manifest = manifest_of(engine, targets)?;
    let is_there = |path: &str, file: &ManifestFile| {
        outputs.state(&format!("{output_dir}/{path}")).digest() == Some(file.sha256)
    };
    let mut written = Written::default();
    let mut changed = Vec::new();
    for (name, target) in &manifest.targets {
        let missing: Vec<&String> =
            target.files.iter().filter(|(path, file)| !is_there(path, file)).map(|(path, _)| path).collect();
        written.kept += target.files.len() - missing.len();
        if !missing.is_empty() {
            changed.push((name, missing));
        }
    }
    let fs = engine.store().file_system();
    if !changed.is_empty() && !old_text.is_empty() {
        // Until the files are written nothing may vouch for them.
        let mut vouched = manifest.clone();
        changed.iter().for_each(|(name, _)| _ = vouched.targets.remove(*name));
        write_atomically(fs, &folder.join(MANIFEST_FILE), &vouched.text())?;
    }
    for (name, missing) in changed {
        for (path, bytes) in target_files(engine.store(), name, &targets[name])? {
            if missing.contains(&&path) {
                write_atomically(fs, &folder.join(&path), &bytes)?;
                written.written.push(path);
            }
        }
    }
    remove_orphans(&folder, &old, &manifest, &mut written);
    let text = manifest.text();
    if text != old_text {
        write_atomically(fs, &folder.join(MANIFEST_FILE), &text)?;
        written.written.push(MANIFEST_FILE.to_owned());
    }
    written.manifest = manifest;
    Ok(written)
}

/// Makes a folder and waits until no other process writes it; released when dropped. `None` where folders cannot be
/// locked.
pub fn lock_folder(folder: &Path) -> Option<File> {
    std::fs::create_dir_all(folder).ok()?;
    let file = File::open(folder).ok()?;
    file.lock().ok().map(|()| file)
}

fn empty_manifest() -> Manifest {
    Manifest { schema: MANIFEST_SCHEMA, writer: WRITER_RECIPE, targets: BTreeMap::new() }
}

/// What is made of a target: remembered, or made and noted.
fn known_files(engine: &Engine, name: &str, target: &Target, sha256: Digest) -> Result<FilesOfTarget, Error> {
    if let Some(known) = engine.files_of(name, sha256, WRITER_RECIPE) {
        return Ok(known);
    }
    let files = target_files(engine.store(), name, target)?;
    let files =
        files.iter().map(|(path, bytes)| (path.clone(), Digest::of(bytes), bytes.len() as u64)).collect();
    let files = FilesOfTarget { target: sha256, maker: WRITER_RECIPE, files };
    engine.note_files(name, files.clone());
    Ok(files)
}

fn manifest_target(target: &Target, sha256: Digest, files: &FilesOfTarget) -> ManifestTarget {
    let file = |(path, sha256, bytes): &(String, Digest, u64)| {
        (path.clone(), ManifestFile { sha256: *sha256, bytes: *bytes })
    };
    let files = files.files.iter().map(file).collect();
    ManifestTarget {
        kind: target.kind.clone(),
        sha256,
        state: target.state,
        files,
        facts: target.meta.clone(),
    }
}

fn remove_orphans(folder: &Path, old: &Manifest, new: &Manifest, written: &mut Written) {
    let files = |manifest: &Manifest| -> std::collections::BTreeSet<String> {
        manifest.targets.values().flat_map(|target| target.files.keys().cloned()).collect()
    };
    for path in files(old).difference(&files(new)) {
        // Only what an earlier manifest claims is touched, and only below the folder.
        let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        if inside && std::fs::remove_file(folder.join(path)).is_ok() {
            written.removed.push(path.clone());
        }
    }
}

/// Path and content.
type OutputFile = (String, Arc<[u8]>);

fn target_files(store: &Store, name: &str, target: &Target) -> Result<Vec<OutputFile>, Error> {
    let mut contents = Vec::with_capacity(target.parts.len());
    for part in &target.parts {
        let lost = || Error::Lost { what: format!("{} of {name}", part.name) };
        contents.push((part.name.as_str(), store.get(&part.digest).ok_or_else(lost)?));
    }
    Ok(match target.kind.as_str() {
        "cube" | "lut" => vec![(format!("{name}.ktx2"), texture_file(name, target, &contents).into())],
        "emit" => {
            // The last part of the name is the language, which the parts say.
            let stem = name.rsplit_once('/').map_or(name, |(stem, _)| stem);
            contents.into_iter().map(|(part, bytes)| (format!("{stem}.{part}"), bytes)).collect()
        }
        // The author has the textures already.
        "shader" => {
            let own = contents.into_iter().filter(|(part, _)| !part.starts_with("texture."));
            own.map(|(part, bytes)| (part_path(name, part), bytes)).collect()
        }
        _ => contents.into_iter().map(|(part, bytes)| (part_path(name, part), bytes)).collect(),
    })
}

fn part_path(name: &str, part: &str) -> String {
    match part {
        "glb" => format!("{name}.glb"),
        "json" => format!("{name}.json"),
        "wgsl" => format!("{name}.wgsl"),
        other => format!("{name}.{other}.json"),
    }
}

fn texture_file(name: &str, target: &Target, contents: &[(&str, Arc<[u8]>)]) -> Vec<u8> {
    let fact = |key: &str| target.meta.get(key).and_then(Value::as_u64).unwrap_or(1);
    // A chain of which the sharpest levels are not read begins where it is: its law says for what roughness.
    let first = target.meta.get("first_level").and_then(Value::as_u64).unwrap_or(0).min(63);
    let size = usize::try_from((fact("size") >> first).max(1)).unwrap_or(usize::MAX);
    let width = target.meta.get("width").map_or(size, |_| usize::try_from(fact("width")).unwrap_or(size));
    let format = target.meta.get("format").and_then(Value::as_str).unwrap_or_default();
    let known = FORMATS.iter().find(|(name, _)| *name == format);
    let format = known.map_or(ktx2::Format::R32G32_SFLOAT, |(_, format)| format.ktx2());
    let mut key_values = vec![("KilnTarget".to_owned(), name.to_owned())];
    for (key, fact) in [
        ("KilnScaleLog2", "scale_log2"),
        ("KilnLaw", "law"),
        ("KilnFirstLevel", "first_level"),
        ("KilnLevels", "levels_of_law"),
    ] {
        if let Some(value) = target.meta.get(fact) {
            key_values
                .push((key.to_owned(), value.as_str().map_or_else(|| value.to_string(), str::to_owned)));
        }
    }
    let faces = if target.kind == "cube" { 6 } else { 1 };
    let levels = contents.iter().map(|(_, bytes)| &**bytes).collect();
    ktx2::write(&ktx2::Texture { format, width, height: size, faces, levels, key_values })
}
