//! Gives inputs to a real worker and looks at what it answers, how long that takes and how much memory.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use kiln_diagnostic::has_errors;
use kiln_shader::{Compiled, Language, Outcome};
use kiln_worker::{Died, Limits, Reply, Task, Workers};

use crate::corpus::Input;

/// CPU time of one task: the worker's limit, with what its parent does not see — the first interval between its looks — and
/// what passes until it looks again.
pub const CPU_MAX: Duration = Duration::from_millis(2_300);
/// Memory of a worker, as the system counts it at its peak.
pub const MEMORY_KIB_MAX: u64 = 1 << 20;

/// Rounds after which canonical text must compile to itself.
const ROUNDS_MAX: usize = 8;

/// What an input must not do.
pub struct Checker {
    workers: Workers,
    cpu_max: Duration,
    memory_kib_max: u64,
    /// CPU time of all children so far.
    cpu_spent: Duration,
    pub report: Report,
}

/// What came of the inputs so far.
#[derive(Default)]
pub struct Report {
    pub inputs: usize,
    pub compiled: usize,
    pub refused: usize,
    /// Programs made to be valid that compile.
    pub valid_compiled: usize,
    /// Programs whose canonical text becomes a fixed point after some rounds only.
    pub settled_late: usize,
    /// Programs whose canonical text nests deeper than sources may.
    pub too_deep: usize,
    /// By how the worker ended, the seeds.
    pub deaths: BTreeMap<String, Vec<u64>>,
    /// Texts in a language, and refusals by it.
    pub emitted: usize,
    pub emit_refused: usize,
    pub slowest: (Duration, u64),
    pub largest_kib: (u64, u64),
    /// What must not be.
    pub findings: Vec<String>,
}

impl Checker {
    pub fn new(workers: Workers, cpu_max: Duration, memory_kib_max: u64) -> Checker {
        let cpu_spent = cpu_of_children(&workers);
        Checker { workers, cpu_max, memory_kib_max, cpu_spent, report: Report::default() }
    }

    /// The worker program of this package, with the usual limits.
    pub fn usual() -> Checker {
        let workers = Workers::new(env!("CARGO_BIN_EXE_kiln-worker").into(), &[], Limits::USUAL);
        Checker::new(workers, CPU_MAX, MEMORY_KIB_MAX)
    }

    /// Compiles an input and all that follows from it.
    pub fn check(&mut self, seed: u64, input: &Input) {
        self.report.inputs += 1;
        let before = self.report.findings.len();
        if let Some(Reply::Compiled(outcome)) = self.run(seed, &input.task(seed.is_multiple_of(4))) {
            self.check_outcome(seed, input, &outcome);
        } else if input.is_valid {
            self.find(seed, "a valid program kills the worker".to_owned());
        }
        if self.report.findings.len() > before {
            self.save(seed, input);
        }
    }

    fn find(&mut self, seed: u64, what: String) {
        self.report.findings.push(format!("seed {seed}: {what}"));
    }

    fn check_outcome(&mut self, seed: u64, input: &Input, outcome: &Outcome) {
        let messages: String = outcome.diagnostics.iter().map(|diagnostic| diagnostic.to_string()).collect();
        if outcome.compiled.is_some() == has_errors(&outcome.diagnostics) {
            self.find(seed, format!("a shader with errors, or none without: {messages}"));
        }
        if let Some(at) = messages.find("compiler failed") {
            self.find(seed, messages[at..].lines().next().unwrap_or_default().to_owned());
        }
        match &outcome.compiled {
            Some(compiled) => {
                self.report.compiled += 1;
                self.report.valid_compiled += usize::from(input.is_valid);
                self.check_compiled(seed, compiled, input.is_valid);
            }
            None => {
                self.report.refused += 1;
                if input.is_valid {
                    self.find(seed, format!("a valid program is refused: {messages}"));
                }
            }
        }
    }

