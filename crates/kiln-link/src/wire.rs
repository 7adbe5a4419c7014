//! Bytes of the wire (`docs/protocol.md`): a frame is a length, a type and a payload.
//!
//! ```text
//! u32 LE  length of what follows, 1 … FRAME_BYTES_MAX
//! u8      type
//! …       payload: JSON (UTF-8), or for a chunk: 32-byte digest, u64 LE offset, u64 LE total, bytes
//! ```

use kiln_build::Digest;
use serde::{Deserialize, Serialize};

use crate::{ClientMessage, FrameReport, ProgressReport, RevisionTable, ServerMessage};

/// Longest frame: room for a revision table of 100 000 targets.
pub const FRAME_BYTES_MAX: usize = 64 << 20;
/// Bytes of content in one chunk: small enough that nothing waits long behind it.
pub const CHUNK_BYTES: usize = 256 << 10;
/// Digests in one fetch.
pub const FETCH_DIGESTS_MAX: usize = 100_000;
/// Longest content a client accepts.
pub const CONTENT_BYTES_MAX: u64 = 4 << 30;

const CHUNK_HEADER_BYTES: usize = 32 + 8 + 8;

const CLIENT_HELLO: u8 = 1;
const CLIENT_FETCH: u8 = 2;
const CLIENT_FRAME: u8 = 3;
const SERVER_HELLO: u8 = 65;
const SERVER_REVISION: u8 = 66;
const SERVER_CHUNK: u8 = 67;
const SERVER_MISSING: u8 = 68;
const SERVER_PROGRESS: u8 = 69;

/// The peer does not speak this protocol.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// A frame longer than allowed, or empty.
    #[error("a frame of {bytes} bytes; frames have 1 to {FRAME_BYTES_MAX}")]
    Length {
        /// What the peer announced.
        bytes: usize,
    },
    /// A frame of a type that this side does not know.
    #[error("a frame of unknown type {0}")]
    Type(u8),
    /// A payload that does not parse.
    #[error("a frame of type {kind} with a malformed payload: {reason}")]
    Payload {
        /// Its type.
        kind: u8,
        /// What is wrong.
        reason: String,
    },
}

/// A message that one side sends and the other receives.
pub trait Message: Sized {
    /// The frame that carries it.
    fn encode(&self) -> Vec<u8>;
    /// The message in a frame.
    fn decode(kind: u8, payload: &[u8]) -> Result<Self, WireError>;
}

/// Cuts a stream of bytes, arriving in any pieces, into messages.
#[derive(Debug, Default)]
pub struct Decoder {
    buffer: Vec<u8>,
    start: usize,
}

impl Decoder {
    /// Takes bytes from the peer.
    pub fn push(&mut self, bytes: &[u8]) {
        if self.start > 0 {
            self.buffer.drain(..self.start);
            self.start = 0;
        }
        self.buffer.extend_from_slice(bytes);
    }

    /// The next whole message, or `None` until more bytes come.
    pub fn next_message<M: Message>(&mut self) -> Result<Option<M>, WireError> {
        let rest = &self.buffer[self.start..];
        let Some((length, rest)) = rest.split_first_chunk::<4>() else { return Ok(None) };
        let bytes = u32::from_le_bytes(*length) as usize;
        if bytes == 0 || bytes > FRAME_BYTES_MAX {
            return Err(WireError::Length { bytes });
        }
        let Some(frame) = rest.get(..bytes) else { return Ok(None) };
        let message = M::decode(frame[0], &frame[1..])?;
        self.start += 4 + bytes;
        Ok(Some(message))
    }
}

fn frame(kind: u8, payload: &[&[u8]]) -> Vec<u8> {
    let bytes = 1 + payload.iter().map(|part| part.len()).sum::<usize>();
    let mut frame = Vec::with_capacity(4 + bytes);
    frame.extend_from_slice(&u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes());
    frame.push(kind);
    payload.iter().for_each(|part| frame.extend_from_slice(part));
    frame
}

fn json_frame(kind: u8, value: &impl Serialize) -> Vec<u8> {
    // These types hold string keys and finite-or-null numbers only, which JSON always takes.
    frame(kind, &[&serde_json::to_vec(value).unwrap_or_default()])
}

