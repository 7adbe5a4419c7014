//! Every file operation of a build fails, in every way, one at a time.

#![expect(clippy::print_stdout, reason = "what was injected is reported")]

use std::collections::HashSet;
use std::sync::Mutex;

use super::*;

/// How an operation fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// It and everything after it: the machine stops, and what was not synced may be lost.
    PowerFailure,
    /// It and everything after it: the process is gone, the machine goes on.
    Killed,
    NoSpace,
    AccessDenied,
    InputOutput,
    /// Half of the bytes are written, then the disk is full.
    ShortWrite,
}

const FAULTS: [Fault; 6] = [
    Fault::PowerFailure,
    Fault::Killed,
    Fault::NoSpace,
    Fault::AccessDenied,
    Fault::InputOutput,
    Fault::ShortWrite,
];

/// A disk whose operation number `at` fails, counting those that change something.
#[derive(Debug)]
struct FaultyDisk {
    fault: Fault,
    at: usize,
    /// Whether [`FileSystem::sync`] does its work: without it the test of the tests.
    is_honest: bool,
    count: AtomicUsize,
    unsafe_state: Mutex<NotDurable>,
}

/// What a power failure takes.
#[derive(Debug, Default)]
struct NotDurable {
    contents: HashSet<PathBuf>,
    /// New name, and the content that it had before.
    renames: Vec<(PathBuf, Option<Vec<u8>>)>,
    /// Contents before the write.
    is_lost: bool,
}

impl FaultyDisk {
    fn new(fault: Fault, at: usize) -> FaultyDisk {
        FaultyDisk { fault, at, is_honest: true, count: AtomicUsize::new(0), unsafe_state: Mutex::default() }
    }

    fn has_struck(&self) -> bool {
        self.count.load(Ordering::SeqCst) > self.at
    }

    /// Counts an operation; `Err` if it fails.
    fn step(&self) -> io::Result<()> {
        let number = self.count.fetch_add(1, Ordering::SeqCst);
        let stays = matches!(self.fault, Fault::PowerFailure | Fault::Killed);
        if number < self.at || (number > self.at && !stays) {
            return Ok(());
        }
        if number == self.at && self.fault == Fault::PowerFailure {
            self.lose();
        }
        Err(match self.fault {
            Fault::PowerFailure | Fault::Killed => io::Error::other("the process is gone"),
            Fault::NoSpace | Fault::ShortWrite => io::ErrorKind::StorageFull.into(),
            Fault::AccessDenied => io::ErrorKind::PermissionDenied.into(),
            Fault::InputOutput => io::Error::from_raw_os_error(5),
        })
    }

    /// What was not synced is gone: contents by half, every second new name wholly.
    fn lose(&self) {
        let mut state = self.unsafe_state.lock().unwrap();
        if std::mem::replace(&mut state.is_lost, true) {
            return;
        }
        for path in &state.contents {
            if let Ok(bytes) = fs::read(path) {
                fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
            }
        }
        for (path, before) in state.renames.iter().rev().skip(self.at % 2).step_by(2) {
            match before {
                Some(bytes) => fs::write(path, bytes).unwrap(),
                None => fs::remove_file(path).unwrap(),
            }
        }
    }

    fn note(&self, change: impl FnOnce(&mut NotDurable)) {
        change(&mut self.unsafe_state.lock().unwrap());
    }
}

impl FileSystem for FaultyDisk {
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
        self.step()?;
        Disk.create_folder(folder)
    }

    fn write_new(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        if let Err(error) = self.step() {
            if self.fault == Fault::ShortWrite && path.parent().is_some_and(Path::is_dir) {
                Disk.write_new(path, &bytes[..bytes.len() / 2])?;
            }
            return Err(error);
        }
        Disk.write_new(path, bytes)?;
        self.note(|state| _ = state.contents.insert(path.to_owned()));
        Ok(())
    }

    fn sync(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        if self.is_honest {
            self.note(|state| _ = state.contents.remove(path));
        }
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.step()?;
        let before = fs::read(to).ok();
        Disk.rename(from, to)?;
        self.note(|state| {
            if state.contents.remove(from) {
                state.contents.insert(to.to_owned());
            }
            state.renames.push((to.to_owned(), before));
        });
        Ok(())
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.step()?;
        if self.is_honest {
            self.note(|state| state.renames.retain(|(path, _)| path.parent() != Some(folder)));
        }
        Ok(())
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        Disk.remove(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        Disk.touch(path)
    }
}

/// A build and its publication, on a disk that fails.
fn build(place: &Place, disk: Arc<FaultyDisk>) -> Result<(), Error> {
    let store = Store::open_on(disk, place.cache.path())?;
    let engine = Engine::open(place.folder.path(), store)?;
    let report = try_run(&engine, &two_steps(&engine), 1)?;
    engine.publish(&Arc::new(targets_of(&report)))?;
    engine.save_memory()
}

