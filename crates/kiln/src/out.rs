//! Standard output, of which somebody may read only the first lines.

use std::fmt::Arguments;
use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Prints a line for whoever asked.
macro_rules! say {
    () => { $crate::out::line(format_args!("")) };
    ($($text:tt)*) => { $crate::out::line(format_args!($($text)*)) };
}

pub(crate) use say;

/// When nobody reads any more (`kiln bake --json | head -1`) the rest is said to nobody, and the work goes on: its exit code
/// still counts. Any other failure ends the program.
pub(crate) fn line(text: Arguments) {
    static IS_CLOSED: AtomicBool = AtomicBool::new(false);
    if IS_CLOSED.load(Relaxed) {
        return;
    }
    match writeln!(std::io::stdout().lock(), "{text}") {
        Ok(()) => {}
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => IS_CLOSED.store(true, Relaxed),
        Err(error) => {
            eprintln!("kiln: cannot write to standard output: {error}");
            std::process::exit(crate::TOOL_FAILED.into());
        }
    }
}
