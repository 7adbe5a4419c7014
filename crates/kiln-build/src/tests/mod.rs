use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kiln_diagnostic::Diagnostic;
use serde_json::{Value, json};

use crate::*;

mod collection;
mod faults;
mod scheduling;
mod sources;

/// What may be denied to a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operation {
    Write,
    Remove,
    Touch,
}

/// A disk on which some files may not be written, removed or touched.
#[derive(Debug)]
struct Denying(fn(Operation, &Path) -> bool);

impl Denying {
    fn ask(&self, operation: Operation, path: &Path) -> io::Result<()> {
        if (self.0)(operation, path) { Err(io::ErrorKind::PermissionDenied.into()) } else { Ok(()) }
    }
}

impl FileSystem for Denying {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        Disk.read(path)
    }

    fn facts(&self, path: &Path) -> io::Result<FileFacts> {
        Disk.facts(path)
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        Disk.list(folder)
    }

    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        Disk.create_folder(folder)
    }

    fn write_new(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        self.ask(Operation::Write, path)?;
        Disk.write_new(path, bytes)
    }

    fn sync(&self, path: &Path) -> io::Result<()> {
        Disk.sync(path)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        Disk.sync_folder(folder)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.ask(Operation::Remove, path)?;
        Disk.remove(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.ask(Operation::Touch, path)?;
        Disk.touch(path)
    }
}

/// A project folder and a cache that go away.
struct Place {
    folder: tempfile::TempDir,
    cache: tempfile::TempDir,
}

impl Place {
    fn new() -> Place {
        Place { folder: tempfile::tempdir().unwrap(), cache: tempfile::tempdir().unwrap() }
    }

    fn write(&self, path: &str, text: &str) {
        fs::write(self.folder.path().join(path), text).unwrap();
    }

    fn store(&self) -> Store {
        Store::open(self.cache.path()).unwrap()
    }

    fn engine(&self) -> Engine {
        Engine::open(self.folder.path(), self.store()).unwrap()
    }

    /// Runs `upper(a.txt)` and then `count(upper)`, and says which actions ran and why.
    fn run(&self, jobs: usize) -> (RunReport, Vec<String>) {
        let engine = self.engine();
        let report = run(&engine, &two_steps(&engine), jobs);
        engine.publish(&Arc::new(targets_of(&report))).unwrap();
        engine.save_memory().unwrap();
        let ran = ran(&report);
        (report, ran)
    }

    /// Files of the store below a folder of it.
    fn files(&self, below: &str) -> Vec<PathBuf> {
        let mut files = Vec::new();
        let mut folders = vec![self.cache.path().join(below)];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).into_iter().flatten() {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        files
    }

    /// Flips a bit in every blob.
    fn damage_blobs(&self) {
        for path in self.blobs() {
            let mut bytes = fs::read(&path).unwrap();
            bytes[0] ^= 1;
            fs::write(&path, bytes).unwrap();
        }
    }

    /// Every blob in the store.
    fn blobs(&self) -> Vec<PathBuf> {
        self.files("v2/cas")
    }
}

fn options<'a>(
    jobs: usize,
    cancel: &'a AtomicBool,
    progress: &'a (dyn Fn(Progress) + Sync),
) -> RunOptions<'a> {
    RunOptions { jobs, memory_bytes: 1 << 30, keep_going: true, cancel, progress }
}

fn try_run(engine: &Engine, graph: &Graph, jobs: usize) -> Result<RunReport, Error> {
    engine.run(graph, &options(jobs, &AtomicBool::new(false), &|_| {}))
}

fn run(engine: &Engine, graph: &Graph, jobs: usize) -> RunReport {
    try_run(engine, graph, jobs).unwrap()
}

fn ran(report: &RunReport) -> Vec<String> {
    let with_reason = report.outcomes.iter().filter_map(|outcome| match (&outcome.status, &outcome.record) {
        (Status::Ran { reason }, Some(record)) => Some(format!("{}: {reason}", record.name)),
        _ => None,
    });
    with_reason.collect()
}

