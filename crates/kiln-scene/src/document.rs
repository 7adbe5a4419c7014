//! From bytes to a checked JSON document.

use serde::Deserialize;

use crate::container::{self, Container};
use crate::json::Json;
use crate::locate::pointer_at;
use crate::schema::Root;
use crate::{SceneError, limits};

/// A parsed file.
#[derive(Debug)]
pub(crate) struct Document<'a> {
    pub root: Root,
    /// The same as it stands, for checks on what is not drawn.
    pub json: Json<'a>,
    pub bin: Option<&'a [u8]>,
    /// Faults of the container.
    pub faults: Vec<SceneError>,
}

/// The JSON of a .gltf as text, for messages that show a line; `None` for a GLB or bytes that are not UTF-8.
pub(crate) fn text_of(bytes: &[u8]) -> Option<&str> {
    let container = container::open(bytes).ok()?;
    if container.binary { None } else { std::str::from_utf8(container.json).ok() }
}

/// Parses a .gltf or .glb.
///
/// # Errors
/// Broken containers, invalid JSON, wrong types, versions other than 2.x.
pub(crate) fn parse(bytes: &[u8]) -> Result<Document<'_>, SceneError> {
    let Container { json, bin, faults, .. } = container::open(bytes)?;
    if json.len() > limits::JSON_BYTES_MAX {
        let (actual, limit) = (json.len(), limits::JSON_BYTES_MAX);
        return Err(SceneError::new("", format!("{actual} bytes of JSON exceed the limit of {limit}")));
    }
    let text = std::str::from_utf8(json).map_err(|error| {
        SceneError::new("", format!("the JSON is not UTF-8: byte {}", error.valid_up_to()))
            .with_help("is this a glTF file?")
    })?;
    check_value_count(json)?;
    check_version(text)?;
    let root = serde_json::from_str(text).map_err(|error| json_error(text, &error))?;
    check_numbers(text)?;
    let json = serde_json::from_str(text).map_err(|error| json_error(text, &error))?;
    Ok(Document { root, json, bin, faults })
}

/// Every `{}` of two bytes becomes a table entry of hundreds, so their number is limited before they are made.
fn check_value_count(json: &[u8]) -> Result<(), SceneError> {
    let (mut objects, mut values) = (0, 0);
    for byte in json {
        objects += usize::from(*byte == b'{');
        values += usize::from(matches!(byte, b'{' | b'[' | b','));
    }
    for (what, count, limit) in [
        ("objects", objects, limits::JSON_OBJECT_COUNT_MAX),
        ("values", values, limits::JSON_VALUE_COUNT_MAX),
    ] {
        if count > limit {
            return Err(SceneError::new("", format!("{count} JSON {what} exceed the limit of {limit}")));
        }
    }
    Ok(())
}

/// Refuses numbers that `f32` cannot hold: they would be infinite in the scene, and JSON has no infinity for
/// the pack. `text` is valid JSON.
fn check_numbers(text: &str) -> Result<(), SceneError> {
    let bytes = text.as_bytes();
    let is_number = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        match bytes[at] {
            b'"' => {
                at += 1;
                while bytes.get(at).is_some_and(|&byte| byte != b'"') {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
                at += 1;
            }
            b'-' | b'0'..=b'9' => {
                at += bytes[at..].iter().take_while(|&&byte| is_number(byte)).count();
                let number = &text[start..at];
                let fits = number.parse::<f64>().is_ok_and(|value| value.abs() <= f64::from(f32::MAX));
                if !fits {
                    let reason = format!("the number {} is too large", &number[..number.len().min(24)]);
                    return Err(SceneError { json_bytes: Some(start..at), ..SceneError::new("", reason) });
                }
            }
            _ => at += 1,
        }
    }
    Ok(())
}

/// Looked at before anything else: a glTF 1.0 file differs in every table, and its first type error would
/// say nothing useful.
fn check_version(text: &str) -> Result<(), SceneError> {
    #[derive(Deserialize)]
    #[serde(expecting = "a glTF object")]
    struct Peek {
        asset: Option<PeekAsset>,
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct PeekAsset {
        version: Option<serde_json::Value>,
        min_version: Option<serde_json::Value>,
    }
    let peek: Peek = serde_json::from_str(text).map_err(|error| json_error(text, &error))?;
    let asset = peek.asset.ok_or_else(|| {
        SceneError::new("", "`asset` is missing, so this is not glTF 2.0")
            .with_help("export it again as glTF 2.0")
    })?;
    let Some(serde_json::Value::String(version)) = asset.version else {
        return Err(SceneError::new("/asset", "`version` is missing or not a text"));
    };
    if !version.starts_with("2.") {
        return Err(SceneError::new("/asset/version", format!("glTF {version} is not supported, only 2.x"))
            .with_help("export it again as glTF 2.0"));
    }
    match asset.min_version {
        Some(serde_json::Value::String(least)) if least != "2.0" => {
            Err(SceneError::new("/asset/minVersion", format!("glTF {least} is needed, 2.0 is supported")))
        }
        _ => Ok(()),
    }
}

fn json_error(text: &str, error: &serde_json::Error) -> SceneError {
    let line_start = match error.line() {
        0 | 1 => 0,
        line => text.match_indices('\n').nth(line - 2).map_or(text.len(), |(at, _)| at + 1),
    };
    let at = (line_start + error.column().saturating_sub(1)).min(text.len());
    let message = error.to_string();
    // The place follows in the diagnostic; the library's own suffix would repeat it.
    let reason = message.split(" at line ").next().unwrap_or(&message);
    let kind = if error.is_data() { "not as the glTF schema wants it" } else { "invalid JSON" };
    let place = format!("line {} column {}", error.line(), error.column());
    SceneError {
        // In broken JSON the line and the column are the place.
        pointer: if error.is_data() { pointer_at(text, at) } else { String::new() },
        reason: format!("{kind}: {reason} ({place})"),
        help: None,
        json_bytes: Some(at..at + 1),
    }
}
