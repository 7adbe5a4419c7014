//! Whole daemons that change their sources for clients.

use std::fs;
use std::path::Path;

use kiln_link::{Answer, Ask, ParameterWrite, RevisionTable, ask};

use super::LIMIT;
use super::live::{Running, hdr};

const SHADER: &str = "
struct Params { wetness: f32, // @slider(0, 1, 0.25)
}
override samples: u32 = 16u; // @slider(1, 64)
@group(3) @binding(0) var<uniform> params: Params;
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }
@fragment fn fs_main() -> @location(0) vec4f { return vec4f(params.wetness * f32(samples)); }
";

/// A daemon on a project with a shader that has parameters.
fn start() -> Running {
    Running::start(None, |folder: &Path| {
        let project = folder.join("project");
        fs::write(project.join("sky.hdr"), hdr(90)).unwrap();
        fs::write(project.join("flat.wgsl"), SHADER).unwrap();
        let text = fs::read_to_string(project.join("kiln.toml")).unwrap();
        fs::write(project.join("kiln.toml"), text + "[shader.flat]\nsource = \"flat.wgsl\"\n").unwrap();
    })
}

fn write(running: &Running, name: &str, value: f64) -> Answer {
    let (shader, name) = ("flat".to_owned(), name.to_owned());
    let parameters = vec![ParameterWrite { shader, name, value: vec![value] }];
    ask(&running.socket, Ask::WriteParameters { parameters }, LIMIT).unwrap()
}

fn shader_text(running: &Running) -> String {
    fs::read_to_string(running.path("project/flat.wgsl")).unwrap()
}

fn has(table: &RevisionTable, group: &str) -> bool {
    table.targets.keys().any(|name| name.starts_with(group))
}

#[test]
fn written_value_is_published_without_any_other_edit() {
    let running = start();
    let answer = write(&running, "wetness", 0.5);
    assert!(answer.is_done(), "{answer:?}");
    assert_eq!(answer.message, "wrote flat.wgsl");
    let table = running.published();
    assert_eq!(table.work.changed_files, ["flat.wgsl"]);
    assert_eq!(shader_text(&running), SHADER.replace("0.25", "0.5"));
}

#[test]
fn values_one_after_the_other_do_not_wait_for_the_build_between_them() {
    let running = start();
    for step in 1..=20 {
        let answer = write(&running, "samples", f64::from(step));
        assert!(answer.is_done(), "{answer:?}");
    }
    assert_eq!(shader_text(&running), SHADER.replace("16u", "20u"));
}

#[test]
fn refused_value_leaves_the_file_and_the_daemon_as_they_were() {
    let running = start();
    let answer = write(&running, "wetness", 1.5);
    assert!(!answer.is_done());
    assert_eq!(answer.diagnostics[0].message, "`wetness` cannot be 1.5: it is an f32 from 0 to 1");
    assert_eq!(shader_text(&running), SHADER);
    let unknown = ask(&running.socket, Ask::Unknown, LIMIT).unwrap();
    assert!(unknown.diagnostics[0].message.contains("does not know"), "{unknown:?}");
    let relative = Ask::AddFiles { paths: vec!["sky.hdr".to_owned()] };
    let answer = ask(&running.socket, relative, LIMIT).unwrap();
    assert_eq!(answer.diagnostics[0].message, "`sky.hdr` is no absolute path");
    assert!(write(&running, "wetness", 0.75).is_done());
}

#[test]
fn added_panorama_is_published_under_its_name() {
    let running = start();
    let outside = tempfile::tempdir().unwrap();
    let path = outside.path().join("dusk.hdr");
    fs::write(&path, hdr(60)).unwrap();
    let paths = vec![path.to_str().unwrap().to_owned(), outside.path().to_str().unwrap().to_owned()];
    let answer = ask(&running.socket, Ask::AddFiles { paths }, LIMIT).unwrap();
    assert_eq!(answer.targets, ["env/dusk"]);
    assert!(!answer.is_done() && answer.diagnostics[0].message.contains("is a folder"), "{answer:?}");
    while !has(&running.published(), "env/dusk/") {}
    assert!(running.path("project/environments/dusk.hdr").is_file());
}
