//! Files that somebody brings to a project.

use std::path::{Path, PathBuf};

use super::*;

struct Brought {
    place: Place,
    outside: tempfile::TempDir,
}

impl Brought {
    fn new() -> Brought {
        Brought { place: Place::new(), outside: tempfile::tempdir().unwrap() }
    }

    /// A file outside of the project.
    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.outside.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        path
    }

    fn add(&self, paths: &[&Path]) -> Added {
        let paths: Vec<PathBuf> = paths.iter().map(|path| path.to_path_buf()).collect();
        add_files(self.place.folder.path(), &paths)
    }

    fn toml(&self) -> String {
        fs::read_to_string(self.place.folder.path().join("kiln.toml")).unwrap()
    }

    fn has(&self, path: &str) -> bool {
        self.place.folder.path().join(path).exists()
    }

    /// Every file of the project.
    fn files(&self) -> Vec<PathBuf> {
        let mut folders = vec![self.place.folder.path().to_owned()];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        files
    }

    /// Brings a file that must be refused for this reason, with the project as it was.
    #[track_caller]
    fn check_refused(&self, path: &Path, reason: &str) {
        let before = (self.toml(), self.files());
        let added = self.add(&[path]);
        assert!(added.targets.is_empty() && added.refused.len() == 1, "{added:?}");
        let said = added.refused[0].to_string();
        assert!(said.contains(reason), "{said}");
        assert_eq!((self.toml(), self.files()), before);
    }
}

#[test]
fn panorama_is_copied_and_named_and_builds() {
    let brought = Brought::new();
    let sky = brought.file("Evening sky (4k).hdr", panorama(2.0));
    let added = brought.add(&[&sky]);
    assert_eq!(added.targets, ["env/Evening_sky_4k"]);
    assert_eq!(added.messages, ["added environment `Evening_sky_4k`: environments/Evening_sky_4k.hdr"]);
    let section = "\n[env.Evening_sky_4k]\nsource = \"environments/Evening_sky_4k.hdr\"\n";
    assert_eq!(brought.toml(), format!("{TOML}{section}"));
    let built = brought.place.build();
    assert!(built.diagnostics.is_empty(), "{:?}", built.diagnostics);
    assert!(built.targets.keys().any(|target| target.starts_with("env/Evening_sky_4k/")));
}

#[test]
fn name_that_is_taken_gets_a_number_and_the_same_file_twice_is_one() {
    let brought = Brought::new();
    let room = brought.file("room.hdr", panorama(2.0));
    assert_eq!(brought.add(&[&room]).targets, ["env/room-2"]);
    assert!(brought.has("environments/room.hdr"));
    let other = brought.file("other/room.hdr", panorama(3.0));
    assert_eq!(brought.add(&[&other]).targets, ["env/room-3"]);
    assert!(brought.has("environments/room-2.hdr"));
    let before = brought.files();
    brought.add(&[&room]);
    assert_eq!(brought.files(), before, "its copy is there already");
}

#[test]
fn scene_comes_with_what_it_refers_to_and_is_drawn_under_what_is_there() {
    let brought = Brought::new();
    let scene = brought.file("car/car.gltf", SCENE.replace("quad.bin", "parts/my%20quad.bin"));
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    brought.file("car/parts/my quad.bin", corners.map(f32::to_le_bytes).as_flattened());
    brought.file("car/unrelated.txt", "not ours");
    let added = brought.add(&[&scene]);
    assert_eq!(added.targets, ["scene/car"], "{added:?}");
    assert!(brought.has("scenes/car/parts/my quad.bin") && !brought.has("scenes/car/unrelated.txt"));
    assert!(
        brought.toml().ends_with(
            "\n[scene.car]\nsource = \"scenes/car/car.gltf\"\nenv = \"room\"\nshader = \"flat\"\n"
        )
    );
    let built = brought.place.build();
    assert!(built.diagnostics.is_empty(), "{:?}", built.diagnostics);
    assert_eq!(brought.add(&[&scene]).targets, ["scene/car-2"]);
    assert!(brought.has("scenes/car-2/parts/my quad.bin"));
}

#[test]
fn file_of_the_project_is_named_where_it_is_and_one_that_is_named_stays() {
    let brought = Brought::new();
    brought.place.write("skies/dusk.hdr", panorama(2.0));
    let folder = brought.place.folder.path().to_owned();
    let before = brought.files();
    assert_eq!(brought.add(&[&folder.join("skies/dusk.hdr")]).targets, ["env/dusk"]);
    assert!(brought.toml().ends_with("source = \"skies/dusk.hdr\"\n"));
    let toml = brought.toml();
    let again = brought.add(&[&folder.join("skies/dusk.hdr"), &folder.join("quad.gltf")]);
    assert_eq!(again.targets, ["env/dusk", "scene/quad"]);
    assert_eq!(again.messages[1], "quad.gltf is scene `quad` already");
    assert_eq!((brought.toml(), brought.files()), (toml, before));
    fs::create_dir(folder.join("baked")).unwrap();
    brought.place.write("baked/x.hdr", panorama(1.0));
    brought.check_refused(&folder.join("baked/x.hdr"), "lies in `baked`, whose files Kiln overwrites");
}

