//! Watches a project, rebuilds what a change affects and publishes revisions.
//!
//! Start at [`Daemon::start`]; [`Daemon::run`] is the one loop over the one closed event type. Around it stand a
//! watcher (file events in, settled batches out), a builder thread (batches in, builds out), a thread that changes sources
//! for clients that ask, and [`kiln_link::Server`] (revisions out, frame reports in).
//!
//! Conventions: an edit counts by content, so a build that changes nothing publishes nothing; a newer edit
//! cancels the build of an older one; the last good content of every target stays published.
//!
//! Not here: what is built (`kiln-project`), how it travels (`kiln-link`), what is printed (`kiln`).

pub use builder::{to_revision, to_work};
pub use daemon::{Daemon, DaemonError, DaemonOptions, Notice, StopHandle};

mod accuracy;
mod builder;
mod daemon;
mod requests;
#[cfg(test)]
mod tests;
mod watch;
