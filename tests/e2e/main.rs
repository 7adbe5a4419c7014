//! End-to-end tests: the built `kiln`, real processes, the real socket, real files.
//!
//! Nothing sleeps: every wait is for an event, with a limit.

#![expect(clippy::print_stderr, reason = "skipped tests say so")]

mod accuracy;
mod bad_input;
mod bake;
#[cfg(feature = "preview")]
mod check;
mod ci;
mod control;
mod corpus;
mod demand;
mod demo;
mod environments;
mod faults;
#[cfg(feature = "preview")]
mod golden;
#[cfg(feature = "preview")]
mod golden_effects;
mod harness;
#[cfg(feature = "preview")]
mod inspect;
mod life;
mod live;
#[cfg(feature = "preview")]
mod parameters;
#[cfg(feature = "preview")]
mod render;
mod requests;
mod shader_commands;
mod shaders;
mod soak;
mod storms;
mod tidy;
#[cfg(feature = "preview")]
mod window;
mod wire_options;
