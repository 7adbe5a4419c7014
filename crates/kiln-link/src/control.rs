//! One question to a daemon, and its answer.

use std::io::{Read as _, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::transport::Stream;
use crate::wire::Message as _;
use crate::{
    Answer, Ask, ClientMessage, DaemonStatus, Decoder, Hello, PROTOCOL_VERSION, ProjectLock, Request,
    ServerMessage, capability,
};

/// Why a daemon did not answer.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// Nobody listens there.
    #[error("no daemon serves this project")]
    NoDaemon,
    /// It did not answer, or not end, in time.
    #[error("the daemon did not {what} within {} s", limit.as_secs_f64())]
    Late {
        /// What it was asked.
        what: &'static str,
        /// How long it had.
        limit: Duration,
    },
    /// It speaks another version.
    #[error("the daemon speaks protocol {theirs}, this program {PROTOCOL_VERSION}: update the older one")]
    Version {
        /// Its version.
        theirs: u32,
    },
    /// It takes no requests.
    #[error("the daemon is older and takes no requests: end it with `kiln stop` and start it again")]
    NoRequests,
    /// It broke the protocol.
    #[error("the daemon does not speak the protocol: {0}")]
    Protocol(String),
    /// The connection broke.
    #[error("talking to the daemon: {0}")]
    Io(#[from] std::io::Error),
}

/// Asks the daemon behind `socket` how it is.
///
/// # Errors
/// There is none, or it does not answer within `limit`.
pub fn status(socket: &Path, limit: Duration) -> Result<DaemonStatus, ControlError> {
    let mut talk = Talk::open(socket, "answer", limit)?;
    talk.stream.write_all(&ClientMessage::Status.encode())?;
    loop {
        match talk.next()? {
            Some(ServerMessage::Status(status)) => return Ok(*status),
            Some(_) => {}
            None => return Err(ControlError::Protocol("it hung up without an answer".to_owned())),
        }
    }
}

/// Asks the daemon behind `socket` to change the project.
///
/// # Errors
/// There is none, it takes no requests, or it does not answer within `limit`.
pub fn ask(socket: &Path, ask: Ask, limit: Duration) -> Result<Answer, ControlError> {
    let mut talk = Talk::open(socket, "answer", limit)?;
    if !talk.takes_requests {
        return Err(ControlError::NoRequests);
    }
    talk.stream.write_all(&ClientMessage::Request(Request { id: 1, ask }).encode())?;
    loop {
        match talk.next()? {
            Some(ServerMessage::Answer(answer)) => return Ok(answer),
            Some(_) => {}
            None => return Err(ControlError::Protocol("it hung up without an answer".to_owned())),
        }
    }
}

/// Ends the daemon behind `socket` and waits until it is gone: its socket, its lock, and all that it was writing.
///
/// # Errors
/// There is none, or it does not end within `limit`.
pub fn stop(socket: &Path, limit: Duration) -> Result<(), ControlError> {
    let mut talk = Talk::open(socket, "end", limit)?;
    talk.stream.write_all(&ClientMessage::Stop.encode())?;
    while talk.next()?.is_some() {}
    if ProjectLock::wait_until_free(socket, talk.deadline) { Ok(()) } else { Err(talk.late()) }
}

struct Talk {
    stream: Stream,
    decoder: Decoder,
    what: &'static str,
    limit: Duration,
    deadline: Instant,
    takes_requests: bool,
}

impl Talk {
    fn open(socket: &Path, what: &'static str, limit: Duration) -> Result<Talk, ControlError> {
        use std::io::ErrorKind::{ConnectionRefused, NotFound};
        let stream = Stream::connect(&socket.to_owned().into()).map_err(|error| match error.kind() {
            NotFound | ConnectionRefused => ControlError::NoDaemon,
            _ => ControlError::Io(error),
        })?;
        stream.set_write_timeout(Some(limit))?;
        let (decoder, deadline) = (Decoder::default(), Instant::now() + limit);
        let mut talk = Talk { stream, decoder, what, limit, deadline, takes_requests: false };
        talk.stream.write_all(&ClientMessage::Hello(Hello::new("control", &[])).encode())?;
        match talk.next()? {
            Some(ServerMessage::Hello(hello)) if hello.protocol == PROTOCOL_VERSION => {
                talk.takes_requests = hello.can(capability::REQUESTS);
                Ok(talk)
            }
            Some(ServerMessage::Hello(hello)) => Err(ControlError::Version { theirs: hello.protocol }),
            _ => Err(ControlError::Protocol("it did not begin with a greeting".to_owned())),
        }
    }

    /// The next message; `None` when the daemon hung up.
    fn next(&mut self) -> Result<Option<ServerMessage>, ControlError> {
        let mut buffer = vec![0; 64 << 10];
        loop {
            let message =
                self.decoder.next_message().map_err(|error| ControlError::Protocol(error.to_string()))?;
            if message.is_some() {
                return Ok(message);
            }
            let left = self.deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(self.late());
            }
            self.stream.set_read_timeout(Some(left))?;
            match self.stream.read(&mut buffer) {
                Ok(0) => return Ok(None),
                Ok(count) => self.decoder.push(&buffer[..count]),
                Err(error) => match error.kind() {
                    std::io::ErrorKind::Interrupted => {}
                    std::io::ErrorKind::ConnectionReset => return Ok(None),
                    std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut => return Err(self.late()),
                    _ => return Err(ControlError::Io(error)),
                },
            }
        }
    }

    fn late(&self) -> ControlError {
        ControlError::Late { what: self.what, limit: self.limit }
    }
}
