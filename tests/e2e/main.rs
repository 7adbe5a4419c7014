//! End-to-end tests: the built `kiln`, real processes, the real socket, real files.
//!
//! Nothing sleeps: every wait is for an event, with a limit.

mod bad_input;
mod bake;
mod demo;
mod golden;
mod harness;
mod live;
mod window;
