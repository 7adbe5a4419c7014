//! The daemon's half: any number of clients, none of which can slow the build or another client.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use kiln_build::{Digest, TargetState};
use kiln_diagnostic::Diagnostic;
use tracing::{debug, trace, warn};

use crate::outbox::Outbox;
use crate::request::REQUESTS_MAX;
use crate::transport::Stream;
use crate::wire::{FETCH_DIGESTS_MAX, Message as _};
use crate::{
    Answer, Ask, BuildStatus, ClientMessage, ClientStatus, DaemonStatus, Decoder, FrameReport, Hello,
    PROTOCOL_VERSION, ProgressReport, Request, RevisionTable, ServerMessage, Token, Wants, capability,
    transport,
};

/// Connections at once.
const CONNECTIONS_MAX: usize = 64;
/// The same by TCP, where other users may come and go: they take nobody's place at the socket.
const TCP_CONNECTIONS_MAX: usize = 16;
/// Who has not greeted may send so much: more than any greeting.
const GREETING_BYTES_MAX: usize = 64 << 10;
/// A client that takes no byte for this long is let go.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Who connects has this long to say who it is.
const GREETING_TIMEOUT: Duration = Duration::from_secs(10);

/// Where contents come from.
pub type BlobSource = dyn Fn(&Digest) -> Option<Arc<[u8]>> + Send + Sync;

/// What clients do, as the daemon sees it. Who only asks for the status is no client.
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
    /// A client wants something else than before: see [`Server::wanted`].
    Wants {
        /// Which.
        client: u64,
    },
    /// A client saw a revision: one that it was told of, and each but once.
    Frame {
        /// Which.
        client: u64,
        /// When.
        report: FrameReport,
    },
    /// Somebody asked the daemon to end.
    StopAsked,
    /// Somebody asked for a change of the project; [`Server::answer`] it.
    Asked {
        /// Who.
        client: u64,
        /// What.
        request: Request,
    },
}

/// A listening socket and its clients.
pub struct Server {
    shared: Arc<Shared>,
    socket: PathBuf,
    tcp: Option<Tcp>,
}

/// Where it listens besides.
struct Tcp {
    address: SocketAddr,
    token_file: PathBuf,
}