/// One target with everything that was made.
fn targets_of(report: &RunReport) -> Targets {
    let outputs = report.outcomes.iter().filter_map(|outcome| outcome.record.as_ref());
    let parts = outputs.flat_map(|record| record.result.outputs.clone());
    let parts = parts.map(|part| Part { name: part.name, digest: part.digest, bytes: part.bytes }).collect();
    let target = Target { kind: "test".into(), state: TargetState::Fresh, meta: json!({}), parts };
    Targets::from([("all".to_owned(), target)])
}

/// An action whose name is its kind.
fn action(
    kind: &str,
    params: Value,
    inputs: Vec<Input>,
    outputs: &[&str],
    perform: impl Fn(&Inputs) -> Result<ActionOutput, Error> + Send + Sync + 'static,
) -> Action {
    let outputs = outputs.iter().map(|&output| output.to_owned()).collect();
    Action {
        name: kind.to_owned(),
        command: Command { kind: kind.to_owned(), recipe: 1, params, outputs },
        inputs,
        rank: 0,
        memory: little_memory(),
        perform: Arc::new(perform),
    }
}

fn source(engine: &Engine, path: &str) -> Input {
    Input::Source { path: path.into(), digest: engine.source(path).digest() }
}

fn made(name: &str, bytes: impl Into<Vec<u8>>) -> ActionOutput {
    ActionOutput { outputs: vec![(name.to_owned(), bytes.into())], ..ActionOutput::default() }
}

fn two_steps(engine: &Engine) -> Graph {
    let mut graph = Graph::default();
    let upper = action("upper a.txt", json!({}), vec![source(engine, "a.txt")], &["text"], |inputs| {
        let Some(bytes) = inputs.bytes(0)? else {
            let diagnostics = vec![Diagnostic::error("a.txt is missing")];
            return Ok(ActionOutput { diagnostics, ..ActionOutput::default() });
        };
        Ok(made("text", bytes.to_ascii_uppercase()))
    });
    let upper = graph.add(upper);
    graph.want(upper);
    let text = Input::Output { action: upper, output: "text".into() };
    graph.add(action("count", json!({}), vec![text], &["count"], |inputs| {
        Ok(made("count", inputs.required(0)?.len().to_string()))
    }));
    graph
}

#[test]
fn second_run_runs_nothing() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    assert_eq!(place.run(2).1, ["upper a.txt: first build", "count: first build"]);
    let (report, ran) = place.run(2);
    assert!(ran.is_empty(), "{ran:?}");
    assert!(report.outcomes.iter().all(|outcome| outcome.status == Status::Reused));
}

#[test]
fn changed_source_is_named_as_the_reason() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.write("a.txt", "kilns");
    let expected = ["upper a.txt: a.txt changed", "count: upper a.txt/text changed"];
    assert_eq!(place.run(1).1, expected);
}

#[test]
fn unchanged_output_cuts_off_what_reads_it() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.write("a.txt", "KILN");
    assert_eq!(place.run(1).1, ["upper a.txt: a.txt changed"]);
}

#[test]
fn reverted_edit_runs_nothing() {
    let place = Place::new();
    for text in ["kiln", "other", "kiln"] {
        place.write("a.txt", text);
        let (_, ran) = place.run(1);
        assert_eq!(ran.is_empty(), text == "kiln" && place.blobs().len() > 2, "{text}: {ran:?}");
    }
}

#[test]
fn missing_source_blocks_readers_and_its_appearance_rebuilds() {
    let place = Place::new();
    let (report, _) = place.run(2);
    assert!(report.outcomes[0].failed());
    assert_eq!(report.outcomes[1].status, Status::Blocked { by: "upper a.txt".into() });
    assert_eq!(report.diagnostics().count(), 1);
    place.write("a.txt", "kiln");
    assert_eq!(place.run(2).1, ["upper a.txt: a.txt appeared", "count: first build"]);
}

