//! Watching by itself, and whole daemons on small projects.

mod accuracy;
mod live;
mod requests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use notify::event::{AccessKind, AccessMode, CreateKind, EventKind, ModifyKind};

use crate::watch::{Batch, Gathering, Watch, name_changes, normalise, settle};

const LIMIT: Duration = Duration::from_secs(20);

fn names(files: &[&str]) -> BTreeSet<String> {
    files.iter().map(|file| (*file).to_owned()).collect()
}

fn changes(kind: EventKind, path: &str) -> BTreeSet<String> {
    let relevant = ["/p/kiln.toml", "/p/shaders/a.wgsl", "/p/shaders/lib/b.wgsl", "/p/shaders2/c.wgsl"];
    let named = |path: &&str| (PathBuf::from(path), names(&[path.trim_start_matches("/p/")]));
    let relevant: BTreeMap<PathBuf, BTreeSet<String>> = relevant.iter().map(named).collect();
    let event = notify::Event::new(kind).add_path(PathBuf::from(path));
    name_changes(&Ok(event), Path::new("/p"), &Mutex::new(relevant))
}

#[test]
fn event_of_a_file_is_about_that_file_alone() {
    let modified = EventKind::Modify(ModifyKind::Any);
    assert_eq!(changes(modified, "/p/shaders/a.wgsl"), names(&["shaders/a.wgsl"]));
    assert!(changes(modified, "/p/baked/manifest.json").is_empty());
    assert!(changes(EventKind::Access(AccessKind::Any), "/p/shaders/a.wgsl").is_empty());
    let closed = |mode| changes(EventKind::Access(AccessKind::Close(mode)), "/p/shaders/a.wgsl");
    assert_eq!(closed(AccessMode::Write), names(&["shaders/a.wgsl"]));
    assert!(closed(AccessMode::Read).is_empty());
}

#[test]
fn event_of_a_folder_is_about_all_that_lies_below_it() {
    let created = EventKind::Create(CreateKind::Folder);
    assert_eq!(changes(created, "/p/shaders"), names(&["shaders/a.wgsl", "shaders/lib/b.wgsl"]));
    assert!(changes(created, "/p").is_empty());
}

#[test]
fn queue_overflow_is_about_everything() {
    let relevant = Mutex::new(BTreeMap::from([(PathBuf::from("/p/a"), names(&["a"]))]));
    let lost = notify::Event::new(EventKind::Other).set_flag(notify::event::Flag::Rescan);
    assert_eq!(name_changes(&Ok(lost), Path::new("/p"), &relevant), names(&["a"]));
    assert_eq!(name_changes(&Err(notify::Error::generic("gone")), Path::new("/p"), &relevant), names(&["a"]));
}

#[test]
fn events_close_together_are_one_batch() {
    let (sender, events) = channel();
    for name in ["a", "b", "a", ""] {
        sender.send(name).unwrap();
    }
    drop(sender);
    let batches = Mutex::new(Vec::new());
    let name = |name: &&str| if name.is_empty() { BTreeSet::new() } else { names(&[name]) };
    settle(&events, &|batch: Batch| batches.lock().unwrap().push(batch.files), name, |_| false);
    assert_eq!(batches.into_inner().unwrap(), [names(&["a", "b"])]);
}

#[test]
fn readers_of_a_saved_file_keep_nobody_waiting() {
    let begun = Instant::now();
    let at = |ms| begun + Duration::from_millis(ms);
    let mut batch = Gathering::new(begun);
    batch.add(names(&["a"]), false, at(0));
    let end_while_written = batch.end;
    batch.add(names(&["a"]), true, at(1));
    let end = batch.end;
    assert!(end < end_while_written, "a whole file waits as long as one being written");
    batch.add(names(&[]), false, at(2));
    assert_eq!(batch.end, end);
    batch.add(names(&["a"]), false, at(2));
    assert!(batch.end > end, "nobody waits for a file that is being written again");
    batch.add(names(&["b"]), true, at(3));
    assert!(batch.end > end_while_written, "several files may be followed by more");
    (0..1000).for_each(|ms| batch.add(names(&["a"]), false, at(ms)));
    assert!(batch.end < at(1000), "a file that is never whole is never built");
}

