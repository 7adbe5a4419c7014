//! A cache that people trust: content-addressed artefacts and the pure actions that make them.
//!
//! Start at [`Engine`]: [`Engine::scan`] finds out what a source depends on, [`Engine::run`] brings a
//! [`Graph`] of actions up to date and says for each what happened and why. [`Store`] holds the bytes.
//!
//! Conventions: an action is a pure function of its recipe, parameters and inputs, and its key covers
//! every byte of them; contents are named by their SHA-256; source paths are project-relative with `/`.
//! A failure of the *input* is a result like any other (diagnostics, no outputs, cached); a failure of the
//! *tool* is an [`Error`].
//!
//! Not here: light, shaders and scenes (`kiln-project` declares the actions), watching (`kiln-daemon`).

pub use action::{Action, ActionId, ActionOutput, Graph, Input, Inputs};
pub use digest::Digest;
pub use engine::{Engine, Scan, Tracker};
pub use explain::explain;
pub use project_state::ProjectState;
pub use record::{ActionRecord, InputRecord, OutputRecord};
pub use run::{Outcome, Progress, RunOptions, RunReport, Status};
pub use sources::{SourceState, SourceTree};
pub use store::{Error, Store, write_atomically};
pub use target::{Part, Target, TargetState, Targets};

mod action;
mod digest;
mod engine;
mod explain;
mod project_state;
mod record;
mod run;
mod sources;
mod store;
mod target;
#[cfg(test)]
mod tests;
