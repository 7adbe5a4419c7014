//! The GLB container (glTF 2.0, section 4.4): a header, a JSON chunk, an optional binary chunk.

use crate::SceneError;

const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: &[u8; 4] = b"JSON";
const CHUNK_BIN: &[u8; 4] = b"BIN\0";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
const CHUNK_FAULT_COUNT_MAX: usize = 16;

/// JSON text and binary payload of a file.
#[derive(Debug)]
pub(crate) struct Container<'a> {
    pub json: &'a [u8],
    pub bin: Option<&'a [u8]>,
    /// Whether it is a GLB; else the JSON is the file itself.
    pub binary: bool,
    /// What is not as the format wants it and does no harm.
    pub faults: Vec<SceneError>,
}

/// Splits a .glb, or takes a .gltf as it is.
pub(crate) fn open(bytes: &[u8]) -> Result<Container<'_>, SceneError> {
    if !bytes.starts_with(MAGIC) {
        return Ok(Container { json: bytes, bin: None, binary: false, faults: Vec::new() });
    }
    let (version, length) = (u32_at(bytes, 4)?, u32_at(bytes, 8)? as usize);
    if version != 2 {
        return Err(fault(4, format!("GLB version {version} is not supported, only 2"))
            .with_help("export it again as glTF 2.0"));
    }
    if length > bytes.len() {
        return Err(fault(8, format!("the header says {length} bytes, the file has {}", bytes.len())));
    }
    let (json, mut at) = chunk(bytes, HEADER_BYTES, CHUNK_JSON)?
        .ok_or_else(|| fault(HEADER_BYTES, "the first chunk must be JSON".into()))?;
    let mut faults = Vec::new();
    if !at.is_multiple_of(4) {
        faults.push(fault(HEADER_BYTES, "the JSON chunk does not end at a multiple of 4 bytes".into()));
    }
    // Unknown chunks may stand between; a file without the binary chunk is complete.
    let (mut bin, mut is_second) = (None, true);
    while at + CHUNK_HEADER_BYTES <= length {
        let is_json = chunk(bytes, at, CHUNK_JSON)?.is_some();
        match chunk(bytes, at, CHUNK_BIN)? {
            Some((found, _)) if bin.is_none() => {
                bin = Some(found);
                if !is_second {
                    faults.push(fault(at, "the binary chunk must be the second; it was read".into()));
                }
            }
            found if found.is_some() || is_json => {
                faults.push(fault(at, "a second chunk of this kind was ignored".into()));
            }
            _ => {}
        }
        at = chunk_end(bytes, at)?;
        is_second = false;
        // A file of nothing but tiny chunks must not cost a message for each.
        if faults.len() >= CHUNK_FAULT_COUNT_MAX {
            break;
        }
    }
    if at > length {
        return Err(fault(8, format!("the header says {length} bytes, its chunks need {at}")));
    }
    Ok(Container { json, bin, binary: true, faults })
}

/// Joins JSON and payload into a GLB, both padded to four bytes as the format demands.
///
/// The front goes into the payload's own buffer, as a second one would hold a large file twice.
pub(crate) fn join(mut json: Vec<u8>, mut bin: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let bin_bytes = if bin.is_empty() { 0 } else { CHUNK_HEADER_BYTES + bin.len() };
    let total = HEADER_BYTES + CHUNK_HEADER_BYTES + json.len() + bin_bytes;
    let mut front = Vec::with_capacity(total - bin.len());
    front.extend_from_slice(MAGIC);
    front.extend_from_slice(&2u32.to_le_bytes());
    front.extend_from_slice(&length_field(total).to_le_bytes());
    front.extend_from_slice(&chunk_header(CHUNK_JSON, json.len()));
    front.extend_from_slice(&json);
    if !bin.is_empty() {
        front.extend_from_slice(&chunk_header(CHUNK_BIN, bin.len()));
    }
    bin.splice(0..0, front);
    bin
}

fn chunk_header(kind: &[u8; 4], length: usize) -> [u8; CHUNK_HEADER_BYTES] {
    let mut header = [0; CHUNK_HEADER_BYTES];
    header[..4].copy_from_slice(&length_field(length).to_le_bytes());
    header[4..].copy_from_slice(kind);
    header
}

/// The limits on vertices, indices and images keep a pack below the 4 GiB that the format can say.
fn length_field(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

/// The chunk at `at` and where it ends, if it has the given kind.
fn chunk<'a>(bytes: &'a [u8], at: usize, kind: &[u8; 4]) -> Result<Option<(&'a [u8], usize)>, SceneError> {
    let end = chunk_end(bytes, at)?;
    let found = &bytes[at + 4..at + CHUNK_HEADER_BYTES] == kind;
    Ok(found.then(|| (&bytes[at + CHUNK_HEADER_BYTES..end], end)))
}

fn chunk_end(bytes: &[u8], at: usize) -> Result<usize, SceneError> {
    let length = u32_at(bytes, at)? as usize;
    let end = at + CHUNK_HEADER_BYTES + length;
    if end > bytes.len() {
        let left = bytes.len().saturating_sub(at + CHUNK_HEADER_BYTES);
        return Err(fault(at, format!("a chunk of {length} bytes does not fit the {left} bytes left")));
    }
    Ok(end)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, SceneError> {
    let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
    four.map(u32::from_le_bytes).ok_or_else(|| fault(at, "the file ends inside a GLB header".into()))
}

fn fault(at: usize, reason: String) -> SceneError {
    SceneError::new("", format!("byte {at}: {reason}"))
}
