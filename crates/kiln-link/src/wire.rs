//! Bytes of the wire (`docs/protocol.md`): a frame is a length, a type and a payload.
//!
//! ```text
//! u32 LE  length of what follows, at least 1, at most the sender's limit
//! u8      type
//! …       payload: JSON (UTF-8); for a chunk: 32-byte digest, u64 LE offset, u64 LE total, bytes; for ping and pong: u64 LE;
//!         nothing to ask for the status or to stop
//! ```

use kiln_build::Digest;
use serde::{Deserialize, Serialize};

use crate::{
    Answer, ClientMessage, DaemonStatus, FrameReport, Hello, ProgressReport, Request, RevisionTable,
    ServerMessage, Wants,
};

/// Longest frame of a daemon: room for a revision table of 100 000 targets.
pub const SERVER_FRAME_BYTES_MAX: usize = 64 << 20;
/// Longest frame of a client: room for [`FETCH_DIGESTS_MAX`] digests.
pub const CLIENT_FRAME_BYTES_MAX: usize = 8 << 20;
/// Bytes of content in one chunk: small enough that nothing waits long behind it.
pub const CHUNK_BYTES: usize = 256 << 10;
/// Digests in one fetch.
pub const FETCH_DIGESTS_MAX: usize = 100_000;
/// Longest content a client accepts.
pub const CONTENT_BYTES_MAX: u64 = 4 << 30;
/// Targets that a client may say it shows.
pub const WANTS_MAX: usize = 1000;
/// Characters of a name in a greeting or of a wanted target; what is longer is cut or refused.
pub const NAME_CHARS_MAX: usize = 256;
/// Capabilities that are looked at.
pub const CAPABILITIES_MAX: usize = 32;

const CHUNK_HEADER_BYTES: usize = 32 + 8 + 8;

const CLIENT_HELLO: u8 = 1;
const CLIENT_FETCH: u8 = 2;
const CLIENT_FRAME: u8 = 3;
const CLIENT_WANTS: u8 = 4;
const CLIENT_PING: u8 = 5;
const CLIENT_PONG: u8 = 6;
const CLIENT_STATUS: u8 = 7;
const CLIENT_STOP: u8 = 8;
const CLIENT_REQUEST: u8 = 9;
const SERVER_HELLO: u8 = 65;
const SERVER_REVISION: u8 = 66;
const SERVER_CHUNK: u8 = 67;
const SERVER_MISSING: u8 = 68;
const SERVER_PROGRESS: u8 = 69;
const SERVER_PING: u8 = 70;
const SERVER_PONG: u8 = 71;
const SERVER_STATUS: u8 = 72;
const SERVER_ANSWER: u8 = 73;

