//! The wire between daemon and clients: what is said, how it is framed, and both halves of the talk.
//!
//! Start at [`Client`]: give it a project's socket and it delivers complete [`Revision`]s, reconnecting as
//! daemons come and go. [`status`], [`ask`] and [`stop`] ask one thing and hang up. The daemon's half is [`Server`]. The bytes are
//! described in `docs/protocol.md`.
//!
//! Conventions: a revision is whole or absent; contents are named by SHA-256 and fetched once; every
//! length read from a peer has a limit.
//!
//! Not here: what targets mean, when to build (`kiln-daemon`), pixels (`kiln-preview`).

pub use client::{Client, ClientEvent, FrameReporter};
pub use control::{ControlError, ask, status, stop};
pub use kiln_build::{Digest, Part, Target, TargetState, Targets};
pub use message::{
    ClientMessage, FrameReport, Hello, PROTOCOL_VERSION, ProgressReport, Quality, ServerMessage, Wants,
    capability,
};
pub use place::{LockError, ProjectLock, socket_path};
pub use request::{Answer, Ask, ERROR_MAX, ERROR_MIN, ParameterWrite, Request};
pub use revision::{ActionTime, Revision, RevisionTable, Work};
pub use server::{BlobSource, Server, ServerEvent};
pub use status::{BuildStatus, ClientStatus, DaemonStatus};
pub use token::Token;
pub use transport::Endpoint;
pub use wire::{Decoder, Message, WireError};

mod client;
mod control;
mod message;
mod outbox;
mod place;
mod queue;
mod request;
mod revision;
mod server;
mod session;
mod status;
#[cfg(test)]
mod tests;
mod token;
mod transport;
mod wire;
