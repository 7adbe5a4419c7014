//! What each kind of edit runs, and what it leaves alone.

#![expect(clippy::print_stdout, reason = "what was measured is reported")]

use super::*;

#[test]
fn each_edit_runs_exactly_what_it_affects() {
    let place = Place::new();
    place.build();
    place.edit("lib/tint.wgsl", "0.25", "0.75");
    // The unlit variant reads the file too, but its text comes out the same.
    assert_eq!(ran(&place.build()), ["compile shader/flat/base", "compile shader/flat/unlit"]);
    place.edit("quad.gltf", "\"name\":\"plain\"", "\"name\":\"rough\"");
    assert_eq!(ran(&place.build()), ["pack scene/quad"]);
    place.edit("kiln.toml", "irradiance_size = 4", "irradiance_size = 2");
    assert_eq!(ran(&place.build()), ["irradiance env/room", "measure env/room/irradiance"]);
    place.write("room.hdr", panorama(2.0));
    let expected = [
        "analyse env/room",
        "decode env/room",
        "irradiance env/room",
        "measure env/room/irradiance",
        "measure env/room/specular",
        "prefilter env/room/specular mip 1",
        "sh env/room",
        "skybox env/room",
    ];
    assert_eq!(ran(&place.build()), expected);
    assert!(ran(&place.build()).is_empty());
}

#[test]
fn touched_file_runs_nothing() {
    let place = Place::new();
    place.build();
    for file in ["room.hdr", "flat.wgsl", "quad.gltf", "kiln.toml"] {
        let path = place.folder.path().join(file);
        fs::write(&path, fs::read(&path).unwrap()).unwrap();
    }
    assert!(ran(&place.build()).is_empty());
}

#[test]
fn renamed_file_is_decoded_again_and_nothing_above_it_runs() {
    let place = Place::new();
    let before = place.build().targets;
    fs::rename(place.folder.path().join("room.hdr"), place.folder.path().join("hall.hdr")).unwrap();
    place.edit("kiln.toml", "source = \"room.hdr\"", "source = \"hall.hdr\"");
    let built = place.build();
    assert_eq!(ran(&built), ["decode env/room"]);
    assert_eq!(built.targets, before);
}

#[test]
fn reverted_edit_runs_nothing() {
    let place = Place::new();
    let before = place.build().targets;
    let good = fs::read(place.folder.path().join("room.hdr")).unwrap();
    place.write("room.hdr", panorama(3.0));
    assert_eq!(ran(&place.build()).len(), 8);
    place.write("room.hdr", good);
    let built = place.build();
    assert!(ran(&built).is_empty());
    assert_eq!(built.targets, before);
}

#[test]
fn deleted_then_restored_file_runs_nothing() {
    let place = Place::new();
    let before = place.build().targets;
    let good = fs::read(place.folder.path().join("quad.bin")).unwrap();
    fs::remove_file(place.folder.path().join("quad.bin")).unwrap();
    assert_eq!(ran(&place.build()), ["pack scene/quad"]);
    place.write("quad.bin", good);
    let built = place.build();
    assert!(ran(&built).is_empty());
    assert_eq!(built.targets, before);
}

#[test]
fn parameter_that_changes_no_result_is_cut_off() {
    let place = Place::new();
    place.build();
    place.edit("kiln.toml", "name = \"test\"", "name = \"other\"");
    assert!(ran(&place.build()).is_empty(), "no action reads the project's name");
    // Nothing needs repair, so each policy gives the same panorama.
    place.edit("kiln.toml", "size = 8", "size = 8\ntexels = \"error\"");
    assert_eq!(ran(&place.build()), ["decode env/room"]);
}

#[test]
fn swapped_buffer_packs_the_scene_and_compiles_nothing() {
    let place = Place::new();
    place.build();
    let mut buffer = fs::read(place.folder.path().join("quad.bin")).unwrap();
    buffer[1] ^= 1;
    place.write("quad.bin", buffer);
    assert_eq!(ran(&place.build()), ["pack scene/quad"]);
}

#[test]
fn include_that_was_missing_at_first_is_picked_up() {
    let place = Place::new();
    let include = fs::read(place.folder.path().join("lib/tint.wgsl")).unwrap();
    fs::remove_file(place.folder.path().join("lib/tint.wgsl")).unwrap();
    assert!(!errors(&place.build()).is_empty());
    place.write("lib/tint.wgsl", include);
    let built = place.build();
    assert_eq!(ran(&built), ["compile shader/flat/base", "compile shader/flat/unlit"]);
    assert!(errors(&built).is_empty());
}

#[test]
fn rebuilt_cache_after_its_loss_gives_the_same_targets() {
    let place = Place::new();
    let before = place.build().targets;
    fs::remove_dir_all(place.cache.path().join("v2")).unwrap();
    let built = place.build();
    assert!(built.report.outcomes.iter().all(|outcome| matches!(outcome.status, Status::Ran { .. })));
    assert_eq!(built.targets, before);
}

