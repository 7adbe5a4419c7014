//! Environments that ask for a time: what is chosen once, and replayed from then on.

use super::*;
use kiln_build::Digest;

const ASKS: &str = "source = \"room.hdr\"\ntime_ms = 60000";

impl Place {
    fn settle(&self) -> Vec<Choice> {
        let cancel = AtomicBool::new(false);
        settle(&self.engine(), &options(&cancel)).unwrap()
    }

    fn digests(&self) -> Vec<Digest> {
        self.build().targets.values().map(kiln_build::Target::digest).collect()
    }
}

fn asking() -> Place {
    let place = Place::new();
    place.edit("kiln.toml", "source = \"room.hdr\"", ASKS);
    place
}

#[test]
fn time_that_is_asked_for_becomes_an_error_once_and_is_replayed() {
    let place = asking();
    let before = place.build();
    assert_eq!(before.plan.open, ["room"]);
    assert!(before.diagnostics.iter().any(|said| said.message.contains("nothing is chosen yet")));
    let choices = place.settle();
    let [choice] = &choices[..] else { panic!("{choices:?}") };
    assert!(choice.fits && choice.expected_ms > 0.0 && choice.expected_ms < 60_000.0, "{choice:?}");
    // The best there is for halves, at the size that kiln.toml says.
    assert_eq!((choice.locked.error, choice.locked.size), (3e-4, 8));
    let built = place.build();
    assert_eq!((built.plan.open.len(), built.plan.project.envs["room"].error), (0, 3e-4));
    assert!(place.settle().is_empty(), "it was chosen");
    let replayed = place.digests();
    // Another machine, with what is under version control.
    let elsewhere = asking();
    elsewhere.write(LOCK_FILE, fs::read(place.folder.path().join(LOCK_FILE)).unwrap());
    assert_eq!(elsewhere.digests(), replayed);
}

#[test]
fn too_little_time_gets_the_coarsest_there_is_and_says_so() {
    let place = asking();
    place.edit("kiln.toml", "60000", "1");
    place.edit("kiln.toml", "size = 8\n", "");
    let choices = place.settle();
    assert_eq!((choices[0].fits, choices[0].locked.error, choices[0].locked.size), (false, 0.1, 64));
}

#[test]
fn choice_holds_for_its_source_time_format_and_size_alone() {
    let place = asking();
    place.settle();
    let changes: [&dyn Fn(&Place); 4] = [
        &|place| place.edit("kiln.toml", "60000", "50000"),
        &|place| place.edit("kiln.toml", "size = 8", "size = 16"),
        &|place| place.edit("kiln.toml", "size = 16", "size = 16\nformat = \"rgba32f\""),
        &|place| place.write("room.hdr", panorama(2.0)),
    ];
    for change in changes {
        assert!(place.settle().is_empty());
        change(&place);
        assert_eq!(place.settle().len(), 1);
    }
    let lock = Lock::read(&place.engine(), &mut Vec::new());
    assert_eq!((lock.env["room"].error, lock.env["room"].format.as_str()), (1e-4, "rgba32f"));
}

#[test]
fn choice_that_nobody_needs_any_more_goes_with_the_next_one() {
    let place = asking();
    place.settle();
    place.edit("kiln.toml", "[env.room]", "[env.hall]\nsource = \"hall.hdr\"\ntime_ms = 60000\n[env.room]");
    place.write("hall.hdr", panorama(3.0));
    place.edit("kiln.toml", &format!("[env.room]\n{ASKS}"), "[env.room]\nsource = \"room.hdr\"");
    assert_eq!(place.settle().len(), 1);
    let lock = Lock::read(&place.engine(), &mut Vec::new());
    assert_eq!(lock.env.keys().collect::<Vec<_>>(), ["hall"]);
}

#[test]
fn broken_lock_is_named_and_nothing_is_lost_by_it() {
    let place = asking();
    place.settle();
    let good = place.digests();
    place.write(LOCK_FILE, "version = 1\n<<<<<<< HEAD\n");
    let built = place.build();
    let said = errors(&built);
    assert!(said.iter().any(|said| said.file.as_deref() == Some(LOCK_FILE)), "{said:?}");
    assert_eq!(place.settle().len(), 1, "it is chosen anew");
    assert_eq!(place.digests(), good);
}

#[test]
fn environment_whose_source_is_missing_stays_open() {
    let place = asking();
    fs::remove_file(place.folder.path().join("room.hdr")).unwrap();
    assert!(place.settle().is_empty());
    assert!(!place.folder.path().join(LOCK_FILE).exists());
}

#[test]
fn time_and_error_and_profile_are_three_ways_to_say_one_thing() {
    let env = |keys: &str| {
        let (project, said) = parse_project(&format!("version = 1\n[env.a]\nsource = \"a.hdr\"\n{keys}"));
        (project.envs.get("a").cloned(), said)
    };
    for keys in ["time_ms = 5\nerror = 0.1", "time_ms = 5\nprofile = \"draft\""] {
        let (_, said) = env(keys);
        assert!(said.iter().any(|said| said.message.contains("both say how good")), "{said:?}");
    }
    let (draft, said) = env("profile = \"draft\"\nsize = 32");
    let draft = draft.expect("it is sound");
    assert_eq!((said.len(), draft.error, draft.size), (0, 0.03, 32), "what is said goes before the profile");
    let (_, said) = env("profile = \"darft\"");
    assert!(said.iter().any(|said| said.to_string().contains("draft")), "{said:?}");
}
