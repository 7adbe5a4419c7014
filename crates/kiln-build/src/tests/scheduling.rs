//! When actions run: memory, failures, cancellation.

use std::sync::Barrier;

use super::*;

/// `count` actions that each need `need_bytes` and tell `observe` how many are at work.
fn observed(count: usize, need_bytes: u64, observe: &Arc<AtomicUsize>, gate: Option<&Arc<Barrier>>) -> Graph {
    let mut graph = Graph::default();
    let at_work = Arc::new(AtomicUsize::new(0));
    for index in 0..count {
        let (observe, at_work, gate) = (observe.clone(), at_work.clone(), gate.cloned());
        let step = action("step", json!({"index": index}), vec![], &["x"], move |_| {
            observe.fetch_max(at_work.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            if let Some(gate) = &gate {
                gate.wait();
            }
            at_work.fetch_sub(1, Ordering::SeqCst);
            Ok(made("x", vec![0]))
        });
        graph.add(Action { name: format!("step {index}"), memory: Arc::new(move |_| need_bytes), ..step });
    }
    graph
}

#[test]
fn actions_that_together_exceed_the_memory_run_one_after_another() {
    let most = Arc::new(AtomicUsize::new(0));
    let graph = observed(8, 600, &most, None);
    let cancel = AtomicBool::new(false);
    let place = Place::new();
    place.engine().run(&graph, &RunOptions { memory_bytes: 1000, ..options(4, &cancel, &|_| {}) }).unwrap();
    assert_eq!(most.load(Ordering::SeqCst), 1);
}

#[test]
fn actions_that_fit_together_run_together() {
    let most = Arc::new(AtomicUsize::new(0));
    // The barrier opens only when two are at work.
    let graph = observed(8, 500, &most, Some(&Arc::new(Barrier::new(2))));
    let cancel = AtomicBool::new(false);
    let place = Place::new();
    place.engine().run(&graph, &RunOptions { memory_bytes: 1000, ..options(2, &cancel, &|_| {}) }).unwrap();
    assert_eq!(most.load(Ordering::SeqCst), 2);
}

#[test]
fn action_larger_than_the_memory_runs_alone() {
    let most = Arc::new(AtomicUsize::new(0));
    let graph = observed(4, 5000, &most, None);
    let cancel = AtomicBool::new(false);
    let place = Place::new();
    let report = place
        .engine()
        .run(&graph, &RunOptions { memory_bytes: 1000, ..options(4, &cancel, &|_| {}) })
        .unwrap();
    assert!(report.is_complete());
    assert_eq!(most.load(Ordering::SeqCst), 1);
}

/// Chains of two, `count` of them: `make N`, `use N`.
fn chains(count: usize) -> Graph {
    let mut graph = Graph::default();
    for index in 0..count {
        let made_by = |name: &str, inputs| {
            let text = format!("{name} {index}");
            let step =
                action(name, json!({"index": index}), inputs, &["x"], move |_| Ok(made("x", text.clone())));
            Action { name: format!("{name} {index}"), ..step }
        };
        let make = graph.add(made_by("make", vec![]));
        graph.add(made_by("use", vec![Input::Output { action: make, output: "x".into() }]));
    }
    graph
}

/// What a run of chains of which the third is urgent did: names in their order, and what was settled when it said so.
fn hurried(place: &Place, mut graph: Graph) -> (Vec<String>, Vec<usize>) {
    let third = graph.iter().find(|(_, action)| action.name == "use 2").expect("there are three").0;
    graph.hurry(&[third]);
    let early = std::sync::Mutex::new(Vec::new());
    let note = |progress: Progress| {
        if let Progress::UrgentSettled { report } = progress {
            assert!(report.outcome(third).succeeded());
            early.lock().unwrap().push(report.outcomes.iter().filter(|outcome| outcome.succeeded()).count());
        }
    };
    let cancel = AtomicBool::new(false);
    let report = place.engine().run(&graph, &options(1, &cancel, &note)).unwrap();
    let names = report.ended.iter().map(|id| graph.action(*id).name.clone()).collect();
    (names, early.into_inner().unwrap())
}

#[test]
fn urgent_actions_and_what_they_read_go_first_and_it_is_said_when_they_are_done() {
    let place = Place::new();
    let (order, early) = hurried(&place, chains(3));
    assert_eq!(order, ["make 2", "use 2", "make 0", "use 0", "make 1", "use 1"]);
    assert_eq!(early, [2]);
    let (order, early) = hurried(&place, chains(3));
    assert!(order.is_empty() && early.is_empty(), "nothing was waited for");
}

#[test]
fn run_that_has_nothing_left_or_did_nothing_urgent_says_nothing_early() {
    let place = Place::new();
    let graph = chains(3);
    let urgent = graph.iter().filter(|(_, action)| action.name.ends_with('2')).map(|(id, _)| id);
    let (alone, _) = graph.only(&urgent.collect::<Vec<_>>());
    run(&place.engine(), &alone, 1);
    let (order, early) = hurried(&place, chains(3));
    assert_eq!((order.len(), early), (4, vec![]), "the urgent ones were up to date");
    let place = Place::new();
    let others = graph.iter().filter(|(_, action)| !action.name.ends_with('2')).map(|(id, _)| id);
    let (others, _) = graph.only(&others.collect::<Vec<_>>());
    run(&place.engine(), &others, 1);
    let (order, early) = hurried(&place, chains(3));
    assert_eq!((order.len(), early), (2, vec![]), "the end of the run says it");
}

/// One that fails, one that could run, and one that is in the store when `warm`.
fn fails_first() -> Graph {
    let mut graph = Graph::default();
    graph.add(action("known", json!({}), vec![], &["x"], |_| Ok(made("x", "x"))));
    graph.add(action("fails", json!({}), vec![], &["x"], |_| {
        let diagnostics = vec![Diagnostic::error("no")];
        Ok(ActionOutput { diagnostics, ..ActionOutput::default() })
    }));
    let other = graph.add(action("other", json!({}), vec![], &["x"], |_| Ok(made("x", "y"))));
    let input = Input::Output { action: other, output: "x".into() };
    graph.add(action("reader", json!({}), vec![input], &["x"], |_| Ok(made("x", "z"))));
    graph
}

#[test]
fn first_failure_stops_new_work_and_keep_going_does_not() {
    let statuses = |keep_going: bool| {
        let place = Place::new();
        let cancel = AtomicBool::new(false);
        let options = RunOptions { keep_going, ..options(1, &cancel, &|_| {}) };
        let report = place.engine().run(&fails_first(), &options).unwrap();
        let name = |outcome: &Outcome| match outcome.status {
            Status::NotRun => "not run",
            _ if outcome.failed() => "failed",
            _ => "made",
        };
        report.outcomes.iter().map(name).collect::<Vec<_>>()
    };
    assert_eq!(statuses(true), ["made", "failed", "made", "made"]);
    assert_eq!(statuses(false), ["made", "failed", "not run", "not run"]);
}

#[test]
fn action_in_flight_ends_when_cancelled_and_nothing_of_it_is_kept() {
    let place = Place::new();
    let mut graph = Graph::default();
    graph.add(action("endless", json!({}), vec![], &["x"], |inputs| {
        loop {
            inputs.check_cancelled()?;
            std::thread::yield_now();
        }
    }));
    let cancel = AtomicBool::new(false);
    let cancel_when_started = |progress: Progress| {
        if matches!(progress, Progress::Started { .. }) {
            cancel.store(true, Ordering::SeqCst);
        }
    };
    let report = place.engine().run(&graph, &options(2, &cancel, &cancel_when_started)).unwrap();
    assert_eq!(report.outcomes[0].status, Status::NotRun);
    assert!(place.files("v2/actions").is_empty());
}

#[test]
fn processes_that_race_on_one_key_leave_one_result() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    let barrier = Barrier::new(4);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let engine = place.engine();
                let graph = two_steps(&engine);
                barrier.wait();
                assert!(run(&engine, &graph, 2).outcomes.iter().all(Outcome::succeeded));
                engine.save_memory().unwrap();
            });
        }
    });
    assert_eq!(place.blobs().len(), 2);
    assert_eq!(place.files("v2/actions").len(), 2);
    assert!(place.run(1).1.is_empty());
}

#[test]
fn equal_work_under_two_names_runs_once() {
    let place = Place::new();
    let engine = place.engine();
    let mut graph = Graph::default();
    let runs = Arc::new(AtomicUsize::new(0));
    for name in ["a", "b", "c"] {
        let first = action("first", json!({}), vec![], &["text"], |_| Ok(made("text", "same")));
        let first = graph.add(Action { name: format!("first {name}"), ..first });
        let runs = runs.clone();
        let text = Input::Output { action: first, output: "text".into() };
        let second = action("second", json!({}), vec![text], &["text"], move |inputs| {
            runs.fetch_add(1, Ordering::SeqCst);
            Ok(made("text", &*inputs.required(0)?))
        });
        graph.add(Action { name: format!("second {name}"), ..second });
    }
    assert_eq!(run(&engine, &graph, 3).ended.len(), 2);
    assert_eq!(runs.load(Ordering::SeqCst), 1);
}
