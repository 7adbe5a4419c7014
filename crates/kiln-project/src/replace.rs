//! Source files replaced on somebody's behalf: whole, only if they are as they were, and only within the project.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use kiln_build::Digest;
use kiln_diagnostic::Diagnostic;

/// Longest source that is changed: a shader's limit is a sixteenth of it.
const TEXT_BYTES_MAX: u64 = 16 << 20;

/// A text file of the project.
pub(crate) struct Text {
    pub(crate) text: String,
    pub(crate) digest: Digest,
}

/// Reads a file of the project to change it.
pub(crate) fn read_text(folder: &Path, path: &str) -> Result<Text, Box<Diagnostic>> {
    let full = folder.join(path);
    let refuse = |why: String| Diagnostic::error(format!("this file {why}")).in_file(path);
    let unreadable = |error: std::io::Error| refuse(format!("cannot be read: {error}"));
    if !fs::metadata(&full).map_err(unreadable)?.is_file() {
        return Err(refuse("is no file".to_owned()).into());
    }
    let mut bytes = Vec::new();
    File::open(&full)
        .and_then(|file| file.take(TEXT_BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() as u64 > TEXT_BYTES_MAX {
        return Err(refuse(format!("is longer than {} MiB", TEXT_BYTES_MAX >> 20)).into());
    }
    let digest = Digest::of(&bytes);
    let text = String::from_utf8(bytes).map_err(|_| refuse("is not UTF-8 text".to_owned()))?;
    Ok(Text { text, digest })
}

/// Gives a file of the project another text, unless it is no longer the one that has the digest `before`. Links are followed
/// and stay; the file keeps who may read and write it.
pub(crate) fn replace_text(
    folder: &Path,
    path: &str,
    before: &Digest,
    text: &str,
) -> Result<(), Box<Diagnostic>> {
    let refuse = |why: String| Diagnostic::error(format!("this file {why}; it stays as it is")).in_file(path);
    let failed = |error: std::io::Error| refuse(format!("cannot be written: {error}"));
    let full = inside(folder, path).ok_or_else(|| {
        refuse("lies outside of the project".to_owned()).with_help("change it by hand: others may use it too")
    })?;
    let permissions = fs::metadata(&full).map_err(failed)?.permissions();
    if permissions.readonly() {
        return Err(refuse("is write-protected".to_owned()).into());
    }
    // In the same folder, so that it can take the file's place in one step.
    let parent = full.parent().unwrap_or(folder);
    let mut temporary = tempfile::NamedTempFile::new_in(parent).map_err(failed)?;
    temporary.as_file().set_permissions(permissions).map_err(failed)?;
    temporary.write_all(text.as_bytes()).map_err(failed)?;
    temporary.as_file().sync_data().map_err(failed)?;
    if read_text(folder, path)?.digest != *before {
        return Err(changed_meanwhile(path).into());
    }
    temporary.persist(&full).map_err(|error| failed(error.error))?;
    // The text is there; that its name survives a power failure is not worth failing for.
    let _ = File::open(parent).and_then(|parent| parent.sync_all());
    Ok(())
}

/// A file that is not what was asked to be changed.
pub(crate) fn changed_meanwhile(path: &str) -> Diagnostic {
    let message = "this file was changed meanwhile; it stays as it is";
    Diagnostic::error(message).in_file(path).with_help("ask again when the change is shown")
}

/// Where a file of the project really is, if that is within the project.
fn inside(folder: &Path, path: &str) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    folder.join(path).canonicalize().ok().filter(|full| full.starts_with(&folder))
}