#[test]
fn flipped_bit_in_a_blob_is_found_and_rebuilt() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.damage_blobs();
    let store = place.store();
    let digest = Digest::of(b"KILN");
    assert_eq!(store.get(&digest), None);
    assert_eq!(store.damaged_count(), 1);
    assert_eq!(place.run(1).1, ["upper a.txt: its result is no longer in the store"]);
    assert_eq!(store.get(&digest).as_deref(), Some(b"KILN".as_slice()));
}

#[test]
fn damaged_record_is_dropped_and_rebuilt() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    // The memory has them too.
    for file in place.files("v2/actions").into_iter().chain(place.files("v2/projects")) {
        fs::write(file, "{\"half\":").unwrap();
    }
    assert_eq!(place.run(1).1.len(), 2);
}

#[test]
fn results_are_equal_for_any_number_of_jobs() {
    let digests: Vec<_> = [1, 2, 7]
        .map(|jobs| {
            let place = Place::new();
            place.write("a.txt", "kiln");
            let outcomes = place.run(jobs).0.outcomes;
            outcomes
                .iter()
                .map(|outcome| outcome.record.clone().unwrap().result.outputs.clone())
                .collect::<Vec<_>>()
        })
        .into();
    assert!(digests.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn key_covers_every_deciding_field() {
    let command =
        Command { kind: "k".into(), recipe: 1, params: json!({"size": 1}), outputs: vec!["o".into()] };
    let inputs = vec![InputRecord { name: "a".into(), digest: None, bytes: 0, made_as: None }];
    let base = ActionRecord { name: "n".into(), command, inputs, result: ActionResult::default() };
    let changes: [fn(&mut ActionRecord); 6] = [
        |record| record.command.kind = "other".into(),
        |record| record.command.recipe = 2,
        |record| record.command.params = json!({"size": 2}),
        |record| record.command.outputs.push("p".into()),
        |record| record.inputs[0].name = "b".into(),
        |record| record.inputs[0].digest = Some(Digest::of(b"")),
    ];
    for change in changes {
        let mut changed = base.clone();
        change(&mut changed);
        assert_ne!(changed.key(), base.key(), "{changed:?}");
        assert!(matches!(Reason::between(Some(&base), &changed), Reason::Changed(_)), "{changed:?}");
    }
    let mut renamed = base.clone();
    renamed.name = "m".into();
    renamed.result.wall_ms = 5.0;
    assert_eq!(renamed.key(), base.key());
}

#[test]
fn scan_is_repeated_only_when_something_it_looked_at_changed() {
    let place = Place::new();
    place.write("root.txt", "x");
    let looks = AtomicUsize::new(0);
    let look = |engine: &Engine| {
        engine.begin_plan(None);
        let scan = engine.scan("list", 1, "root.txt", |tracker| {
            looks.fetch_add(1, Ordering::Relaxed);
            let root = tracker.read("root.txt").map(|bytes| bytes.len());
            let include = tracker.read("include.txt").map(|bytes| bytes.len());
            (json!({"root": root, "include": include}), vec![])
        });
        (scan.unwrap().found.clone(), looks.load(Ordering::Relaxed))
    };
    let engine = place.engine();
    assert_eq!(look(&engine), (json!({"root": 1, "include": null}), 1));
    assert_eq!(look(&engine).1, 1);
    place.write("include.txt", "appeared");
    assert_eq!(look(&engine), (json!({"root": 1, "include": 8}), 2));
    fs::remove_file(place.folder.path().join("include.txt")).unwrap();
    assert_eq!(look(&engine), (json!({"root": 1, "include": null}), 2), "the first result holds again");
}

#[test]
fn panicking_action_is_a_tool_failure_and_not_a_hang() {
    let place = Place::new();
    let engine = place.engine();
    let mut graph = Graph::default();
    for index in 0..4 {
        let step = action("panic", json!({"index": index}), vec![], &["x"], |_| panic!("out of cheese"));
        graph.add(Action { name: format!("panic {index}"), ..step });
    }
    let error = try_run(&engine, &graph, 3).unwrap_err();
    assert!(error.to_string().contains("out of cheese"), "{error}");
}

#[test]
fn cancelled_run_leaves_the_rest_undone() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    let engine = place.engine();
    let graph = two_steps(&engine);
    let cancel = AtomicBool::new(false);
    let stop_after_first = |progress: Progress| {
        if matches!(progress, Progress::Settled { .. }) {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let report = engine.run(&graph, &options(1, &cancel, &stop_after_first)).unwrap();
    assert!(!report.is_complete());
    assert!(report.outcomes[0].succeeded());
    assert_eq!(report.outcomes[1].status, Status::NotRun);
}

#[test]
fn source_changed_between_plan_and_run_is_refused() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    let engine = place.engine();
    let graph = two_steps(&engine);
    place.write("a.txt", "other");
    let error = try_run(&engine, &graph, 1).unwrap_err();
    assert!(error.to_string().contains("changed while the build ran"), "{error}");
}

#[test]
fn file_hashed_in_pieces_has_the_digest_of_its_bytes() {
    for length in [0, 1, (1 << 20) - 1, 1 << 20, (1 << 20) + 1, (5 << 20) + 77] {
        let bytes: Vec<u8> = (0..length).map(|index: usize| (index * 31 % 251) as u8).collect();
        assert_eq!(Digest::of_reader(&mut &bytes[..]).unwrap(), Digest::of(&bytes), "{length}");
    }
    struct Broken(usize);
    impl io::Read for Broken {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.0 += buffer.len();
            if self.0 > 3 << 20 { Err(io::Error::other("gone")) } else { Ok(buffer.len()) }
        }
    }
    assert!(Digest::of_reader(&mut Broken(0)).is_err());
}

#[test]
fn digest_text_round_trips_and_other_text_is_refused() {
    let digest = Digest::of(b"kiln");
    assert_eq!(digest.to_string().parse::<Digest>().unwrap(), digest);
    for wrong in ["", "12", &"g".repeat(64), &"é".repeat(32)] {
        assert!(wrong.parse::<Digest>().is_err(), "{wrong}");
    }
}

#[test]
fn raised_recipe_version_runs_the_action_and_what_its_output_changes() {
    let place = Place::new();
    let run = |recipe: u32, text: &'static str| {
        let engine = place.engine();
        let mut graph = Graph::default();
        let mut first = action("first", json!({}), vec![], &["text"], move |_| Ok(made("text", text)));
        first.command.recipe = recipe;
        let first = graph.add(first);
        let text = Input::Output { action: first, output: "text".into() };
        graph.add(action("second", json!({}), vec![text], &["same"], |inputs| {
            Ok(made("same", &*inputs.required(0)?))
        }));
        let report = run(&engine, &graph, 1);
        engine.save_memory().unwrap();
        ran(&report)
    };
    assert_eq!(run(1, "a").len(), 2);
    assert_eq!(run(2, "a"), ["first: recipe version changed from 1 to 2"]);
    assert_eq!(run(3, "b"), ["first: recipe version changed from 2 to 3", "second: first/text changed"]);
}