    /// Canonical text compiles to itself, and to each language or to a reason.
    fn check_compiled(&mut self, seed: u64, compiled: &Compiled, is_valid: bool) {
        let mut text = compiled.wgsl.clone();
        // `let` with a constant is worked out a step further each time; programs made to be valid have none.
        let rounds = if is_valid { 1 } else { ROUNDS_MAX };
        for round in 1..=rounds {
            let again = Input::of("canonical.wgsl", text.clone());
            match self.run(seed, &again.task(false)) {
                Some(Reply::Compiled(Outcome { compiled: Some(again), .. })) if again.wgsl == text => {
                    self.report.settled_late += usize::from(round > 1);
                    break;
                }
                Some(Reply::Compiled(Outcome { compiled: Some(again), .. })) => {
                    if round == rounds {
                        let difference = first_difference(&text, &again.wgsl);
                        self.find(seed, format!("canonical text changes: {difference}"));
                    }
                    text = again.wgsl;
                }
                // The limits are on what people write; naga's writer puts parentheses around every operation.
                Some(Reply::Compiled(outcome)) if is_too_deep(&outcome) => {
                    self.report.too_deep += 1;
                    break;
                }
                Some(Reply::Compiled(outcome)) => {
                    self.find(seed, format!("canonical text is refused: {:?}", outcome.diagnostics));
                    break;
                }
                _ => {
                    self.find(seed, "canonical text kills the worker".to_owned());
                    break;
                }
            }
        }
        for language in Language::ALL {
            let task = Task::Emit { wgsl: compiled.wgsl.clone(), language };
            match self.run(seed, &task) {
                Some(Reply::Emitted(Ok(_))) => self.report.emitted += 1,
                Some(Reply::Emitted(Err(diagnostic))) => {
                    self.report.emit_refused += 1;
                    let message = diagnostic.to_string();
                    if ["compiler failed", "not valid WGSL"].iter().any(|fault| message.contains(fault)) {
                        self.find(seed, format!("{language}: {message}"));
                    }
                }
                _ => self.find(seed, format!("{language}: the worker dies")),
            }
        }
    }

    /// Does a task; a death is counted, and must not keep the next from being done.
    fn run(&mut self, seed: u64, task: &Task) -> Option<Reply> {
        let start = Instant::now();
        let reply = self.workers.run(task);
        let cpu = cpu_of_children(&self.workers);
        // A look at a worker counts hundredths of a second; a parent's account of an ended one may be a little later.
        let spent = cpu.saturating_sub(self.cpu_spent);
        self.cpu_spent = cpu.max(self.cpu_spent);
        self.report.slowest = self.report.slowest.max((spent, seed));
        if spent > self.cpu_max {
            self.find(seed, format!("takes {spent:?} of CPU, {:?} on the clock", start.elapsed()));
        }
        for id in self.workers.idle_ids() {
            // What a process may address bounds what it uses, for those too that are gone before they can be looked at.
            let limit = field(id, "limits", "Max address space").unwrap_or(u64::MAX) / 1024;
            let peak = field(id, "status", "VmHWM:").unwrap_or(u64::MAX);
            self.report.largest_kib = self.report.largest_kib.max((peak, seed));
            if peak > self.memory_kib_max || limit > self.memory_kib_max {
                self.find(seed, format!("a worker has used {peak} KiB, and may use {limit} KiB"));
            }
        }
        match reply {
            Ok(reply) => Some(reply),
            Err(died) => {
                self.report.deaths.entry(kind(&died)).or_default().push(seed);
                self.check_next(seed);
                None
            }
        }
    }

    fn check_next(&mut self, seed: u64) {
        let sound = "@fragment fn fs_main() -> @location(0) vec4f { return vec4f(1.0); }";
        let input = Input::of("sound.wgsl", sound.to_owned());
        let reply = self.workers.run(&input.task(false));
        if !matches!(&reply, Ok(Reply::Compiled(outcome)) if outcome.compiled.is_some()) {
            self.find(seed, format!("after a death the next task is not done: {reply:?}"));
        }
        self.cpu_spent = cpu_of_children(&self.workers).max(self.cpu_spent);
    }

