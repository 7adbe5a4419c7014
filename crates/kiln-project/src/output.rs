//! Baked files for engines and `manifest.json` for CI.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use kiln_build::{Digest, Error, Store, Target, TargetState, Targets, write_atomically};
use kiln_image::ktx2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Version of the manifest's form.
const MANIFEST_SCHEMA: u32 = 1;
const MANIFEST_FILE: &str = "manifest.json";

/// What a folder of baked files holds: sorted, without times or absolute paths, so that it can be committed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this form.
    pub schema: u32,
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

/// What [`write_outputs`] did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Files written, relative to the folder.
    pub written: Vec<String>,
    /// Files that were there already with the right content.
    pub kept: usize,
    /// Files of earlier builds that no target makes any more.
    pub removed: Vec<String>,
}

/// Writes the files of every target that changed since the folder's manifest was written, and the manifest.
/// A file is taken as unchanged if the old manifest names the same target digest and its length is right.
///
/// # Errors
/// A file cannot be read from the store or written.
pub fn write_outputs(store: &Store, targets: &Targets, folder: &Path) -> Result<Written, Error> {
    let old = read_manifest(folder);
    let unchanged = |name: &String, target: &Target| {
        let known = old.targets.get(name)?;
        (known.sha256 == target.digest() && all_present(folder, known)).then_some(known)
    };
    let mut manifest = Manifest { schema: MANIFEST_SCHEMA, ..Manifest::default() };
    let mut written = Written::default();
    let kept =
        targets.iter().filter_map(|(name, target)| Some((name.clone(), unchanged(name, target)?.clone())));
    manifest.targets.extend(kept);
    if manifest.targets.len() < targets.len() && manifest != old {
        // Until the files are written nothing may vouch for them.
        write_manifest(folder, &manifest)?;
    }
    for (name, target) in targets {
        let files = match manifest.targets.get(name) {
            Some(known) => {
                written.kept += known.files.len();
                known.files.clone()
            }
            None => write_target(store, name, target, folder, &mut written)?,
        };
        let entry = ManifestTarget {
            kind: target.kind.clone(),
            sha256: target.digest(),
            state: target.state,
            files,
            facts: target.meta.clone(),
        };
        manifest.targets.insert(name.clone(), entry);
    }
    remove_orphans(folder, &old, &manifest, &mut written);
    if manifest != old {
        write_manifest(folder, &manifest)?;
        written.written.push(MANIFEST_FILE.to_owned());
    }
    Ok(written)
}

fn write_manifest(folder: &Path, manifest: &Manifest) -> Result<(), Error> {
    let mut text = serde_json::to_string_pretty(manifest).unwrap_or_default();
    text.push('\n');
    write_atomically(&folder.join(MANIFEST_FILE), text.as_bytes())
}

/// A manifest that is missing, damaged or of another schema says nothing about the folder.
fn read_manifest(folder: &Path) -> Manifest {
    let text = std::fs::read(folder.join(MANIFEST_FILE)).unwrap_or_default();
    let manifest: Option<Manifest> = serde_json::from_slice(&text).ok();
    manifest.filter(|manifest| manifest.schema == MANIFEST_SCHEMA).unwrap_or_default()
}

fn all_present(folder: &Path, target: &ManifestTarget) -> bool {
    target.files.iter().all(|(path, file)| {
        std::fs::metadata(folder.join(path)).is_ok_and(|metadata| metadata.len() == file.bytes)
    })
}

fn remove_orphans(folder: &Path, old: &Manifest, new: &Manifest, written: &mut Written) {
    let files = |manifest: &Manifest| -> std::collections::BTreeSet<String> {
        manifest.targets.values().flat_map(|target| target.files.keys().cloned()).collect()
    };
    for path in files(old).difference(&files(new)) {
        // Only what an earlier manifest claims is touched, and only below the folder.
        let inside = Path::new(path).components().all(|part| matches!(part, std::path::Component::Normal(_)));
        if inside && std::fs::remove_file(folder.join(path)).is_ok() {
            written.removed.push(path.clone());
        }
    }
}

fn write_target(
    store: &Store,
    name: &str,
    target: &Target,
    folder: &Path,
    written: &mut Written,
) -> Result<BTreeMap<String, ManifestFile>, Error> {
    let mut files = BTreeMap::new();
    for (path, bytes) in target_files(store, name, target)? {
        write_atomically(&folder.join(&path), &bytes)?;
        files.insert(path.clone(), ManifestFile { sha256: Digest::of(&bytes), bytes: bytes.len() as u64 });
        written.written.push(path);
    }
    Ok(files)
}

/// Path and content.
type OutputFile = (String, Arc<[u8]>);

fn target_files(store: &Store, name: &str, target: &Target) -> Result<Vec<OutputFile>, Error> {
    let mut contents = Vec::with_capacity(target.parts.len());
    for part in &target.parts {
        let bytes = store.get(&part.digest)?.ok_or_else(|| Error::Action {
            action: format!("write {name}"),
            reason: format!("{} was damaged in the store and has been dropped; build again", part.name),
        })?;
        contents.push((part.name.as_str(), bytes));
    }
    Ok(match target.kind.as_str() {
        "cube" | "lut" => vec![(format!("{name}.ktx2"), texture_file(name, target, &contents).into())],
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
    let size = usize::try_from(fact("size")).unwrap_or(usize::MAX);
    let format = match target.meta.get("format").and_then(Value::as_str) {
        Some("rgba32f") => ktx2::Format::R32G32B32A32_SFLOAT,
        Some("rg32f") => ktx2::Format::R32G32_SFLOAT,
        _ => ktx2::Format::R16G16B16A16_SFLOAT,
    };
    let mut key_values = vec![("KilnTarget".to_owned(), name.to_owned())];
    for (key, fact) in [("KilnScaleLog2", "scale_log2"), ("KilnLaw", "law")] {
        if let Some(value) = target.meta.get(fact) {
            key_values
                .push((key.to_owned(), value.as_str().map_or_else(|| value.to_string(), str::to_owned)));
        }
    }
    let faces = if target.kind == "cube" { 6 } else { 1 };
    let levels = contents.iter().map(|(_, bytes)| &**bytes).collect();
    ktx2::write(&ktx2::Texture { format, width: size, height: size, faces, levels, key_values })
}