#[test]
fn everything_in_the_project_file_stays_as_it_was() {
    let brought = Brought::new();
    let sky = brought.file("sky.hdr", panorama(2.0));
    for (text, newline) in [
        (format!("# first\r\n{}\r\n# last, without an end", TOML.replace('\n', "\r\n")), "\r\n"),
        (format!("{TOML}[check] # budget\nmax_bytes = \"1 GiB\""), "\n"),
        (format!("{TOML}\n\n\n"), "\n"),
    ] {
        brought.place.write("kiln.toml", &text);
        assert_eq!(brought.add(&[&sky]).targets, ["env/sky"]);
        let toml = brought.toml();
        let rest = toml.strip_prefix(&text).expect("what was there is there");
        assert_eq!(
            rest.trim_start(),
            format!("[env.sky]{newline}source = \"environments/sky.hdr\"{newline}")
        );
    }
}

#[test]
fn project_file_that_takes_no_table_or_has_an_error_stays() {
    let brought = Brought::new();
    let sky = brought.file("sky.hdr", panorama(2.0));
    let inline = "version = 1\nenv = { room = { source = \"room.hdr\" } }\n";
    brought.place.write("kiln.toml", inline);
    brought.check_refused(&sky, "kiln.toml takes no `[env.sky]` at its end");
    brought.place.write("kiln.toml", format!("{TOML}\ntext = '''never closed"));
    brought.check_refused(&sky, "kiln.toml takes nothing new while this is wrong");
    brought.place.write(
        "kiln.toml",
        TOML.replace("[shader.flat]\nsource = \"flat.wgsl\"\n", "")
            .replace("shader = \"flat\"\n", "shader = \"none\"\n"),
    );
    brought.check_refused(&sky, "there is no [shader.none]");
}

#[test]
fn what_is_no_environment_and_no_scene_is_refused_by_name() {
    let brought = Brought::new();
    let folder = brought.outside.path().to_owned();
    brought.check_refused(&folder, "is a folder; it was not added");
    brought.check_refused(&folder.join("gone.hdr"), "gone.hdr is not there");
    brought.check_refused(&brought.file("notes.txt", "hello"), "is neither an environment nor a scene");
    brought.check_refused(
        &brought.file("film.hdr", "\0\0\0 ftypmp42"),
        "does not hold what .hdr files begin with",
    );
    brought.check_refused(&brought.file("empty.exr", ""), "does not hold what .exr files begin with");
    brought.check_refused(&brought.file("bad.gltf", "{\"asset\":"), "was not added");
    brought.check_refused(&brought.file("lost.gltf", SCENE), "refers to `quad.bin`, which is no file");
    brought.check_refused(
        &brought.file("a/out.gltf", SCENE.replace("quad.bin", "../quad.bin")),
        "leaves the project",
    );
    brought
        .check_refused(&brought.file("abs.gltf", SCENE.replace("quad.bin", "/etc/passwd")), "absolute path");
    #[cfg(unix)]
    brought.check_refused(Path::new("/dev/zero"), "is no ordinary file");
    let huge = brought.file("huge.hdr", "#?RADIANCE\n");
    fs::File::options().write(true).open(&huge).unwrap().set_len(10 << 30).unwrap();
    brought.check_refused(&huge, "has 10.0 GiB; files of up to 4 GiB are taken");
}

#[test]
fn wrong_file_keeps_no_other_out() {
    let brought = Brought::new();
    let (sky, notes) = (brought.file("sky.hdr", panorama(2.0)), brought.file("notes.txt", "hello"));
    let lost = brought.file("lost.gltf", SCENE);
    let added = brought.add(&[&lost, &notes, &sky]);
    assert_eq!((added.targets, added.refused.len()), (vec!["env/sky".to_owned()], 2));
    assert!(!brought.has("scenes"), "what was refused leaves nothing");
}

#[test]
fn scene_without_an_environment_in_the_project_needs_one_that_comes_with_it() {
    let brought = Brought::new();
    let shader = &TOML[TOML.find("[shader.flat]").unwrap()..];
    brought.place.write("kiln.toml", format!("version = 1\n{shader}"));
    let corners = [0.0_f32; 9];
    brought.file("quad.bin", corners.map(f32::to_le_bytes).as_flattened());
    let (scene, sky) = (brought.file("quad.gltf", SCENE), brought.file("sky.hdr", panorama(2.0)));
    brought.check_refused(&scene, "a scene needs an environment");
    assert_eq!(brought.add(&[&scene, &sky]).targets, ["env/sky", "scene/quad"]);
}
