//! Files that nobody of this project made, beside what the Khronos validator says about them; found through
//! `KILN_CORPUS`. One test after the other in one thread, since the account of memory is the process's.
//!
//! Not here: whether a picture is right (`src/tests/corpus.rs`).
#![allow(unsafe_code, reason = "an allocator cannot be written without")]
#![expect(clippy::print_stdout, reason = "what was found is for people to read")]

mod allowed;
mod counting;
mod judge;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use judge::{Fault, Outcome};
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_scene::pack;

/// Longest that one file may take; a debug build on a busy machine takes a tenth of it for the largest.
const WALL_MAX: Duration = Duration::from_secs(5);
/// When a file is given up; valid ones have large pictures, which a debug build decodes slowly.
const HANG_AFTER: Duration = Duration::from_secs(120);
/// Most memory for each byte of a file and what it refers to: JSON of `{},{},…` becomes tables of large entries.
const PEAK_PER_BYTE_MAX: usize = 64;
/// Most memory besides: tables of the image decoders, and texels, whose number a file's size does not bound.
const PEAK_BASE_MAX: usize = 16 << 20;

/// The account of memory is the process's, so only one test may run.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("KILN_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        println!("SKIPPED: KILN_CORPUS is not set, no corpus file was read");
    }
    folder
}

/// What packing a file took and said.
#[derive(Debug)]
struct Ran {
    drawn: bool,
    diagnostics: Vec<Diagnostic>,
    wall: Duration,
    peak_bytes: usize,
    read_bytes: usize,
}

/// Packs in a thread of its own, so that a hang ends the test and not the machine's patience.
fn run(corpus: &Path, file: &str, bytes: Vec<u8>) -> Ran {
    let (sender, receiver) = mpsc::channel();
    let (folder, name) = (corpus.to_owned(), file.to_owned());
    let worker = std::thread::Builder::new().name(file.to_owned());
    let worker = worker.spawn(move || {
        let mut read_bytes = bytes.len();
        let start = Instant::now();
        let (packed, peak_bytes) = counting::peak_of(|| {
            pack(&name, &bytes, &mut |path| {
                let found: Arc<[u8]> = std::fs::read(folder.join(path)).ok()?.into();
                read_bytes += found.len();
                Some(found)
            })
        });
        let wall = start.elapsed();
        let ran = Ran {
            drawn: packed.glb.is_some(),
            diagnostics: packed.diagnostics,
            wall,
            peak_bytes,
            read_bytes,
        };
        let _ = sender.send(ran);
    });
    let ran = receiver.recv_timeout(HANG_AFTER);
    let ran = ran.unwrap_or_else(|error| panic!("{file}: a hang or a panic ({error})"));
    worker.unwrap().join().unwrap();
    ran
}

/// Why a run went past a limit, if it did.
fn over_limit(ran: &Ran) -> Option<String> {
    let peak_max = PEAK_PER_BYTE_MAX * ran.read_bytes + PEAK_BASE_MAX;
    if ran.wall > WALL_MAX {
        return Some(format!("{:?} exceed {WALL_MAX:?}", ran.wall));
    }
    (ran.peak_bytes > peak_max).then(|| format!("{} bytes of memory exceed {peak_max}", ran.peak_bytes))
}

/// A line of `GLTF_STATS.tsv`, which the validator wrote.
struct Row {
    file: String,
    error_count: usize,
    first_code: String,
    /// Used or required.
    extensions: Vec<String>,
}

