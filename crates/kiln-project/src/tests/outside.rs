//! Files outside the project's folder, and files that several scenes share.

use super::*;

const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const OTHER_CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0];

/// A project in `home/look`, whose scene has its buffer in `home/library`.
struct Home {
    place: Place,
    cache: tempfile::TempDir,
}

impl Home {
    fn new(allowed: &[&str], uri: &str) -> Home {
        let home = Home { place: Place::new(), cache: tempfile::tempdir().unwrap() };
        let allow = format!("[project]\nallow_folders = {allowed:?}\n");
        home.write("look/kiln.toml", TOML.replace("[project]\n", &allow));
        for file in ["room.hdr", "flat.wgsl", "lib/tint.wgsl"] {
            let content = fs::read(home.path(file)).unwrap();
            home.write(&format!("look/{file}"), content);
        }
        home.write("look/quad.gltf", SCENE.replace("quad.bin", uri));
        home.write("library/quad.bin", CORNERS.map(f32::to_le_bytes).as_flattened());
        home
    }

    fn path(&self, path: &str) -> std::path::PathBuf {
        self.place.folder.path().join(path)
    }

    fn write(&self, path: &str, content: impl AsRef<[u8]>) {
        self.place.write(path, content);
    }

    fn build(&self) -> Built {
        let engine = Engine::open(&self.path("look"), Store::open(self.cache.path()).unwrap()).unwrap();
        let cancel = AtomicBool::new(false);
        let built = build(&engine, None, &options(&cancel)).unwrap().unwrap();
        write_outputs(&engine, &built.targets, "baked").unwrap();
        engine.save_memory().unwrap();
        built
    }
}

