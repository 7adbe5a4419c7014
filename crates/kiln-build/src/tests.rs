use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kiln_diagnostic::Diagnostic;
use serde_json::json;

use crate::*;

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

    fn engine(&self) -> Engine {
        Engine::open(self.folder.path(), self.cache.path()).unwrap()
    }

    /// Runs `upper(a.txt)` and then `count(upper)`, and says which actions ran and why.
    fn run(&self, jobs: usize) -> (RunReport, Vec<String>) {
        let engine = self.engine();
        let report = run(&engine, &two_steps(&engine), jobs);
        engine.save(Targets::new()).unwrap();
        let ran = ran(&report);
        (report, ran)
    }

    /// Every blob in the store.
    fn blobs(&self) -> Vec<std::path::PathBuf> {
        let folders = fs::read_dir(self.cache.path().join("v1/cas")).unwrap();
        folders
            .flat_map(|folder| fs::read_dir(folder.unwrap().path()).unwrap())
            .map(|f| f.unwrap().path())
            .collect()
    }
}

fn run(engine: &Engine, graph: &Graph, jobs: usize) -> RunReport {
    let cancel = AtomicBool::new(false);
    engine.run(graph, &RunOptions { jobs, cancel: &cancel, progress: &|_| {} }).unwrap()
}

fn ran(report: &RunReport) -> Vec<String> {
    let with_reason = report.outcomes.iter().filter_map(|outcome| match (&outcome.status, &outcome.record) {
        (Status::Ran { reason }, Some(record)) => Some(format!("{}: {reason}", record.name)),
        _ => None,
    });
    with_reason.collect()
}

fn two_steps(engine: &Engine) -> Graph {
    let mut graph = Graph::default();
    let upper = graph.add(Action {
        name: "upper a.txt".into(),
        kind: "upper",
        recipe: 1,
        params: json!({}),
        inputs: vec![Input::Source { path: "a.txt".into(), digest: engine.source("a.txt").digest() }],
        rank: 0,
        perform: Arc::new(|inputs| {
            let Some(bytes) = inputs.bytes(0)? else {
                let diagnostics = vec![Diagnostic::error("a.txt is missing")];
                return Ok(ActionOutput { diagnostics, ..ActionOutput::default() });
            };
            Ok(ActionOutput {
                outputs: vec![("text".into(), bytes.to_ascii_uppercase())],
                ..Default::default()
            })
        }),
    });
    graph.add(Action {
        name: "count".into(),
        kind: "count",
        recipe: 1,
        params: json!({}),
        inputs: vec![Input::Output { action: upper, output: "text".into() }],
        rank: 0,
        perform: Arc::new(|inputs| {
            let count = inputs.required(0)?.len().to_string().into_bytes();
            Ok(ActionOutput { outputs: vec![("count".into(), count)], ..Default::default() })
        }),
    });
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
    for path in place.blobs() {
        let mut bytes = fs::read(&path).unwrap();
        bytes[0] ^= 1;
        fs::write(&path, bytes).unwrap();
    }
    let store = Store::open(place.cache.path()).unwrap();
    let digest = Digest::of(b"KILN");
    assert_eq!(store.get(&digest).unwrap(), None);
    assert_eq!(store.damaged_count(), 1);
    assert_eq!(place.run(1).1, ["upper a.txt: its result is no longer in the store"]);
    assert_eq!(store.get(&digest).unwrap().as_deref(), Some(b"KILN".as_slice()));
}

#[test]
fn damaged_record_is_dropped_and_rebuilt() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    for folder in fs::read_dir(place.cache.path().join("v1/actions")).unwrap() {
        for record in fs::read_dir(folder.unwrap().path()).unwrap() {
            fs::write(record.unwrap().path(), "{\"half\":").unwrap();
        }
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
            outcomes.iter().map(|outcome| outcome.record.clone().unwrap().outputs).collect::<Vec<_>>()
        })
        .into();
    assert!(digests.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn key_covers_every_deciding_field() {
    let base = ActionRecord {
        name: "n".into(),
        kind: "k".into(),
        recipe: 1,
        params: json!({"size": 1}),
        inputs: vec![InputRecord { name: "a".into(), digest: None }],
        outputs: vec![],
        meta: json!(null),
        diagnostics: vec![],
        wall_ms: 0.0,
    };
    let changes: [fn(&mut ActionRecord); 5] = [
        |record| record.kind = "other".into(),
        |record| record.recipe = 2,
        |record| record.params = json!({"size": 2}),
        |record| record.inputs[0].name = "b".into(),
        |record| record.inputs[0].digest = Some(Digest::of(b"")),
    ];
    for change in changes {
        let mut changed = base.clone();
        change(&mut changed);
        assert_ne!(changed.key(), base.key(), "{changed:?}");
    }
    let mut renamed = base.clone();
    renamed.name = "m".into();
    renamed.wall_ms = 5.0;
    assert_eq!(renamed.key(), base.key());
}

#[test]
fn scan_is_repeated_only_when_something_it_looked_at_changed() {
    let place = Place::new();
    place.write("root.txt", "x");
    let looks = AtomicUsize::new(0);
    let look = |engine: &Engine| {
        engine.sources().refresh();
        let scan = engine.scan("list", 1, "root.txt", |tracker| {
            looks.fetch_add(1, Ordering::Relaxed);
            let root = tracker.read("root.txt").map(|bytes| bytes.len());
            let include = tracker.read("include.txt").map(|bytes| bytes.len());
            (json!({"root": root, "include": include}), vec![])
        });
        (scan.unwrap().found, looks.load(Ordering::Relaxed))
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
        graph.add(Action {
            name: format!("panic {index}"),
            kind: "panic",
            recipe: 1,
            params: json!({"index": index}),
            inputs: vec![],
            rank: 0,
            perform: Arc::new(|_| panic!("out of cheese")),
        });
    }
    let cancel = AtomicBool::new(false);
    let error = engine.run(&graph, &RunOptions { jobs: 3, cancel: &cancel, progress: &|_| {} }).unwrap_err();
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
    let report =
        engine.run(&graph, &RunOptions { jobs: 1, cancel: &cancel, progress: &stop_after_first }).unwrap();
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
    let cancel = AtomicBool::new(false);
    let error = engine.run(&graph, &RunOptions { jobs: 1, cancel: &cancel, progress: &|_| {} }).unwrap_err();
    assert!(error.to_string().contains("changed while the build ran"), "{error}");
}

#[test]
fn digest_text_round_trips_and_other_text_is_refused() {
    let digest = Digest::of(b"kiln");
    assert_eq!(digest.to_string().parse::<Digest>().unwrap(), digest);
    for wrong in ["", "12", &"g".repeat(64), &"é".repeat(32)] {
        assert!(wrong.parse::<Digest>().is_err(), "{wrong}");
    }
}
