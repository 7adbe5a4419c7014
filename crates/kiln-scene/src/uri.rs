//! Where buffers and images outside the file are, and `data:` URIs.

use std::fmt;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Severity};

use crate::{SceneError, document};

/// A glTF file's way to the files that it refers to.
pub(crate) struct References<'a> {
    /// Its name relative to the project.
    pub file: &'a str,
    /// See [`crate::PackOptions::allowed_folders`].
    pub allowed_folders: &'a [String],
    /// The bytes of a file by its [`Uri::path`].
    pub read: &'a mut dyn FnMut(&str) -> Option<Arc<[u8]>>,
}

/// What a URI is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum UriKind {
    /// Geometry and other binary data.
    Buffer,
    /// A picture.
    Image,
}

/// A file that a glTF file refers to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Uri {
    /// What it is for.
    pub kind: UriKind,
    /// Relative to the project, or absolute where the reference is, decoded, with `/`: what [`crate::pack`] asks its
    /// resolver for.
    pub path: String,
    /// As the file says it, relative to the file's folder, decoded.
    pub reference: String,
}

/// Buffers and images outside the file `file` (its name relative to the project), in the file's order,
/// each once, with a diagnostic for each one that is refused: absolute paths, schemes other than `data:`,
/// paths that leave the project, in which no other folder is allowed. A file that cannot be read at all gives its error.
pub fn external_uris(file: &str, bytes: &[u8]) -> (Vec<Uri>, Vec<Diagnostic>) {
    let text = document::text_of(bytes);
    let to_diagnostic = |error: SceneError| error.into_diagnostic(Severity::Error, file, text);
    let root = match document::parse(bytes) {
        Ok(document) => document.root,
        Err(error) => return (Vec::new(), vec![to_diagnostic(error)]),
    };
    let buffers = root.buffers.iter().map(|buffer| (UriKind::Buffer, "buffers", buffer.uri.as_deref()));
    let images = root.images.iter().map(|image| (UriKind::Image, "images", image.uri.as_deref()));
    let (mut uris, mut diagnostics) = (Vec::new(), Vec::new());
    for (kind, table, index, uri) in enumerate(buffers).chain(enumerate(images)) {
        match resolve(file, &[], &format!("/{table}/{index}/uri"), uri) {
            Ok((path, reference)) => {
                let uri = Uri { kind, path, reference };
                if !uris.contains(&uri) {
                    uris.push(uri);
                }
            }
            Err(error) => diagnostics.push(to_diagnostic(error)),
        }
    }
    (uris, diagnostics)
}

type Entry<'a> = (UriKind, &'static str, Option<&'a str>);

fn enumerate<'a>(
    entries: impl Iterator<Item = Entry<'a>>,
) -> impl Iterator<Item = (UriKind, &'static str, usize, &'a str)> {
    let outside = |uri: &str| !uri.starts_with("data:");
    entries.enumerate().filter_map(move |(index, (kind, table, uri))| {
        uri.filter(|uri| outside(uri)).map(|uri| (kind, table, index, uri))
    })
}

/// Path (relative to the project, or absolute in an allowed folder) and decoded reference of a URI in `file`.
///
/// # Errors
/// Schemes other than `file:`, broken percent-encoding, and whatever lies neither in the project nor in one of
/// `allowed_folders`.
pub(crate) fn resolve(
    file: &str,
    allowed_folders: &[String],
    pointer: &str,
    uri: &str,
) -> Result<(String, String), SceneError> {
    let refuse = |why: &str| {
        SceneError::new(pointer, format!("`{}` {why}", shorten(uri)))
            .with_help("refer to files inside the project, by a path relative to this file")
    };
    let path = local_path(uri).ok_or_else(|| refuse("has a scheme; only files and `data:` are read"))?;
    let reference = percent_decode(path).ok_or_else(|| refuse("has a broken percent-encoding"))?;
    if has_scheme(&reference) {
        return Err(refuse("is an absolute path of another system"));
    }
    if reference.contains(['\0', '\\']) {
        return Err(refuse("contains a character that no path of a project has"));
    }
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let joined = if reference.starts_with('/') || folder.is_empty() && !file.starts_with('/') {
        reference.clone()
    } else {
        format!("{folder}/{reference}")
    };
    let place = Place::new(&joined).filter(|place| !place.parts.is_empty() && !reference.is_empty());
    let place = place.ok_or_else(|| refuse("names no file"))?;
    let is_allowed = |folder: &String| Place::new(folder).is_some_and(|folder| place.is_below(&folder));
    if place.leaves_project() && !allowed_folders.iter().any(is_allowed) {
        let folder = place.folder();
        let why = if place.is_absolute { "is an absolute path" } else { "leaves the project" };
        return Err(refuse(why).with_help(format!(
            "copy the file into the project, or allow its folder: allow_folders = [\"{folder}\"] in [project] of kiln.toml"
        )));
    }
    Ok((place.to_string(), reference))
}

/// A path without `.`, and without `..` after a name: where it leads if nothing on it is a link.
#[derive(Debug, PartialEq, Eq)]
struct Place<'a> {
    is_absolute: bool,
    /// How many folders above the project's it begins.
    ups: usize,
    parts: Vec<&'a str>,
}