/// What is published must be one of `wholes`, each of its contents must be there, and a build must then make the
/// last of them; returns how many actions that took.
fn check(place: &Place, wholes: [&[&str]; 2]) -> Result<usize, String> {
    let engine = Engine::open(place.folder.path(), place.store()).map_err(|error| error.to_string())?;
    let contents = |targets: &Targets| -> Result<Vec<String>, String> {
        let parts = targets.values().flat_map(|target| &target.parts);
        let read = parts.map(|part| {
            let bytes = engine.store().get(&part.digest).ok_or(format!("published {} is gone", part.name))?;
            Ok(String::from_utf8_lossy(&bytes).into_owned())
        });
        read.collect()
    };
    let published = engine.published();
    let contents_published = contents(&published)?;
    if !wholes.iter().any(|whole| contents_published == *whole) {
        return Err(format!("published is {contents_published:?}"));
    }
    let report = run(&engine, &two_steps(&engine), 1);
    match contents(&targets_of(&report))? {
        rebuilt if rebuilt == wholes[1] => Ok(report.ended.len()),
        rebuilt => Err(format!("rebuilt is {rebuilt:?}")),
    }
}

/// A project that was built with `kiln` and now says `kilns`.
fn edited_place() -> Place {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.write("a.txt", "kilns");
    place
}

const WHOLES: [&[&str]; 2] = [&["KILN", "4"], &["KILNS", "5"]];

#[test]
fn fault_at_any_write_sync_or_rename_leaves_the_old_or_the_new_result() {
    for fault in FAULTS {
        let mut injected = 0;
        let mut rerun_max = 0;
        for at in 0.. {
            let place = edited_place();
            let disk = Arc::new(FaultyDisk::new(fault, at));
            let result = build(&place, disk.clone());
            if !disk.has_struck() {
                assert!(result.is_ok(), "{result:?}");
                break;
            }
            injected += 1;
            match check(&place, WHOLES) {
                Ok(rerun) => rerun_max = rerun_max.max(rerun),
                Err(wrong) => panic!("{fault:?} at operation {at}: {wrong} (the build said {result:?})"),
            }
        }
        println!(
            "{fault:?}: {injected} faults, none with a wrong or half result, at most {rerun_max} actions again"
        );
        assert!(injected > 15, "{fault:?} was injected {injected} times only");
    }
}

#[test]
fn first_build_that_fails_anywhere_publishes_nothing_half() {
    for fault in FAULTS {
        for at in 0.. {
            let place = Place::new();
            place.write("a.txt", "kilns");
            let disk = Arc::new(FaultyDisk::new(fault, at));
            let result = build(&place, disk.clone());
            if !disk.has_struck() {
                break;
            }
            let checked = check(&place, [&[], WHOLES[1]]);
            assert!(checked.is_ok(), "{fault:?} at operation {at}: {checked:?} (the build said {result:?})");
        }
    }
}

/// The failing twin: a disk that does not sync loses what was published.
#[test]
fn power_failure_without_sync_is_seen_by_the_check() {
    let mut wrong = 0;
    for at in 0.. {
        let place = edited_place();
        let disk = Arc::new(FaultyDisk { is_honest: false, ..FaultyDisk::new(Fault::PowerFailure, at) });
        let result = build(&place, disk.clone());
        if !disk.has_struck() {
            break;
        }
        let is_wrong = check(&place, WHOLES).is_err();
        wrong += usize::from(is_wrong);
        assert!(result.is_err());
    }
    assert!(wrong > 0, "the check sees nothing");
}

#[test]
fn cache_that_cannot_be_written_is_read_and_nothing_in_it_changes() {
    let place = edited_place();
    let before = place.files("v2");
    let read_only = Denying(|_, path| path.components().any(|part| part.as_os_str() == "v2"));
    let store = Store::open_on(Arc::new(read_only), place.cache.path()).unwrap();
    assert!(store.is_read_only());
    let engine = Engine::open(place.folder.path(), store).unwrap();
    let ran_actions = ran(&run(&engine, &two_steps(&engine), 1));
    assert_eq!(ran_actions, ["upper a.txt: a.txt changed", "count: upper a.txt/text changed"]);
    assert!(ran(&run(&engine, &two_steps(&engine), 1)).is_empty(), "this process finds what it made");
    place.write("a.txt", "kiln");
    engine.begin_plan(None);
    assert!(ran(&run(&engine, &two_steps(&engine), 1)).is_empty(), "and what the cache has");
    drop(engine);
    assert_eq!(place.files("v2"), before);
}

#[test]
fn damaged_file_that_cannot_be_removed_is_replaced() {
    let place = Place::new();
    place.write("a.txt", "kiln");
    place.run(1);
    place.damage_blobs();
    // Opening a store makes and removes a file beside its folders.
    let denying = Denying(|operation, path| {
        operation == Operation::Remove && path.parent().is_none_or(|folder| !folder.ends_with("v2"))
    });
    let store = Store::open_on(Arc::new(denying), place.cache.path()).unwrap();
    let engine = Engine::open(place.folder.path(), store).unwrap();
    let digest = Digest::of(b"KILN");
    assert_eq!(engine.store().get(&digest), None);
    assert_eq!(run(&engine, &two_steps(&engine), 1).ended.len(), 1);
    assert_eq!(engine.store().get(&digest).as_deref(), Some(b"KILN".as_slice()));
}
