//! The parent's half: a pool of children, each with one task at a time.

use std::io::{self, BufReader, BufWriter};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use kiln_diagnostic::Diagnostic;

use crate::{Reply, Task, frame};

/// What a task may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// CPU time of the child, where the system tells it.
    pub cpu: Duration,
    /// Time on the clock: for a child that waits for ever, and for systems that do not tell CPU time. On a busy machine a
    /// child may get little of a CPU.
    pub wall: Duration,
}

impl Limits {
    /// A shader of the largest size allowed takes a tenth of this.
    pub const USUAL: Limits = Limits { cpu: Duration::from_secs(2), wall: Duration::from_secs(60) };
}

/// Why a child could not do a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Died {
    /// It took more CPU time than this and was ended.
    TooSlow(Duration),
    /// It did not answer for this long on the clock, and was ended: a fault of the compiler, or a machine too busy.
    Stuck(Duration),
    /// Somebody killed it: a person, or a system short of memory.
    Killed,
    /// It ended by itself: out of stack or of memory, or by a fault of the compiler.
    Crashed(String),
    /// No child could be started, or it does not speak this protocol.
    NoWorker(String),
}

impl Died {
    /// Whether the same input will have it die again.
    pub fn is_of_input(&self) -> bool {
        matches!(self, Died::TooSlow(_) | Died::Crashed(_))
    }

    /// As a message about the shader `file`; empty if the caller adds it.
    pub fn diagnostic(&self, file: &str) -> Diagnostic {
        let (message, help) = match self {
            Died::TooSlow(limit) => (
                format!("the shader compiler was ended after {} s of work on this", limit.as_secs_f64()),
                "undo the last edit, or split the shader: something in it takes the compiler for ever",
            ),
            Died::Stuck(limit) => (
                format!("the shader compiler did not answer within {} s", limit.as_secs_f64()),
                "try again when the machine is less busy",
            ),
            Died::Killed => (
                "the shader compiler was killed by somebody else".to_owned(),
                "try again; see whether the system is short of memory",
            ),
            Died::Crashed(how) => (
                format!("the shader compiler {how} on this"),
                "undo the last edit; this is a fault of the compiler, not only of the shader",
            ),
            Died::NoWorker(why) => (
                format!("no shader compiler could be started: {why}"),
                "see whether the program may start processes, and whether memory is left",
            ),
        };
        let diagnostic = Diagnostic::error(message).with_help(help);
        if file.is_empty() { diagnostic } else { diagnostic.in_file(file) }
    }
}

/// Child processes that compile.
#[derive(Debug)]
pub struct Workers {
    program: PathBuf,
    arguments: Vec<String>,
    limits: Limits,
    /// Those without a task; there are never more than there were tasks at once.
    idle: Mutex<Vec<Worker>>,
}

#[derive(Debug)]
struct Worker {
    child: Child,
    tasks: BufWriter<ChildStdin>,
    replies: Receiver<io::Result<Option<Reply>>>,
}

impl Workers {
    /// Children that are started as `program` with `arguments` and run [`crate::serve`].
    pub fn new(program: PathBuf, arguments: &[&str], limits: Limits) -> Workers {
        let arguments = arguments.iter().map(|&argument| argument.to_owned()).collect();
        Workers { program, arguments, limits, idle: Mutex::default() }
    }

    /// Starts a child, unless one is idle.
    pub fn warm_up(&self) {
        if self.idle().is_empty()
            && let Ok(worker) = self.start()
        {
            self.idle().push(worker);
        }
    }

    /// Process numbers of idle children.
    pub fn idle_ids(&self) -> Vec<u32> {
        self.idle().iter().map(|worker| worker.child.id()).collect()
    }