#[test]
fn file_that_is_written_without_a_pause_is_built_all_the_same() {
    let (sender, events) = channel();
    sender.send(()).unwrap();
    // The next event is there before this one is looked at, as long as nothing was built.
    let sender = Mutex::new(Some(sender));
    let given_up = Instant::now() + LIMIT;
    let name = |_: &()| {
        if let Some(sender) = &*sender.lock().unwrap()
            && Instant::now() < given_up
        {
            sender.send(()).unwrap();
        }
        names(&["a"])
    };
    let settled = |_| drop(sender.lock().unwrap().take());
    settle(&events, &settled, name, |_| false);
    assert!(Instant::now() < given_up, "writing went on until nothing more was written");
}

#[test]
fn merged_batch_keeps_the_earliest_time() {
    let batch = |files: &[&str], noticed_unix_ms| Batch { files: names(files), noticed_unix_ms };
    let mut merged = Batch::default();
    merged.merge(batch(&["a"], 20.0));
    merged.merge(batch(&["b"], 10.0));
    merged.merge(Batch::default());
    assert_eq!(merged, batch(&["a", "b"], 10.0));
}

#[test]
fn paths_have_one_spelling() {
    assert_eq!(normalise(Path::new("/p/./a/../b/c")), Path::new("/p/b/c"));
}

#[test]
fn link_to_a_file_elsewhere_is_watched_there() {
    let (project, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let project = project.path().canonicalize().unwrap();
    let elsewhere = elsewhere.path().canonicalize().unwrap();
    fs::write(elsewhere.join("sky.hdr"), "before").unwrap();
    std::os::unix::fs::symlink(elsewhere.join("sky.hdr"), project.join("sky.hdr")).unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["sky.hdr".to_owned()]);
    fs::write(elsewhere.join("sky.hdr"), "after").unwrap();
    assert_eq!(batches.recv_timeout(LIMIT).unwrap().files, names(&["sky.hdr"]));
}

#[test]
fn file_in_folders_that_appear_later_is_noticed() {
    let project = tempfile::tempdir().unwrap();
    let project = project.path().canonicalize().unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["a/b/c/deep.wgsl".to_owned()]);
    fs::create_dir_all(project.join("a/b/c")).unwrap();
    fs::write(project.join("a/b/c/deep.wgsl"), "here").unwrap();
    assert_eq!(batches.recv_timeout(LIMIT).unwrap().files, names(&["a/b/c/deep.wgsl"]));
}

#[cfg(unix)]
#[test]
fn file_of_two_names_changes_under_both() {
    let project = tempfile::tempdir().unwrap();
    let project = project.path().canonicalize().unwrap();
    fs::write(project.join("one.wgsl"), "before").unwrap();
    std::os::unix::fs::symlink("one.wgsl", project.join("two.wgsl")).unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["one.wgsl".to_owned(), "two.wgsl".to_owned()]);
    let both = names(&["one.wgsl", "two.wgsl"]);
    let seen_under_one = watch.with_other_names(vec!["two.wgsl".to_owned()]);
    assert_eq!(seen_under_one.into_iter().collect::<BTreeSet<_>>(), both);
    assert_eq!(watch.with_other_names(vec!["three.wgsl".to_owned()]), ["three.wgsl"]);
    fs::write(project.join("one.wgsl"), "after").unwrap();
    assert_eq!(batches.recv_timeout(LIMIT).unwrap().files, both);
}

#[test]
fn closed_or_moved_file_is_whole_and_a_written_one_is_not() {
    use notify::event::{DataChange, RenameMode};
    let event = notify::Event::new;
    let ends = |kind| crate::watch::ends_a_save(Ok(&event(kind)));
    assert!(ends(EventKind::Access(AccessKind::Close(AccessMode::Write))));
    assert!(ends(EventKind::Modify(ModifyKind::Name(RenameMode::To))));
    assert!(!ends(EventKind::Modify(ModifyKind::Data(DataChange::Any))));
    assert!(!ends(EventKind::Access(AccessKind::Close(AccessMode::Read))));
}

