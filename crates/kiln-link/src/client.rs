//! A client that stays connected: whole revisions in, frame reports out.

use std::io::{Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::session::ClientSession;
use crate::wire::Message as _;
use crate::{
    ClientMessage, Decoder, FrameReport, Hello, Revision, ServerMessage, Wants, capability, transport,
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

    fn lock_writer(&self) -> MutexGuard<'_, Writer> {
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        drop(self.stop.take());
        let mut writer = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
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
    fn run(self, stopped: &Receiver<()>) {
        let mut session = ClientSession::default();
        let mut said: Option<String> = None;
        loop {
            let (was_connected, reason) = match self.open() {
                Ok(stream) => (true, self.talk(stream, &mut session)),
                Err(error) => (false, describe_open_error(&self.socket, &error)),
            };
            self.writer.lock().unwrap_or_else(PoisonError::into_inner).stream = None;
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

    fn open(&self) -> std::io::Result<UnixStream> {
        let mut stream = UnixStream::connect(&self.socket)?;
        transport::check_peer(&stream)?;
        let hello = ClientMessage::Hello(Hello::new(&self.name, &[capability::REVISIONS]));
        stream.write_all(&hello.encode())?;
        let mut writer = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
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
            let mut writer = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(number) = reaction.pong {
                writer.take_pong(number);
            }
            for message in reaction.send {
                let stream = writer.stream.as_mut().ok_or("the connection is closing")?;
                stream.write_all(&message.encode()).map_err(|error| error.to_string())?;
            }
            drop(writer);
            for event in reaction.events {
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