#[track_caller]
fn refusal(built: &Built) -> String {
    assert!(!built.targets.contains_key("scene/quad"), "it was packed");
    errors(built).iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn file_of_an_allowed_folder_is_read_and_an_edit_of_it_packs_the_scene_again() {
    let home = Home::new(&["../library"], "../library/quad.bin");
    let built = home.build();
    assert!(errors(&built).is_empty(), "{:?}", built.diagnostics);
    assert!(ran(&home.build()).is_empty());
    home.write("library/quad.bin", OTHER_CORNERS.map(f32::to_le_bytes).as_flattened());
    assert_eq!(ran(&home.build()), ["pack scene/quad"]);
}

#[test]
fn folder_that_is_not_allowed_is_refused_until_it_is() {
    let home = Home::new(&["../elsewhere"], "../library/quad.bin");
    let said = refusal(&home.build());
    assert!(said.contains("leaves the project"), "{said}");
    assert!(said.contains("allow_folders = [\"../library\"]"), "{said}");
    let toml = fs::read_to_string(home.path("look/kiln.toml")).unwrap();
    home.write("look/kiln.toml", toml.replace("../elsewhere", "../library"));
    assert!(home.build().targets.contains_key("scene/quad"));
}

#[test]
fn ways_out_of_an_allowed_folder_are_refused() {
    for uri in ["../library/../secret.bin", "../library/%2e%2e/secret.bin", "../library/..%2Fsecret.bin"] {
        let home = Home::new(&["../library"], uri);
        home.write("secret.bin", CORNERS.map(f32::to_le_bytes).as_flattened());
        let said = refusal(&home.build());
        assert!(said.contains("leaves the project"), "{uri}: {said}");
    }
}

#[test]
fn absolute_folder_allows_file_uris_and_the_manifest_does_not_name_it() {
    let home = Home::new(&[], "");
    let library = home.path("library").canonicalize().unwrap();
    let library = library.to_str().unwrap();
    let toml = fs::read_to_string(home.path("look/kiln.toml")).unwrap();
    home.write(
        "look/kiln.toml",
        toml.replace("allow_folders = []", &format!("allow_folders = [{library:?}]")),
    );
    home.write("look/quad.gltf", SCENE.replace("quad.bin", &format!("file://{library}/quad.bin")));
    let built = home.build();
    assert!(errors(&built).is_empty(), "{:?}", built.diagnostics);
    let manifest = fs::read_to_string(home.path("look/baked/manifest.json")).unwrap();
    assert!(manifest.contains("scene/quad") && !manifest.contains(library), "{manifest}");
}

#[cfg(unix)]
#[test]
fn link_out_of_an_allowed_folder_is_not_followed_and_one_within_is() {
    use std::os::unix::fs::symlink;
    let home = Home::new(&["../library"], "../library/link.bin");
    home.write("secret.bin", CORNERS.map(f32::to_le_bytes).as_flattened());
    symlink(home.path("secret.bin"), home.path("library/link.bin")).unwrap();
    let said = refusal(&home.build());
    assert!(said.contains("link that leads out"), "{said}");
    fs::remove_file(home.path("library/link.bin")).unwrap();
    // The same content at a place that may be read.
    symlink(home.path("library/quad.bin"), home.path("library/link.bin")).unwrap();
    let built = home.build();
    assert!(built.targets.contains_key("scene/quad"), "{:?}", built.diagnostics);
    // A folder that is a link is one, too.
    let home = Home::new(&["../library"], "../library/deep/secret.bin");
    home.write("vault/secret.bin", CORNERS.map(f32::to_le_bytes).as_flattened());
    symlink(home.path("vault"), home.path("library/deep")).unwrap();
    assert!(refusal(&home.build()).contains("link that leads out"));
}

#[test]
fn verify_builds_the_same_from_files_of_an_allowed_folder() {
    let home = Home::new(&["../library"], "../library/quad.bin");
    home.build();
    let engine = Engine::open(&home.path("look"), Store::open(home.cache.path()).unwrap()).unwrap();
    let cancel = AtomicBool::new(false);
    let verified = verify(&engine, &["scene/quad".to_owned()], &options(&cancel)).unwrap();
    assert!(verified.mismatches.is_empty() && verified.outputs > 0, "{:?}", verified.mismatches);
}

#[test]
fn buffer_that_two_scenes_share_packs_both_again_and_no_third() {
    let place = Place::new();
    let toml = TOML.replace(
        "[shader.flat]",
        "[scene.twin]\nsource = \"twin.gltf\"\nenv = \"room\"\nshader = \"flat\"\n\
         [scene.other]\nsource = \"other.gltf\"\nenv = \"room\"\nshader = \"flat\"\n[shader.flat]",
    );
    place.write("kiln.toml", toml);
    place.write("twin.gltf", SCENE.replace("\"plain\"", "\"twin\""));
    place.write("other.gltf", SCENE.replace("quad.bin", "other.bin"));
    place.write("other.bin", CORNERS.map(f32::to_le_bytes).as_flattened());
    assert!(errors(&place.build()).is_empty());
    place.write("quad.bin", OTHER_CORNERS.map(f32::to_le_bytes).as_flattened());
    assert_eq!(ran(&place.build()), ["pack scene/quad", "pack scene/twin"]);
}

#[test]
fn specular_glossiness_form_is_a_parameter_of_the_pack_and_calls_for_its_variant() {
    let place = Place::new();
    let old = "{\"name\":\"plain\",\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":{\"specularFactor\":[1,0.5,0.1]}}}";
    place.write("quad.gltf", SCENE.replace("{\"name\":\"plain\"}", old));
    let variants = |built: &Built| -> Vec<String> {
        built.targets.keys().filter(|name| name.starts_with("shader/flat/")).cloned().collect()
    };
    let before = variants(&place.build());
    assert!(before.iter().all(|name| !name.contains("specular")), "{before:?}");
    place.edit(
        "kiln.toml",
        "source = \"quad.gltf\"",
        "source = \"quad.gltf\"\nspecular_glossiness = \"specular\"",
    );
    let built = place.build();
    assert!(ran(&built).contains(&"pack scene/quad".to_owned()));
    let after = variants(&built);
    assert!(after.iter().any(|name| name.contains("specular")), "{after:?}");
}