/// Takes batches until all these files were in one.
fn wait_for(batches: &std::sync::mpsc::Receiver<Batch>, files: &[&str]) {
    let mut left = names(files);
    while !left.is_empty() {
        let batch = batches.recv_timeout(LIMIT).unwrap_or_else(|error| panic!("{left:?}: {error}"));
        left.retain(|name| !batch.files.contains(name));
    }
}

#[test]
fn file_replaced_by_a_folder_and_back_is_noticed_each_time() {
    let project = tempfile::tempdir().unwrap();
    let project = project.path().canonicalize().unwrap();
    let file = project.join("sky.hdr");
    fs::write(&file, "before").unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["sky.hdr".to_owned()]);
    fs::remove_file(&file).unwrap();
    wait_for(&batches, &["sky.hdr"]);
    fs::create_dir(&file).unwrap();
    wait_for(&batches, &["sky.hdr"]);
    fs::remove_dir(&file).unwrap();
    wait_for(&batches, &["sky.hdr"]);
    fs::write(&file, "after").unwrap();
    wait_for(&batches, &["sky.hdr"]);
}

#[cfg(unix)]
#[test]
fn link_that_leads_elsewhere_now_is_noticed_and_followed() {
    use std::os::unix::fs::symlink;
    let (project, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let project = project.path().canonicalize().unwrap();
    let elsewhere = elsewhere.path().canonicalize().unwrap();
    for name in ["one", "two"] {
        fs::create_dir(elsewhere.join(name)).unwrap();
        fs::write(elsewhere.join(name).join("sky.hdr"), name).unwrap();
    }
    let link = project.join("sky.hdr");
    symlink(elsewhere.join("one/sky.hdr"), &link).unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["sky.hdr".to_owned()]);
    assert!(watch.has_links());
    fs::remove_file(&link).unwrap();
    symlink(elsewhere.join("two/sky.hdr"), &link).unwrap();
    wait_for(&batches, &["sky.hdr"]);
    // As the daemon does after each build of a project with links.
    watch.set_relevant(&["sky.hdr".to_owned()]);
    while batches.try_recv().is_ok() {}
    fs::write(elsewhere.join("two/sky.hdr"), "after").unwrap();
    wait_for(&batches, &["sky.hdr"]);
}

#[test]
fn checkout_of_thousands_of_files_misses_none() {
    let project = tempfile::tempdir().unwrap();
    let project = project.path().canonicalize().unwrap();
    let files: Vec<String> = (0..3000).map(|index| format!("shaders/{}/{index}.wgsl", index % 50)).collect();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&files);
    for file in &files {
        fs::create_dir_all(project.join(file).parent().unwrap()).unwrap();
        fs::write(project.join(file), "new").unwrap();
    }
    wait_for(&batches, &files.iter().map(String::as_str).collect::<Vec<_>>());
}

#[test]
fn events_of_thousands_of_files_that_wait_are_one_batch() {
    let (sender, events) = channel();
    (0..5000).for_each(|index: u32| sender.send(index).unwrap());
    drop(sender);
    let batches = Mutex::new(Vec::new());
    let name = |index: &u32| names(&[&index.to_string()]);
    settle(&events, &|batch: Batch| batches.lock().unwrap().push(batch.files.len()), name, |_| false);
    assert_eq!(batches.into_inner().unwrap(), [5000]);
}

#[test]
fn file_is_being_written_from_the_first_byte_until_it_is_closed() {
    use std::io::Write as _;
    let project = tempfile::tempdir().unwrap();
    let project = project.path().canonicalize().unwrap();
    let (sender, batches) = channel();
    let mut watch = Watch::start(&project, move |batch| drop(sender.send(batch))).unwrap();
    watch.set_relevant(&["sky.hdr".to_owned()]);
    let mut file = fs::File::create(project.join("sky.hdr")).unwrap();
    file.write_all(b"half").unwrap();
    let deadline = Instant::now() + LIMIT;
    // Looked at again as bytes come, because the account forgets whoever stops.
    while watch.being_written().is_empty() {
        assert!(Instant::now() < deadline);
        file.write_all(b".").unwrap();
        std::thread::yield_now();
    }
    drop(file);
    while !watch.being_written().is_empty() {
        assert!(Instant::now() < deadline);
        std::thread::yield_now();
    }
    wait_for(&batches, &["sky.hdr"]);
}
