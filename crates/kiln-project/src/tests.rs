use std::fs;
use std::sync::atomic::AtomicBool;

use kiln_build::{Engine, Reason, RunOptions, Status, Store, TargetState, Targets};
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_image::{Image, ktx2};

use crate::*;

const TOML: &str = r#"version = 1
[project]
name = "test"
[env.room]
source = "room.hdr"
size = 8
irradiance_size = 4
[scene.quad]
source = "quad.gltf"
env = "room"
shader = "flat"
[shader.flat]
source = "flat.wgsl"
"#;

const SHADER: &str = "
import lib::tint::tint;
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }
@fragment fn fs_main() -> @location(0) vec4f {
    @if(unlit) return vec4f(1.0);
    @else return vec4f(tint(), 1.0);
}
";

/// A triangle with one material of default values and one unlit one.
const SCENE: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0},{"attributes":{"POSITION":0},"material":1}]}],
"materials":[{"name":"plain"},{"name":"sign","extensions":{"KHR_materials_unlit":{}}}],
"extensionsUsed":["KHR_materials_unlit"],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"quad.bin","byteLength":36}]}"#;

struct Place {
    folder: tempfile::TempDir,
    cache: tempfile::TempDir,
}

impl Place {
    fn new() -> Place {
        let place = Place { folder: tempfile::tempdir().unwrap(), cache: tempfile::tempdir().unwrap() };
        place.write("kiln.toml", TOML);
        place.write("room.hdr", panorama(1.0));
        place.write("flat.wgsl", SHADER);
        place.write("lib/tint.wgsl", "fn tint() -> vec3f { return vec3f(1.0, 0.5, 0.25); }");
        place.write("quad.gltf", SCENE);
        let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        place.write("quad.bin", corners.map(f32::to_le_bytes).as_flattened());
        place
    }

    fn write(&self, path: &str, content: impl AsRef<[u8]>) {
        let path = self.folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn edit(&self, path: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.folder.path().join(path)).unwrap();
        assert!(text.contains(from), "{path} has no {from}");
        self.write(path, text.replace(from, to));
    }

    fn build(&self) -> Built {
        let engine = self.engine();
        let cancel = AtomicBool::new(false);
        let built = build(&engine, None, &options(&cancel)).unwrap().unwrap();
        engine.save_memory().unwrap();
        built
    }

    fn engine(&self) -> Engine {
        Engine::open(self.folder.path(), Store::open(self.cache.path()).unwrap()).unwrap()
    }

    fn write_outputs(&self, targets: &Targets) -> Written {
        write_outputs(&self.engine(), targets, "baked").unwrap()
    }
}

fn options(cancel: &AtomicBool) -> RunOptions<'_> {
    RunOptions { jobs: 2, memory_bytes: 1 << 30, keep_going: true, cancel, progress: &|_| {} }
}

fn panorama(value: f32) -> Vec<u8> {
    let texel = |index: usize| value * (0.25 + (index % 7) as f32 * 0.125);
    kiln_image::hdr::encode(&Image::new(16, 8, (0..16 * 8 * 3).map(texel).collect()).unwrap())
}

/// Names of the actions that ran, sorted.
fn ran(built: &Built) -> Vec<String> {
    let ended = built.report.ended.iter();
    let mut names: Vec<String> = ended.map(|id| built.plan.graph.action(*id).name.clone()).collect();
    names.sort();
    names
}

fn errors(built: &Built) -> Vec<&Diagnostic> {
    built.diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Error).collect()
}

