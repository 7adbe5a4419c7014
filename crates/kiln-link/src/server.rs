//! The daemon's half: any number of clients, none of which can slow the build or another client.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use kiln_build::Digest;

use crate::wire::{CHUNK_BYTES, FETCH_DIGESTS_MAX, Message as _};
use crate::{
    ClientMessage, Decoder, FrameReport, PROTOCOL_VERSION, ProgressReport, RevisionTable, ServerMessage,
    transport,
};

/// Clients at once.
const CLIENTS_MAX: usize = 64;
/// A client that takes no byte for this long is let go.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// Where contents come from.
pub type BlobSource = dyn Fn(&Digest) -> Option<Arc<[u8]>> + Send + Sync;

/// What clients do, as the daemon sees it.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerEvent {
    /// A client greeted.
    Connected {
        /// Counts up.
        client: u64,
        /// Its own name.
        name: String,
    },
    /// A client left, or was let go.
    Gone {
        /// Which.
        client: u64,
        /// Why.
        reason: String,
    },
    /// A client saw a revision.
    Frame {
        /// Which.
        client: u64,
        /// When.
        report: FrameReport,
    },
}

/// A listening socket and its clients.
pub struct Server {
    shared: Arc<Shared>,
    socket: PathBuf,
}

struct Shared {
    project: String,
    blobs: Box<BlobSource>,
    events: Box<dyn Fn(ServerEvent) + Send + Sync>,
    clients: Mutex<BTreeMap<u64, Arc<Outbox>>>,
    latest: Mutex<Option<Arc<RevisionTable>>>,
    stopping: AtomicBool,
}

/// What one client still has to be told: at most one table, one progress line and a set of digests, so its
/// size has a bound whatever the client does.
struct Outbox {
    state: Mutex<OutboxState>,
    changed: Condvar,
    stream: UnixStream,
}

#[derive(Default)]
struct OutboxState {
    table: Option<Arc<RevisionTable>>,
    progress: Option<ProgressReport>,
    fetches: BTreeSet<Digest>,
    closed: bool,
}

impl Server {
    /// Listens at `socket`, replacing a stale one: the caller holds the project's [`crate::ProjectLock`].
    /// `events` is called from the server's threads.
    pub fn bind(
        socket: &Path,
        project: &str,
        blobs: Box<BlobSource>,
        events: Box<dyn Fn(ServerEvent) + Send + Sync>,
    ) -> std::io::Result<Server> {
        match fs::remove_file(socket) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let listener = UnixListener::bind(socket)?;
        fs::set_permissions(socket, fs::Permissions::from_mode(0o600))?;
        let shared = Arc::new(Shared {
            project: project.to_owned(),
            blobs,
            events,
            clients: Mutex::default(),
            latest: Mutex::default(),
            stopping: AtomicBool::new(false),
        });
        let accepting = shared.clone();
        std::thread::spawn(move || accept(&listener, &accepting));
        Ok(Server { shared, socket: socket.to_owned() })
    }

    /// Makes `table` what every client sees; a client that has not taken the one before never gets it.
    pub fn publish(&self, table: Arc<RevisionTable>) {
        *lock(&self.shared.latest) = Some(table.clone());
        for outbox in lock(&self.shared.clients).values() {
            outbox.update(|state| state.table = Some(table.clone()));
        }
    }

