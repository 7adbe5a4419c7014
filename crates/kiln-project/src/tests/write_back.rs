//! Values that go back into the sources of a project.

use super::*;
use std::collections::BTreeMap;

use kiln_build::Digest;

const LOOK: &str = "// how it looks\r\nstruct Params {\r\n    wetness: f32, // @slider(0, 1, 0.25) wet\r\n    tint: vec3f, // @color(1, 0.5, 0.25)\r\n}\r\n";

const SHADER: &str = "
import lib::look::Params;
override samples: u32 = 16u; // @slider(1, 64)
@group(3) @binding(0) var<uniform> params: Params;
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }
@fragment fn fs_main() -> @location(0) vec4f {
    @if(unlit) return vec4f(params.tint, 1.0);
    @else return vec4f(params.tint * params.wetness * f32(samples), 1.0);
}
";

/// A place whose shader has parameters, built.
fn place() -> Place {
    let place = Place::new();
    place.write("flat.wgsl", SHADER);
    place.write("lib/look.wgsl", LOOK);
    assert!(place.build().diagnostics.is_empty());
    place
}

fn value(name: &str, value: &[f64]) -> ParameterValue {
    ParameterValue { shader: "flat".to_owned(), name: name.to_owned(), value: value.to_vec() }
}

fn text(place: &Place, path: &str) -> String {
    fs::read_to_string(place.folder.path().join(path)).unwrap()
}

/// Writes values and expects it to be refused for this reason, with every file as it was.
#[track_caller]
fn check_refused(place: &Place, engine: &Engine, values: &[ParameterValue], reason: &str) {
    let files = || ["kiln.toml", "flat.wgsl", "lib/look.wgsl"].map(|path| text(place, path));
    let before = files();
    let fault = write_parameters(engine, values, &BTreeMap::new()).unwrap_err().to_string();
    assert!(fault.contains(reason), "{fault}");
    assert_eq!(files(), before);
}

#[test]
fn values_are_in_their_files_and_the_next_build_has_them() {
    let place = place();
    let engine = place.engine();
    let values = [value("wetness", &[0.75]), value("samples", &[32.0]), value("tint", &[1.0, 0.1, 0.25])];
    let written = write_parameters(&engine, &values, &BTreeMap::new()).unwrap();
    let paths: Vec<&str> = written.iter().map(|source| source.path.as_str()).collect();
    assert_eq!(paths, ["flat.wgsl", "lib/look.wgsl"]);
    assert_eq!(
        text(&place, "lib/look.wgsl"),
        LOOK.replace("1, 0.25) wet", "1, 0.75) wet").replace("0.5,", "0.1,")
    );
    assert_eq!(text(&place, "flat.wgsl"), SHADER.replace("16u", "32u"));
    assert!(written.iter().all(|source| Digest::of(text(&place, &source.path).as_bytes()) == source.digest));
    let built = place.build();
    assert_eq!(ran(&built), ["compile shader/flat/base", "compile shader/flat/unlit"]);
    assert!(built.diagnostics.is_empty());
}

#[test]
fn file_that_changed_since_it_was_built_is_refused_unless_we_wrote_it() {
    let place = place();
    let engine = place.engine();
    build(&engine, None, &options(&AtomicBool::new(false))).unwrap();
    let first = write_parameters(&engine, &[value("wetness", &[0.5])], &BTreeMap::new()).unwrap();
    check_refused(
        &place,
        &engine,
        &[value("wetness", &[0.75])],
        "this file was changed meanwhile; it stays as it is",
    );
    let known = first.into_iter().map(|source| (source.path, source.digest)).collect();
    write_parameters(&engine, &[value("wetness", &[0.75])], &known).unwrap();
    assert!(text(&place, "lib/look.wgsl").contains("@slider(0, 1, 0.75)"));
}

#[test]
fn one_wrong_value_among_many_writes_none() {
    let place = place();
    let engine = place.engine();
    let good = value("wetness", &[0.5]);
    check_refused(&place, &engine, &[good.clone(), value("samples", &[0.5])], "`samples` cannot be 0.5");
    check_refused(&place, &engine, &[good.clone(), value("wettness", &[0.5])], "did you mean `wetness`?");
    let other = ParameterValue { shader: "flatt".to_owned(), ..good };
    check_refused(&place, &engine, &[other], "there is no shader `flatt` in kiln.toml");
}

#[cfg(unix)]
#[test]
fn link_out_of_the_project_is_not_followed_and_one_within_is() {
    use std::os::unix::fs::symlink;
    let place = place();
    let outside = tempfile::tempdir().unwrap();
    let (folder, theirs) = (place.folder.path(), outside.path().join("look.wgsl"));
    fs::rename(folder.join("lib/look.wgsl"), &theirs).unwrap();
    symlink(&theirs, folder.join("lib/look.wgsl")).unwrap();
    let refused = &[value("wetness", &[0.5])];
    check_refused(&place, &place.engine(), refused, "this file lies outside of the project");
    fs::remove_file(folder.join("lib/look.wgsl")).unwrap();
    fs::rename(&theirs, folder.join("lib/real.wgsl")).unwrap();
    symlink("real.wgsl", folder.join("lib/look.wgsl")).unwrap();
    write_parameters(&place.engine(), refused, &BTreeMap::new()).unwrap();
    assert!(text(&place, "lib/real.wgsl").contains("1, 0.5) wet"));
    assert!(fs::symlink_metadata(folder.join("lib/look.wgsl")).unwrap().is_symlink());
}

#[cfg(unix)]
#[test]
fn write_protected_file_stays_and_others_keep_their_mode() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = place();
    let path = place.folder.path().join("lib/look.wgsl");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    check_refused(&place, &place.engine(), &[value("wetness", &[0.5])], "this file is write-protected");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
    write_parameters(&place.engine(), &[value("wetness", &[0.5])], &BTreeMap::new()).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    let left: Vec<_> =
        fs::read_dir(path.parent().unwrap()).unwrap().map(|it| it.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().starts_with('.')), "{left:?}");
}

#[test]
fn shader_that_was_never_built_has_no_known_parameters() {
    let place = place();
    let empty = tempfile::tempdir().unwrap();
    let engine = Engine::open(place.folder.path(), Store::open(empty.path()).unwrap()).unwrap();
    check_refused(&place, &engine, &[value("wetness", &[0.5])], "shader `flat` is not built");
}
