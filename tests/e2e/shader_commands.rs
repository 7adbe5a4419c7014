//! `kiln shader …`: what its options say to the compiler, what its files are called, what it counts.

use std::process::Output;

use serde_json::Value;

use crate::harness::{Project, text};

const FRAGMENT: &str = "#version 450\n#include <lights.glsl>\nout vec4 colour;\n\
    void main() { colour = vec4(float(LIGHTS) * scale() * lights()); }\n";

/// A GLSL program that needs a macro, an include folder and a prelude.
fn project() -> Project {
    let project = Project::sample();
    for folder in ["shaders/glsl", "shaders/include"] {
        std::fs::create_dir_all(project.path(folder)).unwrap();
    }
    project.write("shaders/glsl/lit.frag", FRAGMENT);
    project.write("shaders/include/lights.glsl", "float lights() { return 2.0; }\n");
    project.write("shaders/glsl/platform.glsl", "float scale() { return 0.25; }\n");
    project
}

/// `kiln shader COMMAND` on `lit.frag`, run in the project's folder.
fn shader(project: &Project, arguments: &[&str]) -> Output {
    let mut command = project.command(&["shader"]);
    command.args(arguments).current_dir(project.dir()).output().unwrap()
}

#[test]
fn macros_include_folders_and_preludes_reach_the_compiler() {
    let project = project();
    let all = ["-D", "LIGHTS=4", "-I", "shaders/include", "--prelude", "shaders/glsl/platform.glsl"];
    let emit = |options: &[&str]| {
        let file = ["emit", "--to", "wgsl", "shaders/glsl/lit.frag"];
        shader(&project, &[&file, options].concat())
    };
    let output = emit(&all);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let four = text(&output.stdout);
    assert!(four.contains("4f") && four.contains("fn lights") && four.contains("fn scale"), "{four}");
    let five = emit(&[&["-D", "LIGHTS=5"], &all[2..]].concat());
    assert_ne!(four, text(&five.stdout), "the macro's value is in the text");
    // The twins: without each of them it does not compile, and says why.
    for (left_out, complaint) in [(0, "LIGHTS"), (2, "lights.glsl"), (4, "scale")] {
        let mut options = all.to_vec();
        options.drain(left_out..left_out + 2);
        let output = emit(&options);
        assert_eq!(output.status.code(), Some(1), "{options:?}");
        let said = text(&output.stderr) + &text(&output.stdout);
        assert!(said.contains(complaint), "{options:?}: {said}");
    }
    let output = emit(&["-D", "4=LIGHTS"]);
    assert_eq!(output.status.code(), Some(1), "no macro is called so: {}", text(&output.stderr));
}

fn names(folder: &std::path::Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".wgsl")).collect();
    names.sort();
    names
}

#[test]
fn programs_that_share_a_file_are_emitted_beside_each_other() {
    let project = Project::sample();
    std::fs::create_dir_all(project.path("shaders/glsl")).unwrap();
    project.write("shaders/glsl/full.vert", "#version 450\nvoid main() { gl_Position = vec4(0.0); }\n");
    for (name, red) in [("one", "1.0"), ("two", "0.5")] {
        let fragment = format!("#version 450\nout vec4 colour;\nvoid main() {{ colour = vec4({red}); }}\n");
        project.write(&format!("shaders/glsl/{name}.frag"), fragment);
    }
    let program = |name: &str| {
        format!(
            "[shader.{name}]\nrole = \"engine\"\nsource = [\"shaders/glsl/full.vert\", \"shaders/glsl/{name}.frag\"]\n"
        )
    };
    project.write("kiln.toml", format!("version = 1\n{}{}", program("one"), program("two")));
    let out = project.beside("emitted");
    let emit = |arguments: &[&str]| {
        let fixed = ["emit", "--to", "wgsl", "-v", "base", "--out", out.to_str().unwrap()];
        shader(&project, &[&fixed, arguments].concat())
    };
    let output = emit(&["."]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(names(&out), ["one.wgsl", "two.wgsl"]);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert!(read("one.wgsl") != read("two.wgsl"));
    // The twin: files of the same name from two folders have no names of their own.
    std::fs::create_dir_all(project.path("other")).unwrap();
    std::fs::copy(project.path("shaders/pbr/tonemap.wgsl"), project.path("shaders/other.wgsl")).unwrap();
    std::fs::copy(project.path("shaders/pbr/tonemap.wgsl"), project.path("shaders/lib/tonemap.wgsl"))
        .unwrap();
    let output = emit(&["shaders/pbr/tonemap.wgsl", "shaders/lib/tonemap.wgsl"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("shaders/pbr/tonemap.wgsl") && said.contains("shaders/lib/tonemap.wgsl"), "{said}");
    assert_eq!(names(&out), ["one.wgsl", "two.wgsl"], "nothing is written");
    let output = emit(&["shaders/pbr/tonemap.wgsl", "shaders/other.wgsl"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn variants_that_do_not_compile_are_not_counted_as_shared() {
    let project = Project::sample();
    let counts = |shader_text: &str| -> Vec<u64> {
        project.write("shaders/counted.wgsl", shader_text);
        let sets = ["-v", "base", "-v", "a", "-v", "b", "-v", "a+b", "-v", "a+c"];
        let output = shader(&project, &[&["variants", "--json", "shaders/counted.wgsl"], &sets[..]].concat());
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let of = |key: &str| report["shaders"][0][key].as_u64().unwrap();
        ["asked", "compiled", "broken", "shared", "artefacts"].map(of).to_vec()
    };
    let sound = "@fragment fn fs_main() -> @location(0) vec4f {\n    @if(a) return vec4f(1.0);\n    @if(b) let x = 1;\n    return vec4f(0.5);\n}\n";
    // Five are asked for; `c` makes no difference, and neither does `b` in the end.
    assert_eq!(counts(sound), [5, 4, 0, 3, 2]);
    let broken = sound.replace("let x = 1;", "let x = oops;");
    assert_eq!(counts(&broken), [5, 2, 2, 1, 2]);
}
