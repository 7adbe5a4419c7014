//! A client that stays connected: whole revisions in, frame reports out.

use std::collections::BTreeSet;
use std::io::{Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kiln_diagnostic::Diagnostic;

use crate::request::REQUESTS_MAX;
use crate::session::ClientSession;
use crate::wire::Message as _;
use crate::{
    Answer, Ask, ClientMessage, Decoder, FrameReport, Hello, Request, Revision, ServerMessage, Wants,
    capability, transport,
};

/// How long a client waits before it looks for a daemon again.
const RETRY: Duration = Duration::from_millis(200);

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
    /// Begins to talk to the daemon behind `socket`, now or whenever there is one; `name` is for its status lines.
    pub fn connect(socket: PathBuf, name: &str) -> Client {
        let (event_sender, events) = channel();
        let (stop, stopped) = channel();
        let writer = Arc::new(Mutex::new(Writer::default()));
        let talk = Talk { socket, name: name.to_owned(), events: event_sender, writer: writer.clone() };
        let thread = std::thread::spawn(move || talk.run(&stopped));
        Client { events, writer, stop: Some(stop), thread: Some(thread) }
    }

    /// What happened, in order.
    pub fn events(&self) -> &Receiver<ClientEvent> {
        &self.events
    }

    /// Tells the daemon which targets are shown (names, or groups as `env/sky`); they come first. Holds for later
    /// connections too.
    pub fn want(&self, targets: Vec<String>) {
        let mut writer = self.lock_writer();
        writer.wants = Wants { targets };
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
            let _ = stream.shutdown(Shutdown::Both);
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
    stream: Option<UnixStream>,
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

struct Talk {
    socket: PathBuf,
    name: String,
    events: Sender<ClientEvent>,
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
                Err(error) => (false, describe_open_error(&self.socket, &error)),
            };
            if !self.close_requests() {
                return;
            }
            if was_connected || said.as_ref() != Some(&reason) {
                said = Some(reason.clone());
                if self.events.send(ClientEvent::Disconnected { reason }).is_err() {
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
            self.events.send(ClientEvent::Answer(Answer::refused(id, lost))).is_ok()
        })
    }

    fn open(&self) -> std::io::Result<UnixStream> {
        let mut stream = UnixStream::connect(&self.socket)?;
        transport::check_peer(&stream)?;
        let hello = ClientMessage::Hello(Hello::new(&self.name, &[capability::REVISIONS]));
        stream.write_all(&hello.encode())?;
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
    fn talk(&self, mut stream: UnixStream, session: &mut ClientSession) -> String {
        session.reset();
        let mut decoder = Decoder::default();
        let mut buffer = vec![0; 256 << 10];
        loop {
            match stream.read(&mut buffer) {
                Ok(0) => return "the daemon ended the connection".to_owned(),
                Ok(count) => decoder.push(&buffer[..count]),
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(error) => return error.to_string(),
            }
            if let Err(reason) = self.take_messages(&mut decoder, session) {
                return reason;
            }
        }
    }

    fn take_messages(&self, decoder: &mut Decoder, session: &mut ClientSession) -> Result<(), String> {
        while let Some(message) =
            decoder.next_message::<ServerMessage>().map_err(|error| error.to_string())?
        {
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
                self.events.send(event).map_err(|_| "the client has ended".to_owned())?;
            }
        }
        Ok(())
    }
}

fn describe_open_error(socket: &Path, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound | std::io::ErrorKind::ConnectionRefused => {
            "no daemon serves this project; start one with `kiln watch`".to_owned()
        }
        _ => format!("cannot connect to {}: {error}", socket.display()),
    }
}