    /// Tells every client how far a build is.
    pub fn report_progress(&self, progress: &ProgressReport) {
        for outbox in lock(&self.shared.clients).values() {
            outbox.update(|state| state.progress = Some(progress.clone()));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stopping.store(true, Ordering::SeqCst);
        // Wakes the accepting thread; if nobody accepts any more there is nothing to wake.
        let _ = UnixStream::connect(&self.socket);
        for outbox in lock(&self.shared.clients).values() {
            outbox.close();
        }
        // Gone already if somebody cleaned the runtime folder.
        let _ = fs::remove_file(&self.socket);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Outbox {
    fn update(&self, change: impl FnOnce(&mut OutboxState)) {
        change(&mut lock(&self.state));
        self.changed.notify_one();
    }

    fn close(&self) {
        self.update(|state| state.closed = true);
        // Wakes the reading thread; the stream may be broken already.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

fn accept(listener: &UnixListener, shared: &Arc<Shared>) {
    let mut next_client = 1;
    for stream in listener.incoming() {
        if shared.stopping.load(Ordering::SeqCst) {
            return;
        }
        let Ok(stream) = stream else { continue };
        let full = lock(&shared.clients).len() >= CLIENTS_MAX;
        if full || transport::check_peer(&stream).is_err() {
            continue;
        }
        let (shared, client) = (shared.clone(), next_client);
        next_client += 1;
        std::thread::spawn(move || {
            let reason = serve(&shared, client, stream).unwrap_or_else(|reason| reason);
            if let Some(outbox) = lock(&shared.clients).remove(&client) {
                outbox.close();
            }
            (shared.events)(ServerEvent::Gone { client, reason });
        });
    }
}

/// Talks to one client until it goes; both results say why it did.
fn serve(shared: &Arc<Shared>, client: u64, stream: UnixStream) -> Result<String, String> {
    let text = |error: std::io::Error| error.to_string();
    stream.set_write_timeout(Some(WRITE_TIMEOUT)).map_err(text)?;
    let outbox = Arc::new(Outbox {
        state: Mutex::default(),
        changed: Condvar::new(),
        stream: stream.try_clone().map_err(text)?,
    });
    let mut reader = stream.try_clone().map_err(text)?;
    let mut decoder = Decoder::default();
    let mut buffer = vec![0; 64 << 10];
    let mut writer = Some(stream);
    loop {
        match reader.read(&mut buffer).map_err(text)? {
            0 => return Ok("it closed the connection".to_owned()),
            count => decoder.push(&buffer[..count]),
        }
        while let Some(message) =
            decoder.next_message::<ClientMessage>().map_err(|error| error.to_string())?
        {
            match message {
                ClientMessage::Hello { protocol, name } => {
                    let Some(stream) = writer.take() else { return Err("it greeted twice".to_owned()) };
                    greet(shared, client, &outbox, stream, protocol, name)?;
                }
                _ if writer.is_some() => return Err("it did not begin with a greeting".to_owned()),
                ClientMessage::Fetch(digests) => {
                    outbox.update(|state| state.fetches.extend(digests));
                    if lock(&outbox.state).fetches.len() > FETCH_DIGESTS_MAX {
                        return Err("it asked for more than a revision holds".to_owned());
                    }
                }
                ClientMessage::Frame(report) => (shared.events)(ServerEvent::Frame { client, report }),
            }
        }
    }
}

fn greet(
    shared: &Arc<Shared>,
    client: u64,
    outbox: &Arc<Outbox>,
    mut stream: UnixStream,
    protocol: u32,
    name: String,
) -> Result<(), String> {
    let hello = ServerMessage::Hello { protocol: PROTOCOL_VERSION, project: shared.project.clone() };
    stream.write_all(&hello.encode()).map_err(|error| error.to_string())?;
    if protocol != PROTOCOL_VERSION {
        return Err(format!("it speaks protocol {protocol}, this daemon {PROTOCOL_VERSION}"));
    }
    // Registered before the latest table is read, so that no revision falls between the two.
    lock(&shared.clients).insert(client, outbox.clone());
    if let Some(table) = lock(&shared.latest).clone() {
        outbox.update(|state| _ = state.table.get_or_insert(table));
    }
    (shared.events)(ServerEvent::Connected { client, name });
    let (shared, outbox) = (shared.clone(), outbox.clone());
    std::thread::spawn(move || {
        if write_all(&shared, &outbox, stream).is_err() {
            outbox.close();
        }
    });
    Ok(())
}

/// Writes what the outbox holds, most urgent first, until it closes.
fn write_all(shared: &Shared, outbox: &Outbox, mut stream: UnixStream) -> std::io::Result<()> {
    let mut current: Option<(Digest, Arc<[u8]>, usize)> = None;
    loop {
        let mut state = lock(&outbox.state);
        while !state.closed
            && state.table.is_none()
            && state.progress.is_none()
            && current.is_none()
            && state.fetches.is_empty()
        {
            state = outbox.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.closed {
            return Ok(());
        }
        let table = state.table.take();
        let progress = state.progress.take();
        let fetch = if current.is_none() { state.fetches.pop_first() } else { None };
        drop(state);
        if let Some(table) = table {
            stream.write_all(&ServerMessage::Revision((*table).clone()).encode())?;
        }
        if let Some(progress) = progress {
            stream.write_all(&ServerMessage::Progress(progress).encode())?;
        }
        if let Some(digest) = fetch {
            match (shared.blobs)(&digest) {
                Some(bytes) => current = Some((digest, bytes, 0)),
                None => stream.write_all(&ServerMessage::Missing(digest).encode())?,
            }
        }
        if let Some((digest, bytes, offset)) = current.take() {
            let end = bytes.len().min(offset + CHUNK_BYTES);
            let chunk = ServerMessage::Chunk {
                digest,
                offset: offset as u64,
                total: bytes.len() as u64,
                bytes: bytes[offset..end].to_vec(),
            };
            stream.write_all(&chunk.encode())?;
            current = (end < bytes.len()).then_some((digest, bytes, end));
        }
    }
}