impl<'a> Place<'a> {
    /// `None`: it leads above the root.
    fn new(path: &'a str) -> Option<Place<'a>> {
        let mut place = Place { is_absolute: path.starts_with('/'), ups: 0, parts: Vec::new() };
        for part in path.split('/') {
            match part {
                "" | "." => {}
                ".." if place.parts.pop().is_some() => {}
                ".." if place.is_absolute => return None,
                ".." => place.ups += 1,
                part => place.parts.push(part),
            }
        }
        Some(place)
    }

    fn leaves_project(&self) -> bool {
        self.is_absolute || self.ups > 0
    }

    /// A folder that is nothing but `..` holds the project itself and all above it: whoever writes it means it.
    fn is_below(&self, folder: &Place) -> bool {
        self.is_absolute == folder.is_absolute
            && match folder.parts.as_slice() {
                [] => self.ups <= folder.ups,
                parts => self.ups == folder.ups && self.parts.starts_with(parts),
            }
    }

    /// The folder that holds it.
    fn folder(&self) -> Place<'a> {
        let parts = self.parts.split_last().map_or(Vec::new(), |(_, folders)| folders.to_vec());
        Place { parts, ..*self }
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ups = std::iter::repeat_n("..", self.ups);
        let parts: Vec<&str> = ups.chain(self.parts.iter().copied()).collect();
        write!(f, "{}{}", if self.is_absolute { "/" } else { "" }, parts.join("/"))
    }
}

/// The path of a relative reference or of a `file:` URI; `None` for other schemes, and for other machines' files.
fn local_path(uri: &str) -> Option<&str> {
    let Some(path) = uri.strip_prefix("file:") else { return (!has_scheme(uri)).then_some(uri) };
    let path = path.strip_prefix("//").map_or(path, |path| path.strip_prefix("localhost").unwrap_or(path));
    path.starts_with('/').then_some(path)
}

/// RFC 3986 scheme, or a drive letter, which looks the same.
fn has_scheme(uri: &str) -> bool {
    let Some((scheme, _)) = uri.split_once(':') else { return false };
    let starts_well = scheme.starts_with(|first: char| first.is_ascii_alphabetic());
    starts_well && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
}

fn percent_decode(uri: &str) -> Option<String> {
    let mut bytes = uri.bytes();
    let mut decoded = Vec::with_capacity(uri.len());
    while let Some(byte) = bytes.next() {
        if byte != b'%' {
            decoded.push(byte);
            continue;
        }
        let digits = [bytes.next()?, bytes.next()?].map(|digit| char::from(digit).to_digit(16));
        decoded.push((digits[0]? * 16 + digits[1]?) as u8);
    }
    String::from_utf8(decoded).ok()
}

/// A URI for a message: long ones are cut.
pub(crate) fn shorten(uri: &str) -> String {
    let mut short: String = uri.chars().take(80).collect();
    if short.len() < uri.len() {
        short.push('…');
    }
    short
}

/// Payload of a `data:` URI (RFC 2397), base64 or percent-encoded; `None` where it is malformed.
pub(crate) fn data_payload(uri: &str) -> Option<Vec<u8>> {
    let (head, payload) = uri.strip_prefix("data:")?.split_once(',')?;
    if head.ends_with(";base64") {
        base64(payload.as_bytes())
    } else {
        percent_decode(payload).map(String::into_bytes)
    }
}

/// Whether a URI is as RFC 2397 or RFC 3986 wants it; some that are not are read all the same.
pub(crate) fn is_well_formed(uri: &str) -> bool {
    let Some(data) = uri.strip_prefix("data:") else { return percent_decode(uri).is_some() };
    let Some((head, payload)) = data.split_once(',') else { return false };
    let mut parameters = head.split(';').skip(1).peekable();
    let is_base64 = head.ends_with(";base64");
    while let Some(parameter) = parameters.next() {
        let is_last = parameters.peek().is_none();
        if !(parameter.contains('=') || is_base64 && is_last) {
            return false;
        }
    }
    let digits = payload.trim_end_matches('=');
    let padded = payload.len().is_multiple_of(4) && payload.len() - digits.len() <= 2;
    !is_base64 || !payload.is_empty() && padded && digits.bytes().all(|digit| sextet(digit).is_some())
}

/// RFC 4648 with the standard alphabet; padding optional, as exporters forget it.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let digits = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    if digits.len() % 4 == 1 {
        return None;
    }
    let mut decoded = Vec::with_capacity(digits.len() * 3 / 4);
    for group in digits.chunks(4) {
        let mut bits = 0u32;
        for &digit in group {
            bits = bits << 6 | sextet(digit)?;
        }
        bits <<= 6 * (4 - group.len());
        decoded.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Some(decoded)
}

fn sextet(digit: u8) -> Option<u32> {
    let value = match digit {
        b'A'..=b'Z' => digit - b'A',
        b'a'..=b'z' => digit - b'a' + 26,
        b'0'..=b'9' => digit - b'0' + 52,
        b'+' | b'-' => 62,
        b'/' | b'_' => 63,
        _ => return None,
    };
    Some(u32::from(value))
}
