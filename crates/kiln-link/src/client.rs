//! A client that stays connected: whole revisions in, frame reports out.

use std::collections::BTreeSet;
use std::io::{Read as _, Write as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kiln_diagnostic::Diagnostic;

use crate::request::REQUESTS_MAX;
use crate::session::ClientSession;
use crate::transport::Stream;
use crate::wire::Message as _;
use crate::{
    Answer, Ask, ClientMessage, Decoder, Endpoint, FrameReport, Hello, Quality, Request, Revision,
    ServerMessage, Wants, capability,
};

/// How long a client waits before it looks for a daemon again.
const RETRY: Duration = Duration::from_millis(200);

/// Messages that are read and not yet looked at: while one content is checked the next arrives.
const AHEAD_MAX: usize = 32;

/// What happens on the wire, as a client's owner sees it.
#[derive(Clone, Debug)]
pub enum ClientEvent {
    /// A daemon answered.
    Connected {
        /// Name of its project.
        project: String,
    },
    /// There is no daemon, or it went away; the client keeps trying. Sent once for each loss.
    Disconnected {
        /// Why.
        reason: String,
    },
    /// A new state of the project, whole.
    Revision(Arc<Revision>),
    /// How far a build is.
    Progress {
        /// Actions settled.
        done: usize,
        /// Actions in all.
        total: usize,
        /// What runs now; empty when the build has ended.
        current: String,
    },
    /// What became of a request; of one that was open when the connection ended, that this is not known.
    Answer(Answer),
}

/// A connection that is made again whenever it breaks, until the client is dropped.
#[derive(Debug)]
pub struct Client {
    events: Receiver<ClientEvent>,
    writer: Arc<Mutex<Writer>>,
    stop: Option<Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Client {
    /// Begins to talk to the daemon at `endpoint` (a socket's path is one), now or whenever there is one; `name` is for its status
    /// lines.
    pub fn connect(endpoint: impl Into<Endpoint>, name: &str) -> Client {
        let (sender, events) = channel();
        Client::start(endpoint.into(), name, events, Box::new(move |event| sender.send(event).is_ok()))
    }

    /// Does what [`Client::connect`] does, and calls `tell` with each event from the thread that reads, without a step between;
    /// [`Client::events`] has none. Once `tell` says false the client ends.
    pub fn connect_and_tell(
        endpoint: impl Into<Endpoint>,
        name: &str,
        tell: impl Fn(ClientEvent) -> bool + Send + 'static,
    ) -> Client {
        let (_, events) = channel();
        Client::start(endpoint.into(), name, events, Box::new(tell))
    }

    fn start(endpoint: Endpoint, name: &str, events: Receiver<ClientEvent>, tell: Box<Tell>) -> Client {
        let (stop, stopped) = channel();
        let writer = Arc::new(Mutex::new(Writer::default()));
        let talk = Talk { endpoint, name: name.to_owned(), tell, writer: writer.clone() };
        let thread = std::thread::spawn(move || talk.run(&stopped));
        Client { events, writer, stop: Some(stop), thread: Some(thread) }
    }

    /// For threads that see frames and nothing else of the client.
    pub fn reporter(&self) -> FrameReporter {
        FrameReporter(self.writer.clone())
    }

    /// What happened, in order.
    pub fn events(&self) -> &Receiver<ClientEvent> {
        &self.events
    }

    /// Tells the daemon which targets are shown (names, or groups as `env/sky`); they come first. Holds for later
    /// connections too.
    pub fn want(&self, targets: Vec<String>) {
        self.want_at(targets.into_iter().map(|name| (name, Quality::Final)).collect());
    }

    /// Does what [`Client::want`] does, and says how good each must be to be worth showing.
    pub fn want_at(&self, targets: Vec<(String, Quality)>) {
        let less = targets.iter().filter(|(_, quality)| *quality < Quality::Final).cloned();
        let qualities = less.collect();
        let mut writer = self.lock_writer();
        writer.wants = Wants { targets: targets.into_iter().map(|(name, _)| name).collect(), qualities };
        writer.send_wants();
    }

    /// Asks the daemon for a sign of life; [`Client::round_trip`] says how long it took.
    pub fn ping(&self) {
        let mut writer = self.lock_writer();
        let number = writer.pinged.map_or(1, |(number, _)| number + 1);
        writer.pinged = Some((number, Instant::now()));
        writer.send(&ClientMessage::Ping(number));
    }

    /// How long the daemon's answer to the newest answered ping took.
    pub fn round_trip(&self) -> Option<Duration> {
        self.lock_writer().round_trip
    }

    /// Tells the daemon when a revision was seen; without a connection it is lost, and nothing depends on it.
    pub fn report_frame(&self, report: FrameReport) {
        self.lock_writer().send(&ClientMessage::Frame(report));
    }

    /// Asks the daemon to change the project; a [`ClientEvent::Answer`] of the returned number says what became of it.
    ///
    /// # Errors
    /// There is no daemon, it takes no requests, or too many are open; the text says so.
    pub fn request(&self, ask: Ask) -> Result<u64, Box<Diagnostic>> {
        let mut writer = self.lock_writer();
        if writer.stream.is_none() {
            return Err(Diagnostic::error("there is no daemon to do this")
                .with_help("start one with `kiln watch`")
                .into());
        }
        if !writer.takes_requests {
            let fault = Diagnostic::error("this daemon is older and takes no requests");
            return Err(fault.with_help("end it with `kiln stop` and start it again").into());
        }
        if writer.open_requests.len() >= REQUESTS_MAX {
            return Err(
                Diagnostic::error(format!("{REQUESTS_MAX} requests wait for their answer already")).into()
            );
        }
        ask.check().map_err(Diagnostic::error)?;
        writer.last_request += 1;
        let id = writer.last_request;
        writer.open_requests.insert(id);
        writer.send(&ClientMessage::Request(Request { id, ask }));
        Ok(id)
    }

    fn lock_writer(&self) -> MutexGuard<'_, Writer> {
        lock(&self.writer)
    }
}

/// Tells the daemon of frames from any thread.
#[derive(Clone, Debug)]
pub struct FrameReporter(Arc<Mutex<Writer>>);

impl FrameReporter {
    /// As [`Client::report_frame`].
    pub fn report(&self, report: FrameReport) {
        lock(&self.0).send(&ClientMessage::Frame(report));
    }
}

fn lock(writer: &Mutex<Writer>) -> MutexGuard<'_, Writer> {
    writer.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Client {
    fn drop(&mut self) {
        drop(self.stop.take());
        let mut writer = self.lock_writer();
        writer.is_closed = true;
        if let Some(stream) = &writer.stream {
            // Wakes the reading thread; the stream may be broken already.
            let _ = stream.shutdown();
        }
        drop(writer);
        if let Some(thread) = self.thread.take() {
            // It has nothing to say that was not already an event.
            let _ = thread.join();
        }
    }
}

/// The sending end of the connection, while there is one.
#[derive(Debug, Default)]
struct Writer {
    stream: Option<Stream>,
    /// The client is being dropped: no stream may be stored any more, because nobody would shut it down.
    is_closed: bool,
    wants: Wants,
    pinged: Option<(u64, Instant)>,
    round_trip: Option<Duration>,
    /// Whether the daemon does.
    takes_requests: bool,
    /// The newest request's number.
    last_request: u64,
    /// Requests without an answer.
    open_requests: BTreeSet<u64>,
}

impl Writer {
    /// Without a connection it is lost.
    fn send(&mut self, message: &ClientMessage) {
        if let Some(stream) = &mut self.stream {
            // A broken stream is found and reported by the reading side.
            let _ = stream.write_all(&message.encode());
        }
    }

    fn send_wants(&mut self) {
        self.send(&ClientMessage::Wants(self.wants.clone()));
    }

    fn take_pong(&mut self, number: u64) {
        if let Some((_, sent)) = self.pinged.filter(|(pinged, _)| *pinged == number) {
            self.round_trip = Some(sent.elapsed());
        }
    }
}

/// Whether the owner still wants to hear more.
type Tell = dyn Fn(ClientEvent) -> bool + Send;

struct Talk {
    endpoint: Endpoint,
    name: String,
    tell: Box<Tell>,
    writer: Arc<Mutex<Writer>>,
}

impl Talk {
    fn lock_writer(&self) -> MutexGuard<'_, Writer> {
        lock(&self.writer)
    }

    fn run(self, stopped: &Receiver<()>) {
        let mut session = ClientSession::default();
        let mut said: Option<String> = None;
        loop {
            let (was_connected, reason) = match self.open() {
                Ok(stream) => (true, self.talk(stream, &mut session)),
                Err(error) => (false, describe_open_error(&self.endpoint, &error)),
            };
            if !self.close_requests() {
                return;
            }
            if was_connected || said.as_ref() != Some(&reason) {
                said = Some(reason.clone());
                if !(self.tell)(ClientEvent::Disconnected { reason }) {
                    return;
                }
            }
            match stopped.recv_timeout(RETRY) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Gives up the connection, and says that nobody will answer what is open. Whether anybody listens.
    fn close_requests(&self) -> bool {
        let mut writer = self.lock_writer();
        (writer.stream, writer.takes_requests) = (None, false);
        let open = std::mem::take(&mut writer.open_requests);
        drop(writer);
        open.into_iter().all(|id| {
            let lost = Diagnostic::error("the connection ended before the daemon answered")
                .with_help("look whether it was done, and ask again if it was not");
            (self.tell)(ClientEvent::Answer(Answer::refused(id, lost)))
        })
    }

    fn open(&self) -> std::io::Result<Stream> {
        let mut stream = Stream::connect(&self.endpoint)?;
        let mut hello = Hello::new(&self.name, &[capability::REVISIONS]);
        if let Endpoint::Tcp { token, .. } = &self.endpoint {
            hello.token = Some(token.clone());
        }
        stream.write_all(&ClientMessage::Hello(hello).encode())?;
        let mut writer = self.lock_writer();
        if writer.is_closed {
            return Err(std::io::Error::other("the client has ended"));
        }
        writer.stream = Some(stream.try_clone()?);
        if !writer.wants.targets.is_empty() {
            writer.send_wants();
        }
        Ok(stream)
    }

    /// Listens until the connection ends; returns why it did.
    fn talk(&self, stream: Stream, session: &mut ClientSession) -> String {
        session.reset();
        let (sender, messages) = sync_channel(AHEAD_MAX);
        let result = std::thread::scope(|scope| {
            let reading = scope.spawn(move || read_messages(stream, &sender));
            for message in messages {
                if let Err(reason) = self.take_message(message, session) {
                    // Wakes the reading thread; the stream may be broken already.
                    self.lock_writer().stream.iter().for_each(|stream| drop(stream.shutdown()));
                    return Err(reason);
                }
            }
            Ok(reading.join().unwrap_or_else(|_| "reading panicked".to_owned()))
        });
        match result {
            Ok(reason) if !session.is_greeted() && matches!(self.endpoint, Endpoint::Tcp { .. }) => {
                format!("{reason} without a greeting: is the token that of this daemon?")
            }
            Ok(reason) | Err(reason) => reason,
        }
    }

    fn take_message(&self, message: ServerMessage, session: &mut ClientSession) -> Result<(), String> {
        let reaction = session.receive(message)?;
        let mut writer = self.lock_writer();
        if let Some(number) = reaction.pong {
            writer.take_pong(number);
        }
        writer.takes_requests = reaction.takes_requests.unwrap_or(writer.takes_requests);
        for message in reaction.send {
            let stream = writer.stream.as_mut().ok_or("the connection is closing")?;
            stream.write_all(&message.encode()).map_err(|error| error.to_string())?;
        }
        drop(writer);
        for event in reaction.events {
            // An answer to nothing is passed over.
            if let ClientEvent::Answer(answer) = &event
                && !self.lock_writer().open_requests.remove(&answer.id)
            {
                continue;
            }
            if !(self.tell)(event) {
                return Err("the client has ended".to_owned());
            }
        }
        Ok(())
    }
}

/// Reads until the connection ends, or nobody listens; returns why.
fn read_messages(mut stream: Stream, messages: &SyncSender<ServerMessage>) -> String {
    let mut decoder = Decoder::default();
    let mut buffer = vec![0; 256 << 10];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return "the daemon ended the connection".to_owned(),
            Ok(count) => decoder.push(&buffer[..count]),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(error) => return error.to_string(),
        }
        loop {
            match decoder.next_message::<ServerMessage>() {
                Ok(None) => break,
                Ok(Some(message)) => {
                    if messages.send(message).is_err() {
                        return "the client has ended".to_owned();
                    }
                }
                Err(error) => return error.to_string(),
            }
        }
    }
}

fn describe_open_error(endpoint: &Endpoint, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound | std::io::ErrorKind::ConnectionRefused => {
            "no daemon serves this project; start one with `kiln watch`".to_owned()
        }
        _ => match endpoint {
            Endpoint::Socket(socket) => format!("cannot connect to {}: {error}", socket.display()),
            Endpoint::Tcp { address, .. } => format!("cannot connect to {address}: {error}"),
        },
    }
}
