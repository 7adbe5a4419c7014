//! Files for engines, the manifest, verification.

use super::*;

#[test]
fn verification_passes_on_what_was_built_and_fails_on_what_was_not() {
    let place = Place::new();
    let built = place.build();
    let targets: Vec<String> = built.targets.keys().cloned().collect();
    let cancel = AtomicBool::new(false);
    let verified = verify(&place.engine(), &targets, &options(&cancel)).unwrap();
    assert!(verified.mismatches.is_empty(), "{verified:?}");
    assert_eq!(verified.actions, built.plan.graph.len());

    // A store that somebody changed, digests and all: its bytes are not what the sources give.
    let engine = place.engine();
    let stored = &built.targets["lut/ggx"].parts[0];
    let (record, _) = engine.history("integrate lut/ggx").unwrap();
    let forged = [0_u8; 8];
    let mut record = (*record).clone();
    record.result.outputs[0].digest = engine.store().put(&forged).unwrap();
    record.result.outputs[0].bytes = 8;
    engine.store().put_result(&record, &[forged.to_vec().into()]).unwrap();
    fs::remove_dir_all(place.cache.path().join("v2/projects")).unwrap();
    let verified = verify(&place.engine(), &["lut/ggx".to_owned()], &options(&cancel)).unwrap();
    assert_eq!(verified.mismatches.len(), 1);
    assert_eq!(verified.mismatches[0].fresh, Some(stored.digest));

    // A flipped bit under the right name.
    let built = place.build();
    let digest = built.targets["env/room/sh"].parts[0].digest.to_string();
    let path = place.cache.path().join("v2/cas").join(&digest[..2]).join(&digest);
    let mut bytes = fs::read(&path).unwrap();
    bytes[0] ^= 1;
    fs::write(&path, bytes).unwrap();
    let verified = verify(&place.engine(), &["env/room/sh".to_owned()], &options(&cancel)).unwrap();
    assert_eq!((verified.mismatches.len(), verified.mismatches[0].stored), (1, None));

    place.edit("lib/tint.wgsl", "0.25", "0.75");
    let outdated = verify(&place.engine(), &["shader/flat/base".to_owned()], &options(&cancel));
    assert!(matches!(outdated, Err(VerifyError::OutOfDate(_))));
}

#[test]
fn manifest_without_baking_equals_the_written_one_and_shows_each_edit() {
    let place = Place::new();
    let targets = place.build().targets;
    let committed = place.write_outputs(&targets).manifest;
    let engine = place.engine();
    assert_eq!(manifest_of(&engine, &targets).unwrap(), committed);
    place.edit("kiln.toml", "irradiance_size = 4", "irradiance_size = 2");
    let present = manifest_of(&place.engine(), &place.build().targets).unwrap();
    let found = differences(&committed, &present);
    let changed: Vec<_> = found.iter().map(|found| (found.target.as_str(), found.kind)).collect();
    let of = |target| (target, DifferenceKind::Changed);
    assert_eq!(changed, [of("env/room/accuracy"), of("env/room/irradiance")], "{found:?}");
    assert!(found[1].details.contains(&"facts.size: 4 → 2".to_owned()), "{found:?}");
}

#[test]
fn output_file_that_somebody_changed_is_written_again() {
    let place = Place::new();
    let targets = place.build().targets;
    place.write_outputs(&targets);
    let path = place.folder.path().join("baked/lut/ggx.ktx2");
    let good = fs::read(&path).unwrap();
    let mut bytes = good.clone();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&path, bytes).unwrap();
    assert_eq!(place.write_outputs(&targets).written, ["lut/ggx.ktx2"]);
    assert_eq!(fs::read(&path).unwrap(), good);
}

#[test]
fn forged_manifest_is_seen_by_the_check_and_mended_by_the_bake() {
    let place = Place::new();
    let targets = place.build().targets;
    let good = place.write_outputs(&targets).manifest;
    let forgeries: [fn(&mut Manifest); 3] = [
        |manifest| manifest.targets.get_mut("lut/ggx").unwrap().files.clear(),
        |manifest| {
            manifest.targets.get_mut("lut/ggx").unwrap().files.values_mut().for_each(|file| file.bytes = 1);
        },
        |manifest| manifest.writer = 0,
    ];
    for forge in forgeries {
        let mut forged = good.clone();
        forge(&mut forged);
        let path = place.folder.path().join("baked/manifest.json");
        fs::write(&path, serde_json::to_vec(&forged).unwrap()).unwrap();
        let present = manifest_of(&place.engine(), &targets).unwrap();
        assert_eq!(differences(&forged, &present).len(), 1);
        place.write_outputs(&targets);
        assert_eq!(Manifest::parse(&fs::read(&path).unwrap()).unwrap(), good);
    }
}

