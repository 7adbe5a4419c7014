//! Streams between a daemon and its clients: Unix sockets with the peer's identity checked, and TCP on this machine alone, where a token
//! stands for the identity. (Windows needs a named pipe here: not written yet, and nothing of this was built there.)

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use crate::Token;

/// Where a daemon is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// The socket of its project ([`crate::socket_path`]).
    Socket(PathBuf),
    /// A port of this machine, or one that is forwarded to it.
    Tcp {
        /// Address and port.
        address: SocketAddr,
        /// What the daemon wrote for those who may connect.
        token: Token,
    },
}

impl From<PathBuf> for Endpoint {
    fn from(socket: PathBuf) -> Endpoint {
        Endpoint::Socket(socket)
    }
}

/// One connection.
#[derive(Debug)]
pub(crate) enum Stream {
    Unix(UnixStream),
    Tcp(TcpStream),
}

impl Stream {
    /// Connects; a socket must belong to this user.
    pub(crate) fn connect(endpoint: &Endpoint) -> io::Result<Stream> {
        match endpoint {
            Endpoint::Socket(socket) => {
                let stream = UnixStream::connect(socket)?;
                check_peer(&stream)?;
                Ok(Stream::Unix(stream))
            }
            Endpoint::Tcp { address, .. } => {
                let stream = TcpStream::connect(address)?;
                // Small messages go at once: nobody waits for more to fill a packet.
                stream.set_nodelay(true)?;
                Ok(Stream::Tcp(stream))
            }
        }
    }

    pub(crate) fn try_clone(&self) -> io::Result<Stream> {
        match self {
            Stream::Unix(stream) => stream.try_clone().map(Stream::Unix),
            Stream::Tcp(stream) => stream.try_clone().map(Stream::Tcp),
        }
    }

    pub(crate) fn shutdown(&self) -> io::Result<()> {
        match self {
            Stream::Unix(stream) => stream.shutdown(Shutdown::Both),
            Stream::Tcp(stream) => stream.shutdown(Shutdown::Both),
        }
    }

    pub(crate) fn set_read_timeout(&self, limit: Option<Duration>) -> io::Result<()> {
        match self {
            Stream::Unix(stream) => stream.set_read_timeout(limit),
            Stream::Tcp(stream) => stream.set_read_timeout(limit),
        }
    }

    pub(crate) fn set_write_timeout(&self, limit: Option<Duration>) -> io::Result<()> {
        match self {
            Stream::Unix(stream) => stream.set_write_timeout(limit),
            Stream::Tcp(stream) => stream.set_write_timeout(limit),
        }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Stream::Unix(stream) => stream.read(buffer),
            Stream::Tcp(stream) => stream.read(buffer),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Stream::Unix(stream) => stream.write(bytes),
            Stream::Tcp(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Refuses a peer that is not this user.
pub(crate) fn check_peer(stream: &UnixStream) -> io::Result<()> {
    let own = rustix::process::geteuid();
    match peer_uid(stream)? {
        Some(peer) if peer != own => {
            let reason = format!("the peer is user {}, not {}", peer.as_raw(), own.as_raw());
            Err(io::Error::new(io::ErrorKind::PermissionDenied, reason))
        }
        _ => Ok(()),
    }
}

#[cfg(target_os = "linux")]
fn peer_uid(stream: &UnixStream) -> io::Result<Option<rustix::process::Uid>> {
    Ok(Some(rustix::net::sockopt::socket_peercred(stream)?.uid))
}

/// Elsewhere the folder's mode 0700 alone keeps others out.
#[cfg(not(target_os = "linux"))]
fn peer_uid(_: &UnixStream) -> io::Result<Option<rustix::process::Uid>> {
    Ok(None)
}