#[test]
fn history_names_old_and_new_value_and_the_build_before() {
    let place = Place::new();
    for text in ["kiln", "kilns", "kiln"] {
        place.write("a.txt", text);
        place.run(1);
    }
    let engine = place.engine();
    assert_eq!(engine.builds().iter().map(|build| build.ran).collect::<Vec<_>>(), [2, 2, 0]);
    let (_, change) = engine.history("upper a.txt").unwrap();
    assert_eq!((change.build, change.since, change.ran), (3, Some(2), false));
    let Reason::Changed(changes) = change.reason else { panic!("{change:?}") };
    let [old, new] = ["kilns", "kiln"].map(|text| Digest::of(text.as_bytes()).short());
    assert_eq!(changes[0].with_values(), format!("a.txt: {old} → {new}"));
}

#[test]
fn forecast_says_what_a_run_then_does() {
    let place = Place::new();
    let forecast = || {
        let engine = place.engine();
        engine.forecast(&two_steps(&engine))
    };
    assert!(
        matches!(&forecast()[..], [Forecast::Runs { reason: Reason::FirstBuild, .. }, Forecast::MayRun { after, .. }]
        if *after == ["upper a.txt"])
    );
    place.run(1);
    assert_eq!(forecast(), [Forecast::Failed, Forecast::Blocked { by: "upper a.txt".into() }]);
    place.write("a.txt", "kiln");
    place.run(1);
    assert_eq!(forecast(), [Forecast::UpToDate, Forecast::UpToDate]);
    assert!(place.run(1).1.is_empty());
}

