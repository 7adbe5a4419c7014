use std::fs;
use std::sync::atomic::AtomicBool;

use kiln_build::{Engine, Reason, RunOptions, Status, Store, TargetState, Targets};
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_image::{Image, ktx2};

use crate::*;

mod add;
mod config;
mod demand;
mod edits;
mod effects;
mod outputs;
mod outside;
mod settle;
mod wishes;
mod write_back;

const TOML: &str = r#"version = 1
[project]
name = "test"
[env.room]
source = "room.hdr"
size = 8
irradiance_size = 4
bake = "all"
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
        "env/room/accuracy",
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
fn steps_of_an_environment_state_what_memory_they_need() {
    let place = Place::new();
    let plan = plan(&place.engine(), None).unwrap();
    let needs = |kind: &str, input_bytes: u64| {
        let actions = plan.graph.iter().filter(|(_, action)| action.command.kind == kind);
        let needs: Vec<u64> = actions.map(|(_, action)| (action.memory)(&[input_bytes, 100])).collect();
        assert!(!needs.is_empty(), "{kind}");
        needs.into_iter().min().unwrap()
    };
    // A panorama of 4096 × 2048 texels, as a file and decoded.
    let panorama = 4096 * 2048 * 12;
    assert!(needs("decode", panorama / 3) > panorama);
    for kind in ["analyse", "skybox"] {
        assert!(needs(kind, panorama) > 2 * panorama, "{kind}");
    }
    assert!(needs("prefilter", 1 << 20) > 2 << 20);
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
fn broken_scene_keeps_its_shader_variants() {
    let place = Place::new();
    place.build();
    place.write("quad.gltf", "{ not json");
    let built = place.build();
    assert_eq!(errors(&built).len(), 1, "{:?}", built.diagnostics);
    assert_eq!(built.targets["scene/quad"].state, TargetState::Stale);
    // What the scene called for while it could be read is still asked for.
    assert_eq!(built.targets["shader/flat/unlit"].state, TargetState::Fresh);
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
fn equal_builds_give_equal_targets_in_fresh_stores() {
    assert_eq!(Place::new().build().targets, Place::new().build().targets);
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
