//! The child's half: one task after the other, until its parent hangs up.

use std::io;
use std::process::exit;
use std::sync::mpsc::channel;

use kiln_shader::Compiler;

use crate::frame;
use crate::task::Task;

/// Most memory a worker may address: what hostile input asks for beyond it kills the worker alone. Stacks (64 MiB each,
/// mapped, not used) and the program itself count.
const ADDRESS_SPACE_MAX: u64 = 1 << 30;

/// Does tasks from standard input until it ends, and ends the process with it: a task that never ends must not outlive the
/// parent either.
///
/// # Errors
/// The parent does not listen.
pub fn serve() -> io::Result<()> {
    limit_this_process();
    let (sender, tasks) = channel::<Task>();
    std::thread::Builder::new().name("tasks".to_owned()).spawn(move || {
        let mut input = io::stdin().lock();
        loop {
            match frame::read(&mut input) {
                Ok(Some(task)) => {
                    if sender.send(task).is_err() {
                        return;
                    }
                }
                Ok(None) => exit(0),
                Err(_) => exit(2),
            }
        }
    })?;
    let mut replies = io::stdout().lock();
    // Tasks are often variants of one shader.
    let mut compiler = Compiler::default();
    for task in tasks {
        frame::write(&mut replies, &task.perform(&mut compiler))?;
    }
    Ok(())
}

#[cfg(target_os = "linux")]
fn limit_this_process() {
    use rustix::process::{Resource, Rlimit, setrlimit};
    let limit = |bytes: u64| Rlimit { current: Some(bytes), maximum: Some(bytes) };
    // Without these a worker still works; it only is not bounded.
    let _ = setrlimit(Resource::As, limit(ADDRESS_SPACE_MAX));
    let _ = setrlimit(Resource::Core, limit(0));
}

/// Not built here: other systems bound a worker's time only.
#[cfg(not(target_os = "linux"))]
fn limit_this_process() {
    let _ = ADDRESS_SPACE_MAX;
}
