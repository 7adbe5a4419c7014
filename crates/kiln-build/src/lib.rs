//! A cache that people trust: content-addressed artefacts and the pure actions that make them.
//!
//! Start at [`Engine`]: [`Engine::scan`] finds out what a source depends on, [`Engine::run`] brings a [`Graph`] of
//! actions up to date and says for each what happened and why, [`Engine::forecast`] says what it would do.
//! [`Store`] holds the bytes, for any number of projects and processes.
//!
//! Conventions: an action is a pure function of its recipe, parameters and inputs, and its key covers
//! every byte of them; contents are named by their SHA-256; source paths are project-relative with `/`.
//! A failure of the *input* is a result like any other (diagnostics, no outputs, cached); a failure of the
//! *tool* is an [`Error`].
//!
//! Not here: light, shaders and scenes (`kiln-project` declares the actions), watching (`kiln-daemon`).

pub use action::{Action, ActionId, ActionOutput, Graph, Input, Inputs, MemoryNeed, Perform, little_memory};
pub use collect::{CollectOptions, Collected, ProjectUsage, Usage};
pub use digest::{Digest, DigestBuilder};
pub use engine::{Engine, Scan, Tracker};
pub use explain::{Change, Reason};
pub use fs::{Disk, FileFacts, FileSystem, write_atomically};
pub use memory::{BuildNote, ChangeNote, FilesOfTarget};
pub use record::{ActionRecord, ActionResult, Command, InputRecord, OutputRecord};
pub use run::{Outcome, Progress, RunOptions, RunReport, Status};
pub use sources::{SOURCE_BYTES_MAX, SourceState, SourceTree};
pub use store::{Error, Hold, Store};
pub use survey::Forecast;
pub use target::{Part, Target, TargetState, Targets};

mod action;
mod collect;
mod digest;
mod document;
mod engine;
mod explain;
mod fs;
mod memory;
mod record;
mod run;
mod sources;
mod store;
mod survey;
mod target;
#[cfg(test)]
mod tests;
