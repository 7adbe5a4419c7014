//! The shader library and the bake passes on the device, beside functions in `f64`, native twins and exact maps.
//!
//! `cargo test --release -p kiln-gpu --test library -- --nocapture` prints every error with its tolerance.

mod bakes;
mod colour;
mod complete;
mod cubes;
mod estimators;
mod fragment;
mod functions;
mod glsl;
mod lobes;
mod passes;
mod pictures;
mod punctual;
mod reference;
mod samples;
mod semantics;
mod support;
mod tutorials;
mod twins;
