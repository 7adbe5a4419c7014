//! Checked JSON: what the store keeps besides artefacts.
//!
//! ```text
//! kiln-store 2 sha256 <64 hexadecimal digits>
//! {"the": "document"}
//! ```
//!
//! The digest covers the file's name and the JSON, so a flipped bit, a torn write and a document under another's
//! name are all found when it is read.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::digest::FieldHasher;
use crate::{Digest, Error};

const HEADER: &str = "kiln-store 2 sha256 ";
const HEADER_BYTES: usize = HEADER.len() + 64 + 1;

/// The bytes of a document that will be called `path`.
pub(crate) fn encode<T: Serialize>(path: &Path, value: &T) -> Result<Vec<u8>, Error> {
    let mut bytes = vec![0; HEADER_BYTES];
    serde_json::to_writer(&mut bytes, value).map_err(|error| Error::io("encode", path)(error.into()))?;
    let header = header(path, &bytes[HEADER_BYTES..]);
    bytes[..HEADER_BYTES].copy_from_slice(header.as_bytes());
    Ok(bytes)
}

/// The document in a file, or `None` if it is damaged or of another version.
pub(crate) fn decode<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Option<T> {
    let (header, body) = bytes.split_at_checked(HEADER_BYTES)?;
    (header == self::header(path, body).as_bytes()).then_some(())?;
    serde_json::from_slice(body).ok()
}

fn header(path: &Path, body: &[u8]) -> String {
    format!("{HEADER}{}\n", digest(path, body))
}

fn digest(path: &Path, body: &[u8]) -> Digest {
    let mut hasher = FieldHasher::default();
    hasher.field("name", path.file_name().unwrap_or_default().as_encoded_bytes());
    hasher.field("body", body);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flipped_bit_and_other_name_are_found_in_a_document() {
        let path = Path::new("a.json");
        let bytes = encode(path, &vec![1, 2, 3]).unwrap();
        assert_eq!(decode::<Vec<u32>>(path, &bytes), Some(vec![1, 2, 3]));
        assert_eq!(decode::<Vec<u32>>(Path::new("b.json"), &bytes), None);
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(decode::<Vec<u32>>(path, &damaged), None, "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert_eq!(decode::<Vec<u32>>(path, &bytes[..length]), None, "{length} bytes");
        }
    }
}