#[test]
fn action_that_makes_something_else_than_it_declares_is_a_tool_failure() {
    for (outputs, expected) in
        [(vec!["a"], "it did not make `b`"), (vec!["a", "b", "c"], "it made `c`, which it does not declare")]
    {
        let place = Place::new();
        let mut graph = Graph::default();
        let outputs: Vec<(String, Vec<u8>)> = outputs.iter().map(|&name| (name.into(), vec![])).collect();
        graph.add(action("half", json!({}), vec![], &["a", "b"], move |_| {
            Ok(ActionOutput { outputs: outputs.clone(), ..ActionOutput::default() })
        }));
        let error = try_run(&place.engine(), &graph, 1).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(place.files("v2/actions").is_empty(), "nothing is recorded");
    }
}

#[test]
fn declared_folder_stands_for_any_number_of_outputs() {
    let place = Place::new();
    let mut graph = Graph::default();
    graph.add(action("levels", json!({}), vec![], &["levels"], |_| {
        let outputs = (0..3).map(|level| (format!("levels/mip{level}"), vec![level])).collect();
        Ok(ActionOutput { outputs, ..ActionOutput::default() })
    }));
    assert!(run(&place.engine(), &graph, 1).outcomes[0].output("levels/mip2").is_some());
}

#[test]
fn lost_result_is_made_again_only_for_those_that_need_it() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    let run = |suffix: &'static str| {
        let engine = place.engine();
        let mut graph = Graph::default();
        let first =
            graph.add(action("first", json!({}), vec![source(&engine, "a.txt")], &["text"], |inputs| {
                Ok(made("text", &*inputs.required(0)?))
            }));
        let text = Input::Output { action: first, output: "text".into() };
        graph.add(action("second", json!({"suffix": suffix}), vec![text], &["text"], move |inputs| {
            Ok(made("text", [&*inputs.required(0)?, suffix.as_bytes()].concat()))
        }));
        let forecast = engine.forecast(&graph);
        let report = run(&engine, &graph, 2);
        engine.save_memory().unwrap();
        let will_run =
            |forecast: &Forecast| matches!(forecast, Forecast::Runs { .. } | Forecast::MayRun { .. });
        assert_eq!(forecast.iter().filter(|forecast| will_run(forecast)).count(), ran(&report).len());
        ran(&report)
    };
    assert_eq!(run("!").len(), 2);
    let first = Digest::of(b"kiln").to_string();
    fs::remove_file(place.cache.path().join("v2/cas").join(&first[..2]).join(&first)).unwrap();
    assert!(run("!").is_empty(), "nobody needs it");
    let expected = [
        "first: its result is no longer in the store",
        "second: parameter suffix changed from \"!\" to \"?\"",
    ];
    assert_eq!(run("?"), expected);
}

#[test]
fn builds_of_two_processes_are_both_remembered() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    let late = place.engine();
    place.write("a.txt", "kilns");
    place.run(1);
    place.write("a.txt", "kilnss");
    run(&late, &two_steps(&late), 1);
    late.save_memory().unwrap();
    let engine = place.engine();
    assert_eq!(engine.builds().iter().map(|build| build.number).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(engine.history("upper a.txt").unwrap().1.build, 3);
}