fn parse<'a, T: Deserialize<'a>>(kind: u8, payload: &'a [u8]) -> Result<T, WireError> {
    serde_json::from_slice(payload).map_err(|error| WireError::Payload { kind, reason: error.to_string() })
}

#[derive(Serialize, Deserialize)]
struct Hello {
    protocol: u32,
    name: String,
}

impl Message for ClientMessage {
    fn encode(&self) -> Vec<u8> {
        match self {
            ClientMessage::Hello { protocol, name } => {
                json_frame(CLIENT_HELLO, &Hello { protocol: *protocol, name: name.clone() })
            }
            ClientMessage::Fetch(digests) => json_frame(CLIENT_FETCH, digests),
            ClientMessage::Frame(report) => json_frame(CLIENT_FRAME, report),
        }
    }

    fn decode(kind: u8, payload: &[u8]) -> Result<Self, WireError> {
        match kind {
            CLIENT_HELLO => {
                let Hello { protocol, name } = parse(kind, payload)?;
                Ok(ClientMessage::Hello { protocol, name: name.chars().take(80).collect() })
            }
            CLIENT_FETCH => {
                let digests: Vec<Digest> = parse(kind, payload)?;
                if digests.len() > FETCH_DIGESTS_MAX {
                    let reason =
                        format!("{} digests at once; {FETCH_DIGESTS_MAX} are allowed", digests.len());
                    return Err(WireError::Payload { kind, reason });
                }
                Ok(ClientMessage::Fetch(digests))
            }
            CLIENT_FRAME => Ok(ClientMessage::Frame(parse::<FrameReport>(kind, payload)?)),
            other => Err(WireError::Type(other)),
        }
    }
}

impl Message for ServerMessage {
    fn encode(&self) -> Vec<u8> {
        match self {
            ServerMessage::Hello { protocol, project } => {
                json_frame(SERVER_HELLO, &Hello { protocol: *protocol, name: project.clone() })
            }
            ServerMessage::Revision(table) => json_frame(SERVER_REVISION, table),
            ServerMessage::Chunk { digest, offset, total, bytes } => {
                frame(SERVER_CHUNK, &[digest.as_bytes(), &offset.to_le_bytes(), &total.to_le_bytes(), bytes])
            }
            ServerMessage::Missing(digest) => json_frame(SERVER_MISSING, digest),
            ServerMessage::Progress(progress) => json_frame(SERVER_PROGRESS, progress),
        }
    }

    fn decode(kind: u8, payload: &[u8]) -> Result<Self, WireError> {
        match kind {
            SERVER_HELLO => {
                let Hello { protocol, name } = parse(kind, payload)?;
                Ok(ServerMessage::Hello { protocol, project: name })
            }
            SERVER_REVISION => Ok(ServerMessage::Revision(parse::<RevisionTable>(kind, payload)?)),
            SERVER_CHUNK => decode_chunk(payload),
            SERVER_MISSING => Ok(ServerMessage::Missing(parse(kind, payload)?)),
            SERVER_PROGRESS => Ok(ServerMessage::Progress(parse::<ProgressReport>(kind, payload)?)),
            other => Err(WireError::Type(other)),
        }
    }
}

fn decode_chunk(payload: &[u8]) -> Result<ServerMessage, WireError> {
    let wrong = |reason: &str| WireError::Payload { kind: SERVER_CHUNK, reason: reason.to_owned() };
    let (header, bytes) =
        payload.split_first_chunk::<CHUNK_HEADER_BYTES>().ok_or_else(|| wrong("its header is cut"))?;
    let mut digest = [0; 32];
    digest.copy_from_slice(&header[..32]);
    let word = |at: usize| {
        let mut word = [0; 8];
        word.copy_from_slice(&header[at..at + 8]);
        u64::from_le_bytes(word)
    };
    let (offset, total) = (word(32), word(40));
    let end = offset.checked_add(bytes.len() as u64).ok_or_else(|| wrong("its offset overflows"))?;
    if end > total || total > CONTENT_BYTES_MAX {
        return Err(wrong("it reaches past the content's end or limit"));
    }
    Ok(ServerMessage::Chunk { digest: Digest::from_bytes(digest), offset, total, bytes: bytes.to_vec() })
}
