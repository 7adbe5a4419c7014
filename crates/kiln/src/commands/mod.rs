//! One module a command.

pub(crate) mod accuracy;
pub(crate) mod add;
pub(crate) mod bake;
pub(crate) mod check;
pub(crate) mod cube_picture;
pub(crate) mod demand;
pub(crate) mod demo;
pub(crate) mod diff;
pub(crate) mod doctor;
pub(crate) mod env;
pub(crate) mod export;
pub(crate) mod gc;
pub(crate) mod graph;
pub(crate) mod init;
pub(crate) mod plan;
#[cfg(feature = "preview")]
pub(crate) mod preview;
#[cfg(feature = "preview")]
pub(crate) mod render;
pub(crate) mod set;
pub(crate) mod shader;
pub(crate) mod status;
pub(crate) mod stop;
pub(crate) mod verify;
pub(crate) mod watch;
pub(crate) mod why;
