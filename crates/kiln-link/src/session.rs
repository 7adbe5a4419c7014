//! A client's half of the talk as a state machine without sockets or threads.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use kiln_build::{Digest, DigestBuilder};

use crate::{
    ClientEvent, ClientMessage, Hello, PROTOCOL_VERSION, Revision, RevisionTable, ServerMessage, capability,
};

/// Turns what the daemon says into requests and whole revisions. Contents survive a reconnection, so that a
/// client that has everything fetches nothing.
#[derive(Default)]
pub(crate) struct ClientSession {
    greeted: bool,
    contents: HashMap<Digest, Arc<[u8]>>,
    arriving: HashMap<Digest, Arriving>,
    requested: HashSet<Digest>,
    pending: Option<RevisionTable>,
    /// Contents of the newest whole revision.
    delivered: HashSet<Digest>,
}

/// A content longer than this is not given its room before it comes: a liar would have it for a few bytes.
const ROOM_BYTES_MAX: u64 = 256 << 20;

/// A content of which a part is here, and hashed while it was at hand.
struct Arriving {
    room: Room,
    length: usize,
    hasher: DigestBuilder,
}

enum Room {
    /// All of it, so that nothing is copied twice.
    Whole(Arc<[u8]>),
    Growing(Vec<u8>),
}

impl Arriving {
    fn new(total: u64) -> Arriving {
        let room = match usize::try_from(total) {
            Ok(bytes) if total <= ROOM_BYTES_MAX => Room::Whole(std::iter::repeat_n(0, bytes).collect()),
            _ => Room::Growing(Vec::new()),
        };
        Arriving { room, length: 0, hasher: DigestBuilder::default() }
    }

    /// Whether there is room for it.
    fn push(&mut self, bytes: &[u8]) -> bool {
        match &mut self.room {
            Room::Whole(room) => {
                let room =
                    Arc::get_mut(room).and_then(|room| room.get_mut(self.length..)?.get_mut(..bytes.len()));
                let Some(room) = room else { return false };
                room.copy_from_slice(bytes);
            }
            Room::Growing(room) => room.extend_from_slice(bytes),
        }
        self.length += bytes.len();
        self.hasher.update(bytes);
        true
    }

    fn finish(self) -> (Digest, Arc<[u8]>) {
        let bytes = match self.room {
            Room::Whole(room) => room,
            Room::Growing(room) => room.into(),
        };
        (self.hasher.finish(), bytes)
    }
}

/// What to do after a message.
#[derive(Default)]
pub(crate) struct Reaction {
    pub(crate) send: Vec<ClientMessage>,
    pub(crate) events: Vec<ClientEvent>,
    /// The daemon answered the ping of this number.
    pub(crate) pong: Option<u64>,
    /// The daemon greeted: whether it takes requests.
    pub(crate) takes_requests: Option<bool>,
}

impl ClientSession {
    /// Begins a new connection: what was asked of the old one will not come.
    pub(crate) fn reset(&mut self) {
        self.greeted = false;
        self.arriving.clear();
        self.requested.clear();
        self.pending = None;
    }

    /// Whether the daemon of this connection said who it is.
    pub(crate) fn is_greeted(&self) -> bool {
        self.greeted
    }

    /// Takes one message.
    ///
    /// # Errors
    /// The daemon broke the protocol; the text says how, and the connection must end.
    pub(crate) fn receive(&mut self, message: ServerMessage) -> Result<Reaction, String> {
        let mut reaction = Reaction::default();
        match message {
            ServerMessage::Hello(hello) => {
                reaction.takes_requests = Some(hello.can(capability::REQUESTS));
                let Hello { protocol, name: project, .. } = hello;
                if protocol != PROTOCOL_VERSION {
                    return Err(format!(
                        "the daemon speaks protocol {protocol}, this client {PROTOCOL_VERSION}: update the older one"
                    ));
                }
                self.greeted = true;
                reaction.events.push(ClientEvent::Connected { project });
            }
            _ if !self.greeted => return Err("the daemon did not begin with a greeting".to_owned()),
            ServerMessage::Revision(table) => {
                let wanted = digests(&table);
                self.contents.retain(|digest, _| wanted.contains(digest) || self.delivered.contains(digest));
                self.pending = Some(table);
                self.request_missing(&mut reaction);
                self.commit_if_whole(&mut reaction);
            }
            ServerMessage::Chunk { digest, offset, total, bytes } => {
                self.take_chunk(digest, offset, total, &bytes)?;
                self.commit_if_whole(&mut reaction);
            }
            // A newer revision does without it: a pending one that names it cannot become whole.
            ServerMessage::Missing(digest) => {
                self.requested.remove(&digest);
                self.arriving.remove(&digest);
                self.pending = self.pending.take().filter(|table| !digests(table).contains(&digest));
            }
            ServerMessage::Progress(progress) => reaction.events.push(ClientEvent::Progress {
                done: progress.done,
                total: progress.total,
                current: progress.current,
            }),
            ServerMessage::Ping(number) => reaction.send.push(ClientMessage::Pong(number)),
            ServerMessage::Pong(number) => reaction.pong = Some(number),
            // Nobody asked here.
            ServerMessage::Status(_) => {}
            ServerMessage::Answer(answer) => reaction.events.push(ClientEvent::Answer(answer)),
        }
        Ok(reaction)
    }

    fn request_missing(&mut self, reaction: &mut Reaction) {
        let Some(table) = &self.pending else { return };
        let parts = table.targets.values().flat_map(|target| &target.parts);
        let missing: Vec<Digest> = parts
            .map(|part| part.digest)
            .filter(|digest| !self.contents.contains_key(digest) && self.requested.insert(*digest))
            .collect();
        if !missing.is_empty() {
            reaction.send.push(ClientMessage::Fetch(missing));
        }
    }

    fn take_chunk(&mut self, digest: Digest, offset: u64, total: u64, bytes: &[u8]) -> Result<(), String> {
        if !self.requested.contains(&digest) {
            return Err(format!("the daemon sent content {} without being asked", digest.short()));
        }
        let content = self.arriving.entry(digest).or_insert_with(|| Arriving::new(total));
        if content.length as u64 != offset {
            return Err(format!(
                "a chunk of {} begins at {offset} instead of {}",
                digest.short(),
                content.length
            ));
        }
        if !content.push(bytes) {
            return Err(format!("content {} is longer than its first chunk said", digest.short()));
        }
        if (content.length as u64) < total {
            return Ok(());
        }
        let Some(content) = self.arriving.remove(&digest) else { return Ok(()) };
        self.requested.remove(&digest);
        let (arrived, content) = content.finish();
        if arrived != digest {
            return Err(format!("content {} arrived with other bytes", digest.short()));
        }
        self.contents.insert(digest, content);
        Ok(())
    }

    fn commit_if_whole(&mut self, reaction: &mut Reaction) {
        let Some(table) = &self.pending else { return };
        let wanted = digests(table);
        if !wanted.iter().all(|digest| self.contents.contains_key(digest)) {
            return;
        }
        self.contents.retain(|digest, _| wanted.contains(digest));
        self.delivered = wanted;
        let Some(table) = self.pending.take() else { return };
        if let Ok(revision) = Revision::new(table, self.contents.clone()) {
            reaction.events.push(ClientEvent::Revision(Arc::new(revision)));
        }
    }
}

fn digests(table: &RevisionTable) -> HashSet<Digest> {
    table.targets.values().flat_map(|target| &target.parts).map(|part| part.digest).collect()
}