    /// Writes an input's files below `target/fuzz`.
    fn save(&self, seed: u64, input: &Input) {
        let folder = folder().join(seed.to_string());
        for (path, text) in input.files.iter().filter(|(path, _)| !path.contains("..")) {
            let path = folder.join(path);
            // For a person who looks into a finding, which itself is reported all the same.
            let _ = std::fs::create_dir_all(path.parent().unwrap_or(&folder));
            let _ = std::fs::write(path, text);
        }
    }
}

impl Report {
    /// As lines for people.
    pub fn summary(&self, what: &str) -> String {
        let Report { inputs, compiled, refused, .. } = self;
        let deaths: usize = self.deaths.values().map(Vec::len).sum();
        let mut text =
            format!("{what}: {inputs} inputs, {compiled} compiled, {refused} refused, {deaths} deaths\n");
        for (kind, seeds) in &self.deaths {
            _ = writeln!(text, "  {kind}: {} (seeds {:?})", seeds.len(), &seeds[..seeds.len().min(8)]);
        }
        let (late, deep) = (self.settled_late, self.too_deep);
        let at_once = compiled - late - deep;
        _ = writeln!(
            text,
            "  canonical text is a fixed point at once: {at_once}, later: {late}, too deep for a source: {deep}"
        );
        _ = writeln!(
            text,
            "  files in other languages: {}, refused with a reason: {}",
            self.emitted, self.emit_refused
        );
        let ((cpu, slow), (kib, large)) = (self.slowest, self.largest_kib);
        _ = writeln!(
            text,
            "  slowest task {:.2} s of CPU (seed {slow}), largest worker {} MiB (seed {large})",
            cpu.as_secs_f64(),
            kib / 1024
        );
        let (shown, all) = (self.findings.len().min(20), self.findings.len());
        _ = writeln!(text, "  findings: {all}");
        self.findings[..shown].iter().for_each(|finding| _ = writeln!(text, "    {finding}"));
        text
    }
}

/// Where inputs with findings are kept.
pub fn folder() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"));
    target.parent().unwrap_or(target).join("fuzz")
}

fn is_too_deep(outcome: &Outcome) -> bool {
    let is_limit = |message: &str| {
        ["nested deeper", "operators in one piece", "too long to be written out"]
            .iter()
            .any(|limit| message.contains(limit))
    };
    outcome.diagnostics.iter().any(|diagnostic| is_limit(&diagnostic.message))
}

fn kind(died: &Died) -> String {
    match died {
        Died::TooSlow(limit) => format!("ended after {limit:?}"),
        Died::Stuck(limit) => format!("no answer for {limit:?}"),
        Died::Killed => "killed".to_owned(),
        Died::Crashed(how) => how.clone(),
        Died::NoWorker(why) => format!("no worker: {why}"),
    }
}

fn first_difference(one: &str, other: &str) -> String {
    let lines = one.lines().zip(other.lines()).find(|(one, other)| one != other);
    lines.map_or("one is longer".to_owned(), |(one, other)| format!("{one:?} becomes {other:?}"))
}

/// CPU time of the children that have ended and of those that are idle.
fn cpu_of_children(workers: &Workers) -> Duration {
    // Fields of `stat` behind the name (proc(5), from 3): utime and stime are 14 and 15, of ended children 16 and 17.
    let ticks = |process: &str, first: usize| -> u64 {
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_ascii_whitespace();
        fields.skip(first - 3).take(2).filter_map(|field| field.parse::<u64>().ok()).sum()
    };
    let idle: u64 = workers.idle_ids().iter().map(|id| ticks(&id.to_string(), 14)).sum();
    // Ticks have been hundredths of a second on every Linux.
    Duration::from_millis(10 * (ticks("self", 16) + idle))
}

/// The first number in a line of a process's file.
fn field(process: u32, file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/{file}")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_ascii_whitespace().find_map(|word| word.parse().ok())
}
