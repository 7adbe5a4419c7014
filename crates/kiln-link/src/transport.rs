//! Unix sockets with the peer's identity checked. (Windows needs a named pipe here: not written yet.)

use std::io;
use std::os::unix::net::UnixStream;

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