    /// Has a task done.
    ///
    /// # Errors
    /// The child died of it; the next task gets another.
    pub fn run(&self, task: &Task) -> Result<Reply, Died> {
        // The statement ends before the task begins, and with it the lock.
        let idle = self.idle().pop();
        if let Some(worker) = idle {
            match self.run_on(worker, task) {
                // It may have died before, of something else: killed by a person, or by a system short of memory. So may
                // the others.
                Err(Died::Crashed(_) | Died::Killed) => {
                    self.idle().retain_mut(|worker| matches!(worker.child.try_wait(), Ok(None)));
                }
                result => return result,
            }
        }
        let start = || self.start().map_err(|error| Died::NoWorker(error.to_string()));
        match self.run_on(start()?, task) {
            Err(Died::Killed) => self.run_on(start()?, task),
            result => result,
        }
    }

    fn run_on(&self, mut worker: Worker, task: &Task) -> Result<Reply, Died> {
        if frame::write(&mut worker.tasks, task).is_err() {
            return Err(worker.died());
        }
        let reply = worker.reply(self.limits)?;
        self.idle().push(worker);
        Ok(reply)
    }

    fn start(&self) -> io::Result<Worker> {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn()?;
        let missing = || io::Error::other("a child without pipes");
        let tasks = BufWriter::new(child.stdin.take().ok_or_else(missing)?);
        let mut output = BufReader::new(child.stdout.take().ok_or_else(missing)?);
        let (sender, replies) = channel();
        std::thread::Builder::new().name("kiln-worker".to_owned()).spawn(move || {
            loop {
                let reply = frame::read(&mut output);
                let is_last = !matches!(reply, Ok(Some(_)));
                if sender.send(reply).is_err() || is_last {
                    return;
                }
            }
        })?;
        Ok(Worker { child, tasks, replies })
    }

    fn idle(&self) -> MutexGuard<'_, Vec<Worker>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How often a running task's CPU time is looked at.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

impl Worker {
    fn reply(&mut self, limits: Limits) -> Result<Reply, Died> {
        let start = Instant::now();
        let mut cpu_start = None;
        loop {
            match self.replies.recv_timeout(LOOK_INTERVAL) {
                Ok(Ok(Some(reply))) => return Ok(reply),
                Ok(Ok(None)) | Err(RecvTimeoutError::Disconnected) => return Err(self.died()),
                Ok(Err(error)) => return Err(Died::NoWorker(error.to_string())),
                Err(RecvTimeoutError::Timeout) => {}
            }
            // A child has done other tasks before; what it did of this one in the first interval is not counted.
            let cpu = cpu_time(self.child.id()).unwrap_or_default();
            let spent = cpu.saturating_sub(*cpu_start.get_or_insert(cpu));
            if spent > limits.cpu {
                return Err(Died::TooSlow(limits.cpu));
            }
            if start.elapsed() > limits.wall {
                return Err(Died::Stuck(limits.wall));
            }
        }
    }

    /// How the child ended.
    fn died(&mut self) -> Died {
        // It closed its output: it has ended or is about to, but not by us.
        match self.child.wait() {
            Ok(status) => describe(status),
            Err(_) => Died::Crashed("ended".to_owned()),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // One that waits for its next task holds nothing, and one that is too slow must not go on.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(unix)]
fn describe(status: ExitStatus) -> Died {
    use std::os::unix::process::ExitStatusExt as _;
    match status.signal() {
        Some(6) => Died::Crashed("ran out of memory or stack and gave up".to_owned()),
        Some(9) => Died::Killed,
        Some(11) => Died::Crashed("ran out of stack".to_owned()),
        Some(signal) => Died::Crashed(format!("died of signal {signal}")),
        None => describe_exit(status),
    }
}

#[cfg(not(unix))]
fn describe(status: ExitStatus) -> Died {
    describe_exit(status)
}

fn describe_exit(status: ExitStatus) -> Died {
    Died::Crashed(format!("ended early ({status})"))
}

/// CPU time that a process has used, from /proc (`man 5 proc`: fields 14 and 15 of stat, in hundredths of a second).
#[cfg(target_os = "linux")]
fn cpu_time(process: u32) -> Option<Duration> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name in parentheses may hold spaces.
    let mut fields = text.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<u64>().ok();
    Some(Duration::from_millis(10 * (ticks()? + ticks()?)))
}

#[cfg(not(target_os = "linux"))]
fn cpu_time(_: u32) -> Option<Duration> {
    None
}
