//! Standard output, of which somebody may read only the first lines.

use std::fmt::Arguments;
use std::io::Write as _;

/// Prints a line for whoever asked.
macro_rules! say {
    () => { $crate::out::line(format_args!("")) };
    ($($text:tt)*) => { $crate::out::line(format_args!($($text)*)) };
}

pub(crate) use say;

/// When nobody reads any more (`kiln bake --json | head -1`) there is nobody left to work for.
pub(crate) fn line(text: Arguments) {
    if writeln!(std::io::stdout().lock(), "{text}").is_err() {
        std::process::exit(0);
    }
}