fn rows(corpus: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(corpus.join("GLTF_STATS.tsv")).unwrap();
    let row = |line: &str| {
        let fields: Vec<&str> = line.split('\t').collect();
        Row {
            file: fields[0].to_owned(),
            error_count: fields[1].parse().unwrap_or(1),
            first_code: fields[3].to_owned(),
            extensions: fields[4].split(',').chain(fields[5].split(',')).map(str::to_owned).collect(),
        }
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn every_file_that_the_validator_passes_is_drawn_or_requires_a_named_extension() {
    let Some(corpus) = corpus() else { return };
    let _alone = ONE_AT_A_TIME.lock();
    let (mut drawn, mut refused, mut wrong) = (0, BTreeMap::<String, usize>::new(), Vec::new());
    for row in rows(&corpus).iter().filter(|row| row.file.starts_with("gltf/") && row.error_count == 0) {
        let ran = run(&corpus, &row.file, std::fs::read(corpus.join(&row.file)).unwrap());
        let errors: Vec<&Diagnostic> = ran.diagnostics.iter().filter(|it| it.is_error()).collect();
        let unsupported = |error: &Diagnostic| {
            let mut names = row.extensions.iter().filter(|name| !name.is_empty());
            let named = names.find(|name| error.message.contains(name.as_str()));
            named.filter(|_| error.message.contains("is not supported")).cloned()
        };
        match errors.first() {
            None if ran.drawn => drawn += 1,
            Some(error) if unsupported(error).is_some() => {
                *refused.entry(unsupported(error).unwrap_or_default()).or_default() += 1;
            }
            _ => wrong.push(format!("{}: {:?}", row.file, ran.diagnostics)),
        }
        // The negative twin of all findings: there is nothing to find in a file without a fault.
        let warnings = ran.diagnostics.iter().filter(|it| it.severity == Severity::Warning);
        for warning in warnings.filter(|it| !is_about_a_format(&it.message)) {
            wrong.push(format!("{}: {}", row.file, warning.message));
        }
    }
    println!("gltf, no validator errors: {drawn} drawn, {} refused", refused.values().sum::<usize>());
    refused.iter().for_each(|(name, count)| println!("  requires {name}: {count}"));
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(drawn > 200, "{drawn}");
}

#[test]
fn every_error_of_the_validator_is_refused_noted_or_has_a_reason() {
    let Some(corpus) = corpus() else { return };
    let _alone = ONE_AT_A_TIME.lock();
    let mut tally = judge::Tally::default();
    for file in judge::reported_cases(&corpus.join("gltf-invalid/khronos-validator")) {
        let faults = judge::faults_of(&file);
        let name = file.strip_prefix(&corpus).unwrap().to_str().unwrap().to_owned();
        let bytes = std::fs::read(&file).unwrap();
        let staged = judge::staged(&bytes).map(|bytes| run(&corpus, &name, bytes));
        let ran = run(&corpus, &name, bytes);
        let staged = staged.map(|ran| ran.diagnostics).unwrap_or_default();
        for fault in &faults {
            let outcome = judge::judge(fault, &ran.diagnostics).or_else(|| judge::judge(fault, &staged));
            tally.add(&name, fault, outcome.or_else(|| allowed::reason(fault).map(Outcome::Allowed)));
        }
    }
    println!("khronos-validator: {tally}");
    assert!(tally.silent.is_empty(), "{:#?}", tally.silent);
    assert!(tally.cases() > 150, "{}", tally.cases());
}

#[test]
fn every_file_with_a_validator_error_is_refused_noted_or_has_a_reason() {
    let Some(corpus) = corpus() else { return };
    let _alone = ONE_AT_A_TIME.lock();
    let mut tally = judge::Tally::default();
    for row in rows(&corpus).iter().filter(|row| row.error_count > 0) {
        let bytes = std::fs::read(corpus.join(&row.file)).unwrap();
        let staged = judge::staged(&bytes).map(|bytes| run(&corpus, &row.file, bytes));
        let ran = run(&corpus, &row.file, bytes);
        let staged = staged.map(|ran| ran.diagnostics).unwrap_or_default();
        let fault = Fault { code: row.first_code.clone(), pointer: String::new() };
        let outcome = judge::judge(&fault, &ran.diagnostics).or_else(|| judge::judge(&fault, &staged));
        tally.add(&row.file, &fault, outcome.or_else(|| allowed::reason(&fault).map(Outcome::Allowed)));
    }
    println!("all with errors: {tally}");
    assert!(tally.silent.is_empty(), "{:#?}", tally.silent);
}

/// Valid files have pictures in formats of extensions, which are not drawn.
fn is_about_a_format(message: &str) -> bool {
    message.contains("has its image, which is not supported")
        || message.contains("it is none of PNG, JPEG and WebP")
}

fn files_below(folder: &Path, list: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() { files_below(&path, list) } else { list.push(path) }
    }
}

#[test]
fn no_hostile_file_takes_more_time_or_memory_than_its_size_allows() {
    let Some(corpus) = corpus() else { return };
    let _alone = ONE_AT_A_TIME.lock();
    let mut files = Vec::new();
    files_below(&corpus.join("gltf-invalid"), &mut files);
    let (mut slowest, mut largest, mut wrong) =
        ((Duration::ZERO, String::new()), (0, String::new()), Vec::new());
    for path in &files {
        let name = path.strip_prefix(&corpus).unwrap().to_string_lossy().into_owned();
        // Whatever it is called: reports, pictures and buffers are hostile too.
        let ran = run(&corpus, &name, std::fs::read(path).unwrap());
        over_limit(&ran).into_iter().for_each(|reason| wrong.push(format!("{name}: {reason}")));
        slowest = slowest.max((ran.wall, name.clone()));
        largest = largest.max((ran.peak_bytes, name));
    }
    println!("{} files: slowest {slowest:?}, most memory {largest:?}", files.len());
    assert!(wrong.is_empty(), "{wrong:#?}");
    let over =
        Ran { drawn: false, diagnostics: Vec::new(), wall: WALL_MAX, peak_bytes: 32 << 20, read_bytes: 9 };
    assert!(over_limit(&over).is_some(), "the check itself");
}

/// Small texts that ask for much.
#[test]
fn claims_of_much_memory_are_refused_or_cost_little() {
    let _alone = ONE_AT_A_TIME.lock();
    let asset = r#""asset":{"version":"2.0"}"#;
    let table = |name: &str, entry: &str, count: usize| {
        format!("{{{asset},\"{name}\":[{}]}}", vec![entry; count].join(","))
    };
    let matrices = format!(
        "{{{asset},\"skins\":[{{\"joints\":[0],\"inverseBindMatrices\":0}}],\"nodes\":[{{}}],\
         \"accessors\":[{{\"componentType\":5126,\"type\":\"MAT4\",\"count\":16000000}}]}}"
    );
    for text in [
        table("nodes", "{}", 1 << 21),
        table("nodes", "0,0,0,0", 1 << 21),
        table("nodes", "{}", 100_000),
        format!("{{{asset},\"scenes\":[{{\"nodes\":[{}]}}]}}", vec!["0"; 1 << 20].join(",")),
        matrices,
    ] {
        let ran = run(Path::new(""), "claims.gltf", text.clone().into_bytes());
        let peak_max = 4 * PEAK_PER_BYTE_MAX * text.len() + PEAK_BASE_MAX;
        assert!(ran.wall < WALL_MAX && ran.peak_bytes < peak_max, "{}: {ran:?}", &text[..90]);
    }
}