#[test]
fn first_build_makes_every_target_and_the_second_runs_nothing() {
    let place = Place::new();
    let built = place.build();
    assert!(errors(&built).is_empty(), "{:?}", built.diagnostics);
    let names: Vec<&str> = built.targets.keys().map(String::as_str).collect();
    let expected = [
        "env/room/irradiance",
        "env/room/sh",
        "env/room/skybox",
        "env/room/specular",
        "lut/ggx",
        "project",
        "scene/quad",
        "shader/flat/base",
        "shader/flat/unlit",
    ];
    assert_eq!(names, expected);
    let again = place.build();
    assert!(
        again.report.outcomes.iter().all(|outcome| outcome.status == Status::Reused),
        "{:?}",
        ran(&again)
    );
    assert_eq!(again.targets, built.targets);
}

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
    assert_eq!(ran(&place.build()), ["irradiance env/room"]);
    place.write("room.hdr", panorama(2.0));
    let expected = [
        "analyse env/room",
        "decode env/room",
        "irradiance env/room",
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
    assert_eq!(ran(&place.build()).len(), 6);
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
    let found = why(&engine, &plan, "env/room/sh").unwrap().unwrap();
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
    let pending = why(&engine, &plan_now, "env/room/sh").unwrap().unwrap();
    assert!(pending[2].now.starts_with("would run now: room.hdr: "), "{}", pending[2].now);
    assert_eq!(ran(&place.build()), ["decode env/room"]);
    let engine = place.engine();
    let found = why(&engine, &plan_now, "env/room/sh").unwrap().unwrap();
    assert_eq!(found[1].cut_off_by.len(), 1, "{found:?}");
    assert_eq!(
        (found[1].cut_off_by[0].action.as_str(), found[1].cut_off_by[0].build),
        ("decode env/room", 3)
    );
    assert!(why(&engine, &plan_now, "env/rom/sh").unwrap().is_none());
}

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
    assert_eq!(manifest_of(engine.store(), &targets, &Manifest::default()).unwrap(), committed);
    place.edit("kiln.toml", "irradiance_size = 4", "irradiance_size = 2");
    let present = manifest_of(engine.store(), &place.build().targets, &committed).unwrap();
    let found = differences(&committed, &present);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].target.as_str(), found[0].kind), ("env/room/irradiance", DifferenceKind::Changed));
    assert!(found[0].details.contains(&"facts.size: 4 → 2".to_owned()), "{found:?}");
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
fn comment_edit_recompiles_but_changes_no_target() {
    let place = Place::new();
    let before = place.build().targets;
    place.edit("lib/tint.wgsl", "fn tint", "// the house colour\nfn tint");
    let built = place.build();
    assert_eq!(ran(&built).len(), 2);
    assert_eq!(built.targets, before);
}

#[test]
fn broken_shader_keeps_its_last_good_content_and_says_where() {
    let place = Place::new();
    let good = place.build().targets;
    place.edit("lib/tint.wgsl", "0.5", "half");
    let built = place.build();
    let error = errors(&built)[0];
    assert_eq!(error.file.as_deref(), Some("lib/tint.wgsl"));
    assert!(error.to_string().contains("return vec3f(1.0, half, 0.25)"), "{error}");
    let stale = &built.targets["shader/flat/base"];
    assert_eq!(stale.state, TargetState::Stale);
    assert_eq!(stale.parts, good["shader/flat/base"].parts);
    assert_eq!(built.targets["env/room/specular"].state, TargetState::Fresh);
    place.edit("lib/tint.wgsl", "half", "0.5");
    assert_eq!(place.build().targets, good);
}

