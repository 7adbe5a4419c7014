//! One module a command.

pub(crate) mod bake;
pub(crate) mod demo;
pub(crate) mod init;
#[cfg(feature = "preview")]
pub(crate) mod preview;
pub(crate) mod watch;
