//! The order in which one client gets its contents, without sockets or clocks.
//!
//! Shaders come before maps, what the client shows before what it does not, small contents before large ones, which puts the coarse levels
//! of a cube before its fine ones. A large content is sent in pieces and steps back whenever something more urgent comes.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use kiln_build::Digest;

use crate::wire::CHUNK_BYTES;
use crate::{RevisionTable, Wants};

/// Contents of which a part is sent: so many are held in memory for one client.
const BEGUN_MAX: usize = 4;

/// How urgent a content is; the least is sent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Rank {
    is_no_shader: bool,
    is_not_shown: bool,
    bytes: u64,
}

/// A content that is partly sent.
#[derive(Clone, Debug)]
struct Begun {
    bytes: Arc<[u8]>,
    sent_bytes: usize,
}

/// What to write next.
#[derive(Debug, PartialEq)]
pub(crate) enum Step {
    /// A content that nothing was sent of yet: read it and call [`SendQueue::begin`], or [`SendQueue::forget`] it.
    Read(Digest),
    /// A piece of a content.
    Chunk { digest: Digest, bytes: Arc<[u8]>, offset: usize, end: usize },
    /// Say that this content will not come.
    Missing(Digest),
}

/// What one client asked for and has not got.
#[derive(Debug, Default)]
pub(crate) struct SendQueue {
    table: Arc<RevisionTable>,
    ranks: HashMap<Digest, Rank>,
    wants: Wants,
    waiting: BTreeMap<(Rank, Digest), Option<Begun>>,
    missing: HashSet<Digest>,
}

impl SendQueue {
    /// The client is told of this table: what only older ones name will not be sent.
    pub(crate) fn tell(&mut self, table: Arc<RevisionTable>) {
        self.table = table;
        self.rank_anew();
    }

    /// The client shows something else.
    pub(crate) fn set_wants(&mut self, wants: Wants) {
        self.wants = wants;
        self.rank_anew();
    }

    /// What the client shows.
    pub(crate) fn wants(&self) -> &Wants {
        &self.wants
    }

    /// The client asks for contents. One that it was not told of is missing.
    pub(crate) fn fetch(&mut self, digests: impl IntoIterator<Item = Digest>) {
        for digest in digests {
            match self.ranks.get(&digest) {
                Some(rank) => _ = self.waiting.entry((*rank, digest)).or_default(),
                None => _ = self.missing.insert(digest),
            }
        }
    }

    /// Number of answers that the client still waits for.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len() + self.missing.len()
    }

    /// What to do next; the same again until it is done.
    pub(crate) fn next(&self) -> Option<Step> {
        if let Some(digest) = self.missing.iter().next() {
            return Some(Step::Missing(*digest));
        }
        let is_begun = |begun: &Option<Begun>| begun.is_some();
        let is_full = self.waiting.values().filter(|begun| is_begun(begun)).count() >= BEGUN_MAX;
        let mut waiting = self.waiting.iter().filter(|(_, begun)| !is_full || is_begun(begun));
        let ((_, digest), begun) = waiting.next()?;
        Some(match begun {
            None => Step::Read(*digest),
            Some(Begun { bytes, sent_bytes }) => Step::Chunk {
                digest: *digest,
                bytes: bytes.clone(),
                offset: *sent_bytes,
                end: bytes.len().min(sent_bytes + CHUNK_BYTES),
            },
        })
    }

    /// The content of a [`Step::Read`].
    pub(crate) fn begin(&mut self, digest: Digest, bytes: Arc<[u8]>) {
        if let Some(begun) = self.entry(&digest) {
            *begun = Some(Begun { bytes, sent_bytes: 0 });
        }
    }

    /// The piece of this content that ends at `end` was written.
    pub(crate) fn written(&mut self, digest: Digest, end: usize) {
        let Some(begun) = self.entry(&digest).and_then(Option::as_mut) else { return };
        begun.sent_bytes = end;
        if end == begun.bytes.len() {
            self.forget(&digest);
        }
    }

    /// Nothing more is to be said about this content.
    pub(crate) fn forget(&mut self, digest: &Digest) {
        self.missing.remove(digest);
        if let Some(rank) = self.ranks.get(digest) {
            self.waiting.remove(&(*rank, *digest));
        }
    }

    fn entry(&mut self, digest: &Digest) -> Option<&mut Option<Begun>> {
        self.waiting.get_mut(&(*self.ranks.get(digest)?, *digest))
    }

    fn rank_anew(&mut self) {
        self.ranks = ranks(&self.table, &self.wants);
        // What this table names again is not missing: whoever was told so after it would give the table up.
        let missing = std::mem::take(&mut self.missing);
        self.fetch(missing);
        for ((_, digest), begun) in std::mem::take(&mut self.waiting) {
            match self.ranks.get(&digest) {
                Some(rank) => _ = self.waiting.insert((*rank, digest), begun),
                None => _ = self.missing.insert(digest),
            }
        }
    }
}

/// Of a content that several targets share, the most urgent rank counts.
fn ranks(table: &RevisionTable, wants: &Wants) -> HashMap<Digest, Rank> {
    let mut ranks: HashMap<Digest, Rank> = HashMap::new();
    for (name, target) in &table.targets {
        let is_no_shader = target.kind != "shader";
        let is_not_shown = !wants.include(name);
        for part in &target.parts {
            let rank = Rank { is_no_shader, is_not_shown, bytes: part.bytes };
            ranks.entry(part.digest).and_modify(|known| *known = rank.min(*known)).or_insert(rank);
        }
    }
    ranks
}