#[test]
fn broken_environment_does_not_stop_the_rest() {
    let place = Place::new();
    place.write("room.hdr", "not a picture at all");
    let built = place.build();
    let error = errors(&built)[0];
    assert_eq!(error.file.as_deref(), Some("room.hdr"));
    assert_eq!(errors(&built).len(), 1);
    assert!(!built.targets.contains_key("env/room/specular"));
    assert_eq!(built.targets["shader/flat/base"].state, TargetState::Fresh);
    assert_eq!(built.targets["scene/quad"].state, TargetState::Fresh);
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

#[test]
fn broken_scene_keeps_its_shader_variants() {
    let place = Place::new();
    place.build();
    place.write("quad.gltf", "{ not json");
    let built = place.build();
    assert_eq!(errors(&built).len(), 1, "{:?}", built.diagnostics);
    for name in ["scene/quad", "shader/flat/unlit"] {
        assert_eq!(built.targets[name].state, TargetState::Stale, "{name}");
    }
}

#[test]
fn removed_section_takes_its_targets_away() {
    let place = Place::new();
    place.build();
    place.edit("kiln.toml", "[scene.quad]\nsource = \"quad.gltf\"\nenv = \"room\"\nshader = \"flat\"\n", "");
    let built = place.build();
    assert!(!built.targets.contains_key("scene/quad") && !built.targets.contains_key("shader/flat/unlit"));
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
fn wrong_project_files_are_explained() {
    let cases = [
        ("version = 2\n", "version 1", 1),
        ("[env.a]\nsource = \"a.hdr\"\n", "does not say its version", 1),
        ("version = 1\n[env.a]\nsouce = \"a.hdr\"\n", "did you mean `source`?", 3),
        ("version = 1\n[env.a]\nsize = 64\n", "[env.a] has no `source`", 2),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nsize = 100\n", "use 64 or 128", 4),
        ("version = 1\n[env.a]\nsource = 5\n", "must be a string", 3),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nerror = 0\n", "`error` in [env.a] must be from", 4),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nformat = \"rgba16\"\n", "did you mean `rgba16f`?", 4),
        ("version = 1\n[envs.a]\nsource = \"a.hdr\"\n", "did you mean `env`?", 2),
        (
            "version = 1\n[env.sky]\nsource = \"a\"\n[scene.s]\nsource = \"s\"\nenv = \"skyy\"\n[shader.pbr]\nsource = \"p\"\n",
            "did you mean `sky`?",
            6,
        ),
        ("version = 1\n[output]\ndir = \"../..\"\n", "folder inside the project", 3),
        ("version = 1\n[output]\ndir = \"/etc\"\n", "folder inside the project", 3),
        ("version = 1\n[output]\ndir = \".\"\n", "folder inside the project", 3),
        ("version = 1\n[check]\nmax_bytes = \"64 MXB\"\n", "which is no size", 3),
        ("version = 1\n[env.a\nsource = \"a.hdr\"\n", "", 2),
        ("version = 1\n[env.\"a/b\"]\nsource = \"a.hdr\"\n", "letters, digits", 2),
    ];
    for (text, expected, line) in cases {
        let (_, diagnostics) = parse_project(text);
        let found = diagnostics.iter().find(|diagnostic| {
            diagnostic.to_string().contains(expected)
                && diagnostic.span.as_ref().is_some_and(|span| span.line == line)
        });
        assert!(found.is_some(), "{text}\nwanted {expected:?} in line {line}, got {diagnostics:#?}");
    }
    assert_eq!(
        parse_project("version = 1\n[env.a]\nsouce = \"a.hdr\"\n").1.len(),
        1,
        "one fault, one message"
    );
    assert!(parse_project(TOML).1.is_empty());
}

#[test]
fn section_with_an_error_is_left_out_and_the_others_are_used() {
    let text = "version = 1\n[env.a]\nsource = \"a.hdr\"\n[env.b]\nsource = \"b.hdr\"\nsizes = 4\n";
    let (project, diagnostics) = parse_project(text);
    assert_eq!(project.envs.keys().collect::<Vec<_>>(), ["a"]);
    assert_eq!(diagnostics.len(), 1);
}

#[test]
fn equal_builds_give_equal_targets_in_fresh_stores() {
    assert_eq!(Place::new().build().targets, Place::new().build().targets);
}

#[test]
fn each_texture_states_its_own_size() {
    let targets = Place::new().build().targets;
    for (name, size, levels) in [("skybox", 16, 5), ("irradiance", 4, 1), ("specular", 8, 2)] {
        let meta = &targets[&format!("env/room/{name}")].meta;
        assert_eq!((meta["size"].as_u64(), meta["levels"].as_u64()), (Some(size), Some(levels)), "{name}");
    }
}

/// The last level of every chain is the same map, so both share its action's result.
#[test]
fn smaller_chain_of_a_uniform_environment_is_complete() {
    let place = Place::new();
    let grey = Image::new(16, 8, vec![0.5; 16 * 8 * 3]).unwrap();
    place.write("room.hdr", kiln_image::hdr::encode(&grey));
    place.build();
    place.edit("kiln.toml", "size = 8\n", "size = 16\n");
    let larger = place.build().targets["env/room/specular"].clone();
    assert_eq!((larger.parts.len(), larger.state), (3, TargetState::Fresh));
    place.edit("kiln.toml", "size = 16\n", "size = 8\n");
    let smaller = place.build().targets["env/room/specular"].clone();
    assert_eq!((smaller.parts.len(), smaller.state), (2, TargetState::Fresh));
    assert_eq!(smaller.parts[1].name, "mip1");
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

#[cfg(unix)]
#[test]
fn source_that_is_no_file_is_refused_and_blocks_nothing() {
    let place = Place::new();
    place.edit("kiln.toml", "source = \"flat.wgsl\"", "source = \"endless.wgsl\"");
    std::os::unix::fs::symlink("/dev/zero", place.folder.path().join("endless.wgsl")).unwrap();
    let built = place.build();
    let text: String = errors(&built).iter().map(|error| error.to_string()).collect();
    assert!(text.contains("endless.wgsl") && text.contains("it is not a file"), "{text}");
}

#[test]
fn sizes_are_read_with_their_units() {
    let cases = [
        ("200000", Some(200_000)),
        ("64 MiB", Some(64 << 20)),
        ("1.5GB", Some(1_500_000_000)),
        ("2K", Some(2048)),
    ];
    for (text, expected) in cases {
        assert_eq!(parse_bytes(text), expected, "{text}");
    }
    for wrong in ["", "MiB", "-1", "1 mile", "1e400", "99999999999 GiB"] {
        assert_eq!(parse_bytes(wrong), None, "{wrong}");
    }
    assert_eq!(parse_project("version = 1\n[check]\nmax_bytes = \"2 KiB\"\n").0.bytes_max, Some(2048));
    assert_eq!(parse_project("version = 1\n[check]\nmax_bytes = 4096\n").0.bytes_max, Some(4096));
}
