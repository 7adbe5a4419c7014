//! What a collection takes and what it leaves.

use std::time::{Duration, SystemTime};

use super::*;

fn collect(store: &Store, bytes_max: u64) -> Collected {
    store.collect(&CollectOptions { bytes_max, wait: true, dry_run: false }).unwrap().unwrap()
}

fn make_old(path: &Path, seconds: u64) {
    let file = fs::File::options().write(true).open(path).unwrap();
    file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
}

/// Digests in a project's published revision, as far as the store has them.
fn published(place: &Place) -> usize {
    place.engine().published().values().map(|target| target.parts.len()).sum()
}

#[test]
fn published_revision_outlives_a_collection_of_everything() {
    let place = Place::new();
    for text in ["kiln", "kilns"] {
        place.write("a.txt", text);
        place.run(1);
    }
    assert_eq!(place.blobs().len(), 4);
    let collected = collect(&place.store(), 0);
    assert_eq!(place.blobs().len(), 2, "{collected:?}");
    assert_eq!(published(&place), 2);
    assert_eq!(place.run(1).1.len(), 0, "the memory still knows what made it");
}

#[test]
fn unused_longest_goes_first_and_use_is_noted() {
    let place = Place::new();
    let store = place.store();
    let digests: Vec<Digest> = (0..4u8).map(|value| store.put(&[value; 100]).unwrap()).collect();
    for (index, path) in place.blobs().iter().enumerate() {
        make_old(path, 10_000 + index as u64);
    }
    assert!(store.contains(&digests[2], 100));
    collect(&store, 100);
    assert_eq!(place.blobs().len(), 1);
    assert!(store.contains(&digests[2], 100));
}

#[test]
fn limit_counts_only_what_could_go() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    let store = place.store();
    let held = store.usage().unwrap().held_bytes;
    assert!(held > 0);
    let loose = store.usage().unwrap().bytes - held;
    fs::create_dir_all(place.cache.path().join("v1")).unwrap();
    fs::write(place.cache.path().join("v1/large"), vec![0; 1 << 20]).unwrap();
    assert_eq!(collect(&store, loose).removed_files, 0);
    assert_eq!(collect(&store, loose - 1).removed_files, 1);
}

#[test]
fn use_of_a_record_is_noted() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.files("v2/actions").iter().for_each(|path| make_old(path, 10_000));
    fs::remove_dir_all(place.cache.path().join("v2/projects")).unwrap();
    assert!(place.run(1).1.is_empty());
    let age = |path: &PathBuf| fs::metadata(path).unwrap().modified().unwrap().elapsed().unwrap_or_default();
    assert!(place.files("v2/actions").iter().all(|path| age(path) < Duration::from_secs(5000)));
}

#[cfg(unix)]
#[test]
fn published_revision_of_a_folder_that_is_no_utf8_is_held() {
    use std::os::unix::ffi::OsStrExt as _;
    let place = Place::new();
    let folder = place.folder.path().join(std::ffi::OsStr::from_bytes(b"caf\xe9 100%"));
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a.txt"), "kiln").unwrap();
    let engine = Engine::open(&folder, place.store()).unwrap();
    let report = run(&engine, &two_steps(&engine), 1);
    engine.publish(&Arc::new(targets_of(&report))).unwrap();
    let projects = fs::read_dir(place.cache.path().join("v2/projects")).unwrap();
    projects.for_each(|project| make_old(&project.unwrap().path().join("published.json"), 90 * 86_400));
    assert!(collect(&place.store(), 0).forgotten_projects.is_empty());
    assert_eq!(place.blobs().len(), 2);
}

#[test]
fn project_whose_folder_is_gone_holds_nothing() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    let Place { folder, cache } = place;
    folder.close().unwrap();
    let store = Store::open(cache.path()).unwrap();
    assert!(collect(&store, 0).forgotten_projects.is_empty(), "a drive may come back");
    let projects = fs::read_dir(cache.path().join("v2/projects")).unwrap();
    projects.for_each(|project| make_old(&project.unwrap().path().join("published.json"), 8 * 86_400));
    assert_eq!(collect(&store, 0).forgotten_projects.len(), 1);
    assert_eq!(store.usage().unwrap(), Usage::default());
}