/// The peer does not speak this protocol.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// A frame longer than allowed, or empty.
    #[error("a frame of {bytes} bytes; such frames have 1 to {bytes_max}")]
    Length {
        /// What the peer announced.
        bytes: usize,
        /// What it may.
        bytes_max: usize,
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
    /// The longest frame that its sender may write, without the length itself.
    const FRAME_BYTES_MAX: usize;
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

    /// Bytes of a message that is not whole yet.
    pub fn waiting_bytes(&self) -> usize {
        self.buffer.len() - self.start
    }

    /// The next whole message, or `None` until more bytes come.
    pub fn next_message<M: Message>(&mut self) -> Result<Option<M>, WireError> {
        let rest = &self.buffer[self.start..];
        let Some((length, rest)) = rest.split_first_chunk::<4>() else { return Ok(None) };
        let bytes = u32::from_le_bytes(*length) as usize;
        if bytes == 0 || bytes > M::FRAME_BYTES_MAX {
            return Err(WireError::Length { bytes, bytes_max: M::FRAME_BYTES_MAX });
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

fn parse_number(kind: u8, payload: &[u8]) -> Result<u64, WireError> {
    let word = payload.try_into().map_err(|_| malformed(kind, "8 bytes are expected".to_owned()))?;
    Ok(u64::from_le_bytes(word))
}

fn malformed(kind: u8, reason: String) -> WireError {
    WireError::Payload { kind, reason }
}

fn parse_hello(kind: u8, payload: &[u8]) -> Result<Hello, WireError> {
    let mut hello: Hello = parse(kind, payload)?;
    hello.name = hello.name.chars().take(NAME_CHARS_MAX).collect();
    hello.capabilities.truncate(CAPABILITIES_MAX);
    Ok(hello)
}

fn parse_fetch(kind: u8, payload: &[u8]) -> Result<Vec<Digest>, WireError> {
    let digests: Vec<Digest> = parse(kind, payload)?;
    if digests.len() > FETCH_DIGESTS_MAX {
        let reason = format!("{} digests at once; {FETCH_DIGESTS_MAX} are allowed", digests.len());
        return Err(malformed(kind, reason));
    }
    Ok(digests)
}

fn parse_wants(kind: u8, payload: &[u8]) -> Result<Wants, WireError> {
    let wants: Wants = parse(kind, payload)?;
    if wants.targets.len() > WANTS_MAX {
        return Err(malformed(kind, format!("{} targets; {WANTS_MAX} are allowed", wants.targets.len())));
    }
    if wants.qualities.keys().any(|name| !wants.targets.contains(name)) {
        return Err(malformed(kind, "a quality of a target that is not wanted".to_owned()));
    }
    if wants.targets.iter().any(|name| name.chars().count() > NAME_CHARS_MAX) {
        return Err(malformed(kind, format!("a target's name of more than {NAME_CHARS_MAX} characters")));
    }
    Ok(wants)
}

fn parse_request(kind: u8, payload: &[u8]) -> Result<Request, WireError> {
    let request: Request = parse(kind, payload)?;
    request.ask.check().map_err(|reason| malformed(kind, reason))?;
    Ok(request)
}

impl Message for ClientMessage {
    const FRAME_BYTES_MAX: usize = CLIENT_FRAME_BYTES_MAX;

    fn encode(&self) -> Vec<u8> {
        match self {
            ClientMessage::Hello(hello) => json_frame(CLIENT_HELLO, hello),
            ClientMessage::Fetch(digests) => json_frame(CLIENT_FETCH, digests),
            ClientMessage::Frame(report) => json_frame(CLIENT_FRAME, report),
            ClientMessage::Wants(wants) => json_frame(CLIENT_WANTS, wants),
            ClientMessage::Ping(number) => frame(CLIENT_PING, &[&number.to_le_bytes()]),
            ClientMessage::Pong(number) => frame(CLIENT_PONG, &[&number.to_le_bytes()]),
            ClientMessage::Status => frame(CLIENT_STATUS, &[]),
            ClientMessage::Stop => frame(CLIENT_STOP, &[]),
            ClientMessage::Request(request) => json_frame(CLIENT_REQUEST, request),
        }
    }

    fn decode(kind: u8, payload: &[u8]) -> Result<Self, WireError> {
        match kind {
            CLIENT_HELLO => Ok(ClientMessage::Hello(parse_hello(kind, payload)?)),
            CLIENT_FETCH => Ok(ClientMessage::Fetch(parse_fetch(kind, payload)?)),
            CLIENT_FRAME => Ok(ClientMessage::Frame(parse::<FrameReport>(kind, payload)?)),
            CLIENT_WANTS => Ok(ClientMessage::Wants(parse_wants(kind, payload)?)),
            CLIENT_PING => Ok(ClientMessage::Ping(parse_number(kind, payload)?)),
            CLIENT_PONG => Ok(ClientMessage::Pong(parse_number(kind, payload)?)),
            CLIENT_STATUS => Ok(ClientMessage::Status),
            CLIENT_STOP => Ok(ClientMessage::Stop),
            CLIENT_REQUEST => Ok(ClientMessage::Request(parse_request(kind, payload)?)),
            other => Err(WireError::Type(other)),
        }
    }
}

impl Message for ServerMessage {
    const FRAME_BYTES_MAX: usize = SERVER_FRAME_BYTES_MAX;

    fn encode(&self) -> Vec<u8> {
        match self {
            ServerMessage::Hello(hello) => json_frame(SERVER_HELLO, hello),
            ServerMessage::Revision(table) => encode_revision(table),
            ServerMessage::Chunk { digest, offset, total, bytes } => {
                let header = chunk_header(digest, *offset, *total, bytes.len());
                [&header[..], bytes].concat()
            }
            ServerMessage::Missing(digest) => json_frame(SERVER_MISSING, digest),
            ServerMessage::Progress(progress) => json_frame(SERVER_PROGRESS, progress),
            ServerMessage::Ping(number) => frame(SERVER_PING, &[&number.to_le_bytes()]),
            ServerMessage::Pong(number) => frame(SERVER_PONG, &[&number.to_le_bytes()]),
            ServerMessage::Status(status) => json_frame(SERVER_STATUS, status),
            ServerMessage::Answer(answer) => json_frame(SERVER_ANSWER, answer),
        }
    }

    fn decode(kind: u8, payload: &[u8]) -> Result<Self, WireError> {
        match kind {
            SERVER_HELLO => Ok(ServerMessage::Hello(parse_hello(kind, payload)?)),
            SERVER_REVISION => Ok(ServerMessage::Revision(parse::<RevisionTable>(kind, payload)?)),
            SERVER_CHUNK => decode_chunk(payload),
            SERVER_MISSING => Ok(ServerMessage::Missing(parse(kind, payload)?)),
            SERVER_PROGRESS => Ok(ServerMessage::Progress(parse::<ProgressReport>(kind, payload)?)),
            SERVER_PING => Ok(ServerMessage::Ping(parse_number(kind, payload)?)),
            SERVER_PONG => Ok(ServerMessage::Pong(parse_number(kind, payload)?)),
            SERVER_STATUS => Ok(ServerMessage::Status(Box::new(parse::<DaemonStatus>(kind, payload)?))),
            SERVER_ANSWER => Ok(ServerMessage::Answer(parse::<Answer>(kind, payload)?)),
            other => Err(WireError::Type(other)),
        }
    }
}

/// The frame of a [`ServerMessage::Revision`], without a copy of the table.
pub(crate) fn encode_revision(table: &RevisionTable) -> Vec<u8> {
    json_frame(SERVER_REVISION, table)
}

/// What stands before the `length` bytes of a chunk.
pub(crate) fn chunk_header(digest: &Digest, offset: u64, total: u64, length: usize) -> Vec<u8> {
    let mut header = frame(SERVER_CHUNK, &[digest.as_bytes(), &offset.to_le_bytes(), &total.to_le_bytes()]);
    let bytes = u32::try_from(1 + CHUNK_HEADER_BYTES + length).unwrap_or(u32::MAX);
    header[..4].copy_from_slice(&bytes.to_le_bytes());
    header
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
