//! What one client still has to be told, and the thread that tells it.
//!
//! Its size has a bound whatever the client does: at most one message of each kind waits, and newer ones replace older ones; contents
//! wait as digests ([`SendQueue`]), and answers are as few as open requests may be.

use std::collections::VecDeque;
use std::io::Write as _;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::queue::{SendQueue, Step};
use crate::server::BlobSource;
use crate::transport::Stream;
use crate::wire::{Message as _, chunk_header, encode_revision};
use crate::{Answer, ClientStatus, DaemonStatus, ProgressReport, RevisionTable, ServerMessage};

pub(crate) struct Outbox {
    state: Mutex<OutboxState>,
    changed: Condvar,
    stream: Stream,
}

#[derive(Default)]
pub(crate) struct OutboxState {
    pub(crate) table: Option<Arc<RevisionTable>>,
    pub(crate) progress: Option<ProgressReport>,
    pub(crate) status: Option<Box<DaemonStatus>>,
    pub(crate) pong: Option<u64>,
    pub(crate) queue: SendQueue,
    /// What is known of the client.
    pub(crate) facts: ClientStatus,
    /// Whether it follows revisions.
    pub(crate) follows: bool,
    /// What became of its requests: no more than [`crate::request::REQUESTS_MAX`].
    pub(crate) answers: VecDeque<Answer>,
    /// Requests whose answer is not yet written.
    pub(crate) open_requests: usize,
    ping: Option<u64>,
    pinged: Option<(u64, Instant)>,
    closed: bool,
}

/// What is written in one go.
pub(crate) enum Turn {
    Message(ServerMessage),
    Table(Arc<RevisionTable>),
    Content(Step),
}

impl OutboxState {
    /// What the daemon says of this client.
    pub(crate) fn client_status(&self) -> ClientStatus {
        ClientStatus {
            wants: self.queue.wants().targets.clone(),
            qualities: self.queue.wants().qualities.clone(),
            waiting_contents: self.queue.len(),
            ..self.facts.clone()
        }
    }

    /// An answer to a ping; one to a ping that was never sent is passed over.
    pub(crate) fn take_pong(&mut self, number: u64) {
        if let Some((_, sent)) = self.pinged.take_if(|(pinged, _)| *pinged == number) {
            self.facts.round_trip_ms = Some(sent.elapsed().as_secs_f64() * 1e3);
        }
    }

    /// The most urgent turn.
    pub(crate) fn next(&mut self) -> Option<Turn> {
        if let Some(number) = self.pong.take() {
            return Some(Turn::Message(ServerMessage::Pong(number)));
        }
        if let Some(number) = self.ping.take() {
            self.pinged = Some((number, Instant::now()));
            return Some(Turn::Message(ServerMessage::Ping(number)));
        }
        if let Some(status) = self.status.take() {
            return Some(Turn::Message(ServerMessage::Status(status)));
        }
        if let Some(answer) = self.answers.pop_front() {
            self.open_requests = self.open_requests.saturating_sub(1);
            return Some(Turn::Message(ServerMessage::Answer(answer)));
        }
        if let Some(table) = self.table.take() {
            self.queue.tell(table.clone());
            self.facts.told_revision = table.number;
            self.ping = Some(table.number);
            return Some(Turn::Table(table));
        }
        if let Some(progress) = self.progress.take() {
            return Some(Turn::Message(ServerMessage::Progress(progress)));
        }
        self.queue.next().map(Turn::Content)
    }
}

impl Outbox {
    pub(crate) fn new(stream: Stream) -> Outbox {
        Outbox { state: Mutex::default(), changed: Condvar::new(), stream }
    }

    pub(crate) fn state(&self) -> MutexGuard<'_, OutboxState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn update(&self, change: impl FnOnce(&mut OutboxState)) {
        change(&mut self.state());
        self.changed.notify_one();
    }

    pub(crate) fn close(&self) {
        self.update(|state| state.closed = true);
        // Wakes the reading thread; the stream may be broken already.
        let _ = self.stream.shutdown();
    }

    /// Writes, most urgent first, until the outbox closes.
    pub(crate) fn write_all(&self, blobs: &BlobSource, mut stream: Stream) -> std::io::Result<()> {
        while let Some(turn) = self.wait() {
            match turn {
                Turn::Message(message) => stream.write_all(&message.encode())?,
                Turn::Table(table) => stream.write_all(&encode_revision(&table))?,
                Turn::Content(step) => self.write_content(blobs, &mut stream, step)?,
            }
        }
        Ok(())
    }

    /// The next turn; `None` when the outbox closes.
    fn wait(&self) -> Option<Turn> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            if let Some(turn) = state.next() {
                return Some(turn);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn write_content(&self, blobs: &BlobSource, stream: &mut Stream, step: Step) -> std::io::Result<()> {
        match step {
            Step::Read(digest) => match blobs(&digest) {
                Some(bytes) => self.state().queue.begin(digest, bytes),
                None => self.write_missing(stream, digest)?,
            },
            Step::Missing(digest) => self.write_missing(stream, digest)?,
            Step::Chunk { digest, bytes, offset, end } => {
                let header = chunk_header(&digest, offset as u64, bytes.len() as u64, end - offset);
                stream.write_all(&header)?;
                stream.write_all(&bytes[offset..end])?;
                self.state().queue.written(digest, end);
            }
        }
        Ok(())
    }

    fn write_missing(&self, stream: &mut Stream, digest: kiln_build::Digest) -> std::io::Result<()> {
        self.state().queue.forget(&digest);
        stream.write_all(&ServerMessage::Missing(digest).encode())
    }
}