#[test]
fn memory_of_a_project_that_was_only_planned_goes_after_a_month() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    let engine = place.engine();
    engine.source("a.txt");
    engine.save_memory().unwrap();
    collect(&place.store(), 0);
    assert!(!place.files("v2/projects").is_empty(), "it is young");
    place.files("v2/projects").iter().for_each(|path| make_old(path, 31 * 86_400));
    collect(&place.store(), 0);
    assert_eq!(fs::read_dir(place.cache.path().join("v2/projects")).unwrap().count(), 0);
}

#[test]
fn collection_leaves_a_running_build_alone() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    let other = place.store();
    let hold = place.store().hold();
    let now = CollectOptions { bytes_max: 0, wait: false, dry_run: false };
    assert_eq!(other.collect(&now).unwrap(), None);
    drop(hold);
    assert!(other.collect(&now).unwrap().is_some());
}

#[test]
fn two_projects_build_while_a_third_process_collects() {
    let projects = [Place::new(), Place::new()];
    let cache = tempfile::tempdir().unwrap();
    let open = |place: &Place| Engine::open(place.folder.path(), Store::open(cache.path()).unwrap()).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let builders = projects.each_ref().map(|place| {
            scope.spawn(|| {
                for round in 0..30 {
                    // Shared, so that one project's results are the other's.
                    place.write("a.txt", &format!("round {}", round / 2));
                    let engine = open(place);
                    let _hold = engine.store().hold();
                    let report = run(&engine, &two_steps(&engine), 1);
                    for outcome in &report.outcomes {
                        let output = &outcome.record.as_ref().unwrap().result.outputs[0];
                        assert!(engine.store().get(&output.digest).is_some(), "{output:?}");
                    }
                    engine.publish(&Arc::new(targets_of(&report))).unwrap();
                    engine.save_memory().unwrap();
                }
            })
        });
        scope.spawn(|| {
            let store = Store::open(cache.path()).unwrap();
            while !done.load(Ordering::SeqCst) {
                collect(&store, 0);
            }
        });
        for builder in builders {
            builder.join().unwrap();
        }
        done.store(true, Ordering::SeqCst);
    });
    for place in &projects {
        let engine = open(place);
        let published = engine.published();
        for part in &published["all"].parts {
            assert!(engine.store().get(&part.digest).is_some(), "{part:?}");
        }
        assert_eq!(published["all"].parts.len(), 2);
    }
}

#[test]
fn what_killed_processes_left_goes() {
    let place = Place::new();
    let store = place.store();
    store.put(b"kept").unwrap();
    let folder = place.blobs()[0].parent().unwrap().to_owned();
    for (name, age) in [(".kiln-1-0-old", 7200), (".kiln-2-0-young", 0)] {
        fs::write(folder.join(name), "half").unwrap();
        make_old(&folder.join(name), age);
    }
    collect(&store, u64::MAX);
    let names: Vec<_> = place.blobs().iter().map(|path| path.file_name().unwrap().to_owned()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(names.contains(&".kiln-2-0-young".into()), "it may be in the making");
}

#[test]
fn check_finds_and_drops_a_flipped_bit_in_every_kind_of_file() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    let engine = place.engine();
    engine.scan("list", 1, "a.txt", |tracker| (json!(tracker.read("a.txt").is_some()), vec![])).unwrap();
    assert_eq!(place.store().check(&|_, _| {}).unwrap(), (5, 0));
    let files =
        place.files("v2/cas").into_iter().chain(place.files("v2/actions")).chain(place.files("v2/scans"));
    for file in files {
        let mut bytes = fs::read(&file).unwrap();
        *bytes.last_mut().unwrap() ^= 4;
        fs::write(&file, bytes).unwrap();
    }
    assert_eq!(place.store().check(&|_, _| {}).unwrap(), (5, 5));
    assert!(place.blobs().is_empty());
}

/// A store as version 0.1 wrote it before the present format.
const STORE_V1: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/store-v1");

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn store_of_format_1_is_neither_used_nor_damaged_and_goes_when_it_is_old() {
    let place = Place::new();
    copy(Path::new(STORE_V1), place.cache.path());
    let count = place.files("v1").len();
    assert!(count >= 5, "the fixture has blobs, records, a scan and a project");
    place.write("a.txt", "kiln");
    assert_eq!(place.run(1).1.len(), 2, "its results are of another format");
    collect(&place.store(), 0);
    assert_eq!(place.files("v1").len(), count, "another version of Kiln may be using it");
    place.files("v1").iter().for_each(|path| make_old(path, 8 * 86_400));
    assert!(place.store().usage().unwrap().other_formats_bytes > 0);
    collect(&place.store(), u64::MAX);
    assert!(place.files("v1").is_empty());
}
