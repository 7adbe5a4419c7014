//! When a file is read again, and when `stat` is enough.

use std::time::{Duration, SystemTime};

use super::*;

/// Sets a file's time of modification, as tools and wrong clocks do.
fn set_age(place: &Place, path: &str, time: SystemTime) {
    let file = fs::File::options().write(true).open(place.folder.path().join(path)).unwrap();
    file.set_modified(time).unwrap();
}

/// How many files a new process hashes.
fn hashed(place: &Place) -> usize {
    let engine = place.engine();
    engine.begin_plan(None);
    engine.source("a.txt");
    engine.save_memory().unwrap();
    engine.sources().hashed().0
}

/// Waits until the file system's clock has passed the time in which a change could go unseen.
fn wait_until_settled(place: &Place) {
    let deadline = SystemTime::now() + Duration::from_secs(20);
    while hashed(place) > 0 {
        assert!(SystemTime::now() < deadline, "the stamp never settles");
        std::thread::yield_now();
    }
}

#[test]
fn young_file_is_hashed_again_and_a_settled_one_is_not() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    assert_eq!([hashed(&place), hashed(&place)], [1, 1], "it could still change within its time stamp");
    wait_until_settled(&place);
    assert_eq!(hashed(&place), 0);
}

#[test]
fn file_with_an_old_time_put_back_is_hashed_again() {
    let place = Place::new();
    let hour_ago = SystemTime::now() - Duration::from_secs(3600);
    place.write("a.txt", "kiln");
    set_age(&place, "a.txt", hour_ago);
    assert_eq!([hashed(&place), hashed(&place)], [1, 1], "the system's own time is young");
    wait_until_settled(&place);
    let digest = place.engine().source("a.txt");
    place.write("a.txt", "KILN");
    set_age(&place, "a.txt", hour_ago);
    assert_ne!(place.engine().source("a.txt"), digest, "same length, same time, other content");
}

#[test]
fn clock_that_went_back_costs_hashing_and_nothing_else() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    set_age(&place, "a.txt", SystemTime::now() + Duration::from_secs(86_400));
    assert_eq!([hashed(&place), hashed(&place)], [1, 1]);
    place.run(1);
    assert!(place.run(1).1.is_empty());
    place.write("a.txt", "other");
    set_age(&place, "a.txt", SystemTime::now() - Duration::from_secs(86_400));
    assert_eq!(place.run(1).1[0], "upper a.txt: a.txt changed");
}

#[test]
fn told_changes_are_looked_at_and_nothing_else() {
    let place = Place::new();
    place.write("a.txt", "a");
    place.write("b.txt", "b");
    let engine = place.engine();
    engine.begin_plan(None);
    let states = || ["a.txt", "b.txt"].map(|path| engine.source(path).digest().unwrap());
    let before = states();
    place.write("a.txt", "A");
    place.write("b.txt", "B");
    engine.begin_plan(Some(&["a.txt".to_owned()]));
    let after = states();
    assert_ne!(after[0], before[0]);
    assert_eq!(after[1], before[1]);
    let both = ["a.txt".to_owned(), "b.txt".to_owned()];
    assert_eq!(engine.sources().changed_since_seen(&both, || true), ["b.txt"]);
    assert!(engine.sources().changed_since_seen(&both, || false).is_empty());
}