#[test]
fn damaged_last_good_content_is_given_up_and_the_build_ends() {
    let place = Place::new();
    place.build();
    place.edit("lib/tint.wgsl", "0.5", "half");
    let stale = place.build().targets["shader/flat/base"].clone();
    assert_eq!(stale.state, TargetState::Stale);
    let digest = stale.parts[0].digest.to_string();
    let path = place.cache.path().join("v2/cas").join(&digest[..2]).join(&digest);
    let length = fs::metadata(&path).unwrap().len();
    fs::write(&path, vec![b'x'; usize::try_from(length).unwrap()]).unwrap();
    let engine = place.engine();
    let cancel = AtomicBool::new(false);
    let first = build(&engine, None, &options(&cancel)).unwrap().unwrap();
    assert!(write_outputs(&engine, &first.targets, "baked").is_err(), "the damage is found when it is read");
    let second = build(&engine, None, &options(&cancel)).unwrap().unwrap();
    assert!(!second.targets.contains_key("shader/flat/base"));
    write_outputs(&engine, &second.targets, "baked").unwrap();
}

#[test]
fn outputs_are_written_once_and_follow_the_targets() {
    let place = Place::new();
    let targets = place.build().targets;
    let written = place.write_outputs(&targets);
    assert!(written.written.contains(&"env/room/specular.ktx2".to_owned()), "{written:?}");
    assert!(place.write_outputs(&targets).written.is_empty());
    let texture = fs::read(place.folder.path().join("baked/env/room/specular.ktx2")).unwrap();
    let texture = ktx2::read(&texture).unwrap();
    assert_eq!((texture.faces, texture.levels.len(), texture.width), (6, 2, 8));
    fs::remove_file(place.folder.path().join("baked/lut/ggx.ktx2")).unwrap();
    assert_eq!(place.write_outputs(&targets).written, ["lut/ggx.ktx2"]);
    let mut fewer = (*targets).clone();
    fewer.remove("scene/quad");
    let written = place.write_outputs(&fewer);
    assert_eq!(written.removed, ["scene/quad.effects.json", "scene/quad.glb"]);
    assert!(!place.folder.path().join("baked/scene/quad.glb").exists());
}

#[test]
fn manifest_does_not_depend_on_where_the_project_is() {
    let manifests: Vec<Vec<u8>> = (0..2)
        .map(|_| {
            let place = Place::new();
            place.write_outputs(&place.build().targets);
            fs::read(place.folder.path().join("baked/manifest.json")).unwrap()
        })
        .collect();
    assert_eq!(manifests[0], manifests[1]);
}

#[test]
fn each_texture_states_its_own_size() {
    let targets = Place::new().build().targets;
    for (name, size, levels) in [("skybox", 16, 5), ("irradiance", 4, 1), ("specular", 8, 2)] {
        let meta = &targets[&format!("env/room/{name}")].meta;
        assert_eq!((meta["size"].as_u64(), meta["levels"].as_u64()), (Some(size), Some(levels)), "{name}");
    }
}

#[test]
fn every_flipped_bit_in_the_store_is_healed_by_the_next_build_and_write() {
    let place = Place::new();
    let good = place.build().targets;
    for folder in fs::read_dir(place.cache.path().join("v2/cas")).unwrap() {
        for blob in fs::read_dir(folder.unwrap().path()).unwrap() {
            let path = blob.unwrap().path();
            let mut bytes = fs::read(&path).unwrap();
            bytes[0] ^= 1;
            fs::write(&path, bytes).unwrap();
        }
    }
    for _ in 0..64 {
        let targets = place.build().targets;
        if write_outputs(&place.engine(), &targets, "baked").is_ok() {
            assert_eq!(targets, good);
            return;
        }
    }
    panic!("the store did not heal");
}

#[test]
fn folder_of_maps_is_written_by_one_at_a_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("maps");
    let lock = lock_folder(&out).expect("locked");
    let is_free = || fs::File::open(&out).expect("made by the lock").try_lock().is_ok();
    assert!(!is_free(), "a second writer would mix its files with ours");
    drop(lock);
    assert!(is_free());
}