struct Shared {
    project: String,
    since_unix_ms: f64,
    blobs: Box<BlobSource>,
    events: Box<dyn Fn(ServerEvent) + Send + Sync>,
    next_client: AtomicU64,
    clients: Mutex<BTreeMap<u64, Arc<Outbox>>>,
    latest: Mutex<Option<Arc<RevisionTable>>>,
    building: Mutex<Option<BuildStatus>>,
    stopping: AtomicBool,
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
            since_unix_ms: unix_ms(),
            blobs,
            events,
            next_client: AtomicU64::new(1),
            clients: Mutex::default(),
            latest: Mutex::default(),
            building: Mutex::default(),
            stopping: AtomicBool::new(false),
        });
        let accepting = shared.clone();
        std::thread::spawn(move || {
            let streams = listener.incoming().map(|stream| {
                let stream = stream?;
                transport::check_peer(&stream)?;
                Ok(Stream::Unix(stream))
            });
            accept(streams, CONNECTIONS_MAX, None, &accepting);
        });
        Ok(Server { shared, socket: socket.to_owned(), tcp: None })
    }

    /// Listens at a port of this machine too (0: any free one), for clients that cannot use the socket and show the token in the
    /// file beside it. Returns the address and that file.
    ///
    /// # Errors
    /// The address is not this machine's own, the port is taken, or the token cannot be written.
    pub fn listen(&mut self, address: SocketAddr) -> std::io::Result<(SocketAddr, PathBuf)> {
        if !address.ip().is_loopback() {
            let reason = format!(
                "{} can be reached from other machines; only 127.0.0.1 and [::1] are allowed",
                address.ip()
            );
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, reason));
        }
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let (token, token_file) = (Token::random()?, self.socket.with_extension("token"));
        token.write(&token_file)?;
        let accepting = self.shared.clone();
        std::thread::spawn(move || {
            let streams = listener.incoming().map(|stream| {
                let stream = stream?;
                stream.set_nodelay(true)?;
                Ok(Stream::Tcp(stream))
            });
            accept(streams, TCP_CONNECTIONS_MAX, Some(&token), &accepting);
        });
        self.tcp = Some(Tcp { address, token_file: token_file.clone() });
        Ok((address, token_file))
    }

    /// Makes `table` what every client sees; a client that has not taken the one before never gets it.
    pub fn publish(&self, table: Arc<RevisionTable>) {
        *lock(&self.shared.latest) = Some(table.clone());
        self.tell_followers(|outbox| outbox.update(|state| state.table = Some(table.clone())));
    }

    /// Says for [`DaemonStatus`] which files' change is being built; `None` when nothing is.
    pub fn set_building(&self, files: Option<Vec<String>>) {
        let status = |files| BuildStatus { files, ..BuildStatus::default() };
        *lock(&self.shared.building) = files.map(status);
    }

    /// Tells every client how far a build is.
    pub fn report_progress(&self, progress: &ProgressReport) {
        if let Some(building) = &mut *lock(&self.shared.building) {
            building.progress = progress.clone();
        }
        self.tell_followers(|outbox| outbox.update(|state| state.progress = Some(progress.clone())));
    }

    /// Tells a client what became of its request. If it is gone nobody hears of it.
    pub fn answer(&self, client: u64, answer: Answer) {
        let outbox = lock(&self.shared.clients).get(&client).cloned();
        if let Some(outbox) = outbox {
            outbox.update(|state| state.answers.push_back(answer));
        }
    }

    /// How this daemon is.
    pub fn status(&self) -> DaemonStatus {
        self.shared.status()
    }

    /// What the clients show, as far as they said: each target once, as good as the most demanding of them wants it.
    pub fn wanted(&self) -> Wants {
        let wants = |outbox: &Arc<Outbox>| outbox.state().queue.wants().clone();
        let all: Vec<Wants> = lock(&self.shared.clients).values().map(wants).collect();
        Wants::together(&all)
    }

    fn tell_followers(&self, tell: impl Fn(&Outbox)) {
        for outbox in lock(&self.shared.clients).values() {
            if outbox.state().follows {
                tell(outbox);
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stopping.store(true, Ordering::SeqCst);
        // Wakes the accepting threads; if nobody accepts any more there is nothing to wake.
        let _ = UnixStream::connect(&self.socket);
        if let Some(tcp) = &self.tcp {
            let _ = TcpStream::connect(tcp.address);
            let _ = fs::remove_file(&tcp.token_file);
        }
        // Gone already if somebody cleaned the runtime folder. Before clients hear of the end, so that it is true.
        let _ = fs::remove_file(&self.socket);
        for outbox in lock(&self.shared.clients).values() {
            outbox.close();
        }
    }
}

impl Shared {
    fn status(&self) -> DaemonStatus {
        let status = DaemonStatus {
            project: self.project.clone(),
            pid: std::process::id(),
            since_unix_ms: self.since_unix_ms,
            building: lock(&self.building).clone(),
            clients: self.client_statuses(),
            ..DaemonStatus::default()
        };
        let Some(table) = lock(&self.latest).clone() else { return status };
        let building =
            status.building.map(|building| BuildStatus { targets: table.building.clone(), ..building });
        let is_stale = |name: &&String| table.targets[*name].state == TargetState::Stale;
        DaemonStatus {
            revision: table.number,
            published_unix_ms: table.work.published_unix_ms,
            targets: table.targets.len(),
            stale: table.targets.keys().filter(is_stale).cloned().collect(),
            errors: table.diagnostics.iter().filter(|diagnostic| diagnostic.is_error()).cloned().collect(),
            building,
            ..status
        }
    }

    fn client_statuses(&self) -> Vec<ClientStatus> {
        let clients = lock(&self.clients);
        let states = clients.values().map(|outbox| outbox.state());
        states.filter(|state| state.follows).map(|state| state.client_status()).collect()
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}

/// Serves whoever comes, `connections_max` at once.
fn accept(
    streams: impl Iterator<Item = std::io::Result<Stream>>,
    connections_max: usize,
    token: Option<&Token>,
    shared: &Arc<Shared>,
) {
    let connections = Arc::new(AtomicUsize::new(0));
    for stream in streams {
        if shared.stopping.load(Ordering::SeqCst) {
            return;
        }
        let stream = match stream {
            Ok(stream) => stream,
            Err(error) => {
                warn!(target: "wire", %error, "refused");
                continue;
            }
        };
        if connections.load(Ordering::SeqCst) >= connections_max {
            warn!(target: "wire", "{connections_max} connections are open: one more is closed");
            continue;
        }
        let client = shared.next_client.fetch_add(1, Ordering::SeqCst);
        let (shared, connections, token) = (shared.clone(), connections.clone(), token.cloned());
        connections.fetch_add(1, Ordering::SeqCst);
        std::thread::spawn(move || {
            let reason = serve(&shared, client, stream, token.as_ref()).unwrap_or_else(|reason| reason);
            let outbox = lock(&shared.clients).remove(&client);
            let is_client = outbox.as_ref().is_none_or(|outbox| outbox.state().follows);
            if let Some(outbox) = outbox {
                outbox.close();
            }
            connections.fetch_sub(1, Ordering::SeqCst);
            debug!(target: "wire", client, reason, "gone");
            if is_client {
                (shared.events)(ServerEvent::Gone { client, reason });
            }
        });
    }
}

/// Talks to one client until it goes; both results say why it did.
fn serve(shared: &Arc<Shared>, client: u64, stream: Stream, token: Option<&Token>) -> Result<String, String> {
    let text = |error: std::io::Error| error.to_string();
    stream.set_write_timeout(Some(WRITE_TIMEOUT)).map_err(text)?;
    stream.set_read_timeout(Some(GREETING_TIMEOUT)).map_err(text)?;
    let outbox = Arc::new(Outbox::new(stream.try_clone().map_err(text)?));
    let mut reader = stream.try_clone().map_err(text)?;
    let mut decoder = Decoder::default();
    let mut buffer = vec![0; 64 << 10];
    let mut writer = Some(stream);
    loop {
        match reader.read(&mut buffer) {
            Ok(0) => return Ok("it closed the connection".to_owned()),
            Ok(count) => decoder.push(&buffer[..count]),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(_) if writer.is_some() => return Err("it did not greet in time".to_owned()),
            Err(error) => return Err(text(error)),
        }
        while let Some(message) =
            decoder.next_message::<ClientMessage>().map_err(|error| error.to_string())?
        {
            match (message, writer.take()) {
                (ClientMessage::Hello(hello), Some(stream)) => {
                    check_token(token, hello.token.as_ref())?;
                    greet(shared, client, &outbox, stream, hello)?;
                }
                (ClientMessage::Hello(_), None) => return Err("it greeted twice".to_owned()),
                (_, Some(_)) => return Err("it did not begin with a greeting".to_owned()),
                (message, None) => receive(shared, client, &outbox, message)?,
            }
        }
        if writer.is_some() && decoder.waiting_bytes() > GREETING_BYTES_MAX {
            return Err("it did not begin with a greeting".to_owned());
        }
    }
}

/// Who comes by TCP and does not show the token is told nothing, not even who is here.
fn check_token(token: Option<&Token>, shown: Option<&Token>) -> Result<(), String> {
    match (token, shown) {
        (Some(token), Some(shown)) if token.is(shown) => Ok(()),
        (None, _) => Ok(()),
        (Some(_), shown) => {
            let what = if shown.is_some() { "another token" } else { "no token" };
            warn!(target: "wire", "refused a client that showed {what}");
            Err(format!("it showed {what}"))
        }
    }
}

fn greet(
    shared: &Arc<Shared>,
    client: u64,
    outbox: &Arc<Outbox>,
    mut stream: Stream,
    hello: Hello,
) -> Result<(), String> {
    let answer =
        ServerMessage::Hello(Hello::new(&shared.project, &[capability::REVISIONS, capability::REQUESTS]));
    stream.write_all(&answer.encode()).map_err(|error| error.to_string())?;
    if hello.protocol != PROTOCOL_VERSION {
        return Err(format!("it speaks protocol {}, this daemon {PROTOCOL_VERSION}", hello.protocol));
    }
    stream.set_read_timeout(None).map_err(|error| error.to_string())?;
    let follows = hello.can(capability::REVISIONS);
    debug!(target: "wire", client, name = hello.name, follows, "greeted");
    outbox.update(|state| {
        state.follows = follows;
        state.facts.client = client;
        state.facts.name.clone_from(&hello.name);
        state.facts.since_unix_ms = unix_ms();
    });
    // Registered before the latest table is read, so that no revision falls between the two.
    lock(&shared.clients).insert(client, outbox.clone());
    if follows {
        if let Some(table) = lock(&shared.latest).clone() {
            outbox.update(|state| _ = state.table.get_or_insert(table));
        }
        (shared.events)(ServerEvent::Connected { client, name: hello.name });
    }
    let (shared, outbox) = (shared.clone(), outbox.clone());
    std::thread::spawn(move || {
        if outbox.write_all(&*shared.blobs, stream).is_err() {
            outbox.close();
        }
    });
    Ok(())
}

/// Takes a message of a client that has greeted.
fn receive(shared: &Shared, client: u64, outbox: &Outbox, message: ClientMessage) -> Result<(), String> {
    match message {
        ClientMessage::Hello(_) => {}
        ClientMessage::Fetch(digests) => {
            trace!(target: "wire", client, contents = digests.len(), "fetches");
            outbox.update(|state| state.queue.fetch(digests));
            if outbox.state().queue.len() > FETCH_DIGESTS_MAX {
                return Err("it asked for more than a revision holds".to_owned());
            }
        }
        ClientMessage::Frame(report) => take_frame(shared, client, outbox, report),
        ClientMessage::Wants(wants) => {
            let is_new = *outbox.state().queue.wants() != wants;
            outbox.update(|state| state.queue.set_wants(wants));
            if is_new {
                (shared.events)(ServerEvent::Wants { client });
            }
        }
        ClientMessage::Ping(number) => outbox.update(|state| state.pong = Some(number)),
        ClientMessage::Pong(number) => outbox.state().take_pong(number),
        ClientMessage::Status => {
            let status = shared.status();
            outbox.update(|state| state.status = Some(Box::new(status)));
        }
        ClientMessage::Stop => (shared.events)(ServerEvent::StopAsked),
        ClientMessage::Request(request) => {
            let mut state = outbox.state();
            state.open_requests += 1;
            if state.open_requests > REQUESTS_MAX {
                return Err(format!("it asked for more than {REQUESTS_MAX} things at once"));
            }
            let lasts = state.follows || !matches!(request.ask, Ask::BakeAtError { .. });
            drop(state);
            if !lasts {
                // It would end with the answer: nobody would see it.
                let fault = Diagnostic::error(
                    "an error is kept for as long as a client follows revisions, and this one does not",
                );
                let answer =
                    Answer::refused(request.id, fault.with_help("greet with the capability `revisions`"));
                outbox.update(|state| state.answers.push_back(answer));
                return Ok(());
            }
            (shared.events)(ServerEvent::Asked { client, request });
        }
    }
    Ok(())
}

/// A report counts once for each revision, so that a client cannot flood the daemon with them.
fn take_frame(shared: &Shared, client: u64, outbox: &Outbox, report: FrameReport) {
    let latest = lock(&shared.latest).clone();
    let mut state = outbox.state();
    let facts = &mut state.facts;
    if report.revision <= facts.shown_revision || report.revision > facts.told_revision {
        return;
    }
    facts.shown_revision = report.revision;
    facts.shown_after_ms = latest
        .filter(|table| table.number == report.revision)
        .map(|table| report.drawn_unix_ms - table.work.published_unix_ms);
    drop(state);
    (shared.events)(ServerEvent::Frame { client, report });
}