#[test]
fn why_follows_a_change_down_to_its_source_and_names_the_cut_off() {
    let place = Place::new();
    place.build();
    place.write("room.hdr", panorama(2.0));
    place.build();
    let engine = place.engine();
    let plan = plan(&engine, None).unwrap();
    let found = why(&engine, &plan, "env/room/sh").unwrap();
    let names: Vec<&str> = found.iter().map(|why| why.action.as_str()).collect();
    assert_eq!(names, ["sh env/room", "analyse env/room", "decode env/room"]);
    assert!(found.iter().all(|why| why.now == "up to date"));
    let change = found[2].change.as_ref().unwrap();
    assert_eq!((change.build, change.since), (2, Some(1)));
    assert!(matches!(&change.reason, Reason::Changed(changes) if changes[0].input() == Some("room.hdr")));

    // A file with other bytes and the same texels: the comment line differs.
    let mut bytes = panorama(2.0);
    let at = bytes.windows(7).position(|window| window == b"FORMAT=").unwrap();
    bytes.splice(at..at, b"# tuesday\n".iter().copied());
    place.write("room.hdr", bytes);
    let plan_now = crate::plan(&engine, None).unwrap();
    let pending = why(&engine, &plan_now, "env/room/sh").unwrap();
    assert!(pending[2].now.starts_with("would run now: room.hdr: "), "{}", pending[2].now);
    assert_eq!(ran(&place.build()), ["decode env/room"]);
    let engine = place.engine();
    let found = why(&engine, &plan_now, "env/room/sh").unwrap();
    assert_eq!(found[1].cut_off_by.len(), 1, "{found:?}");
    assert_eq!(
        (found[1].cut_off_by[0].action.as_str(), found[1].cut_off_by[0].build),
        ("decode env/room", 3)
    );
    assert!(why(&engine, &plan_now, "env/rom/sh").is_none());
}

#[test]
fn two_environments_of_one_panorama_share_the_work() {
    let place = Place::new();
    place.build();
    let toml = fs::read_to_string(place.folder.path().join("kiln.toml")).unwrap();
    place.write(
        "kiln.toml",
        toml + "[env.hall]\nsource = \"./room.hdr\"\nsize = 8\nirradiance_size = 4\nbake = \"all\"\n",
    );
    let built = place.build();
    assert!(ran(&built).is_empty(), "{:?}", ran(&built));
    assert_eq!(built.targets["env/hall/specular"].parts, built.targets["env/room/specular"].parts);
}

/// Prints how long a build goes on after it is cancelled, wherever it is.
#[test]
fn cancelled_build_ends_soon_and_publishes_nothing() {
    let texel = |index: usize| 0.1 + (index * 7919 % 1000) as f32 * 0.01;
    let image = Image::new(1024, 512, (0..1024 * 512 * 3).map(texel).collect()).unwrap();
    let panorama = kiln_image::hdr::encode(&image);
    let mut latencies = Vec::new();
    let mut duration = std::time::Duration::from_secs(1);
    for moment in 0..=10 {
        let place = Place::new();
        place.write("room.hdr", &panorama);
        place.edit("kiln.toml", "size = 8\nirradiance_size = 4", "size = 256\nirradiance_size = 64");
        let engine = place.engine();
        let cancel = AtomicBool::new(false);
        let start = std::time::Instant::now();
        let (built, latency) = std::thread::scope(|scope| {
            let building = scope.spawn(|| {
                let built = build(&engine, None, &options(&cancel)).unwrap();
                (built, std::time::Instant::now())
            });
            // The first build is left alone and says how long one takes.
            while moment > 0 && start.elapsed() < duration.mul_f64((f64::from(moment) - 0.5) / 10.0) {
                std::thread::yield_now();
            }
            let cancelled = std::time::Instant::now();
            if moment > 0 {
                cancel.store(true, std::sync::atomic::Ordering::SeqCst);
            }
            let (built, ended) = building.join().unwrap();
            (built, ended.saturating_duration_since(cancelled))
        });
        if moment == 0 {
            duration = start.elapsed();
            assert!(built.is_some());
        } else if built.is_none() {
            assert!(place.engine().published().is_empty());
            latencies.push(latency.as_secs_f64() * 1e3);
        }
    }
    assert!(!latencies.is_empty());
    latencies.sort_by(f64::total_cmp);
    println!(
        "{} builds of a 1024×512 panorama cancelled: ended after p50 {:.1} ms, at most {:.1} ms",
        latencies.len(),
        latencies[latencies.len() / 2],
        latencies[latencies.len() - 1]
    );
}

#[test]
fn comment_edit_recompiles_but_changes_no_target() {
    let place = Place::new();
    let before = place.build().targets;
    place.edit("lib/tint.wgsl", "fn tint", "// the house colour\nfn tint");
    let built = place.build();
    assert_eq!(ran(&built).len(), 2);
    assert_eq!(built.targets, before);
}

#[test]
fn missing_files_are_named_and_their_appearance_rebuilds() {
    let place = Place::new();
    let files = ["room.hdr", "quad.bin", "flat.wgsl"];
    let kept: Vec<Vec<u8>> = files.map(|file| fs::read(place.folder.path().join(file)).unwrap()).into();
    files.iter().for_each(|file| fs::remove_file(place.folder.path().join(file)).unwrap());
    let built = place.build();
    let text: String = errors(&built).iter().map(|error| error.to_string() + "\n").collect();
    assert!(files.iter().all(|file| text.contains(file)), "{text}");
    files.iter().zip(kept).for_each(|(file, bytes)| place.write(file, bytes));
    let built = place.build();
    assert!(errors(&built).is_empty());
    assert!(built.targets.values().all(|target| target.state == TargetState::Fresh));
}
