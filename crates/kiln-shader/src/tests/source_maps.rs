//! From canonical text back to the author's files, lines and names.

use super::cases::Case;
use super::{Files, compiled, rendered};
use crate::Outcome;

/// Each function as `name = source_name file:line local=author's …`.
fn lines(outcome: &Outcome) -> Vec<String> {
    let functions = outcome.source_map.functions.iter();
    let line = |function: &crate::FunctionSource| {
        let locals: String =
            function.locals.iter().map(|(name, author)| format!(" {name}={author}")).collect();
        let crate::FunctionSource { name, source_name, file, line, .. } = function;
        format!("{name} = {source_name} {file}:{line}{locals}")
    };
    functions.map(line).collect()
}

#[test]
fn functions_of_modules_have_the_authors_names_and_lines() {
    let files = Files::new(&[
        (
            "a.wgsl",
            "import b::half;\n\n@fragment fn fs_main(@location(0) shade: f32) -> @location(0) vec4f {\n return vec4f(half(shade)); }",
        ),
        ("b.wgsl", "// halves\nfn half(whole: f32) -> f32 { var part = whole; part *= 0.5; return part; }"),
    ]);
    let outcome = files.compile("a.wgsl", &[]);
    assert_eq!(
        lines(&outcome),
        ["half = half b.wgsl:2 argument_1=whole variable=part", "fs_main = fs_main a.wgsl:4 argument=shade"]
    );
    let text = compiled(outcome).wgsl;
    assert!(text.contains("fn half(argument_1: f32)") && text.contains("var variable: f32"), "{text}");
}

const VERTEX: &str = "#version 450\n#include \"common.glsl\"\nin vec3 position;\nout mat3 turned;\n\
    float own(float wide) { return wide * 2.0; }\n\nvoid main() {\n    \
    float size = own(half_of(position.x));\n    turned = mat3(size);\n    gl_Position = vec4(position, size);\n}\n";
const FRAGMENT: &str = "#version 450\n#include \"common.glsl\"\nin mat3 turned;\nout vec4 colour;\n\n\
    float own(float deep) {\n    float whole;\n    float rest = modf(deep, whole);\n    return rest * whole;\n}\n\
    void main() {\n    vec3 shade = turned[0];\n    colour = vec4(shade * own(shade.x), 1.0);\n}\n";
const COMMON: &str = "// both stages have it\nfloat half_of(float whole) {\n    float part = whole;\n    part *= 0.5;\n    return part;\n}\n";

fn glsl(vertex: &str, fragment: &str) -> Outcome {
    let mut case = Case::of(&[("a.vert", vertex), ("a.frag", fragment), ("common.glsl", COMMON)]);
    case.roots = vec!["a.vert".to_owned(), "a.frag".to_owned()];
    let outcome = case.compile();
    assert!(outcome.compiled.is_some(), "{}", rendered(&outcome));
    outcome
}

/// The line of the map about the function that its author calls `name`, in `file`.
#[track_caller]
fn find(map: &[String], name: &str, file: &str) -> String {
    let wanted = format!("= {name} {file}:");
    let mut found = map.iter().filter(|line| line.contains(&wanted));
    let first = found.next().unwrap_or_else(|| panic!("no {wanted:?} in {map:#?}"));
    assert_eq!(found.next(), None, "{map:#?}");
    first.clone()
}

#[test]
fn functions_of_glsl_have_the_authors_names_and_lines_in_their_files() {
    let outcome = glsl(VERTEX, FRAGMENT);
    let map = lines(&outcome);
    let text = compiled(outcome).wgsl;
    let half = find(&map, "half_of", "common.glsl");
    assert!(half.contains("common.glsl:2 ") && half.contains("=whole") && half.contains("=part"), "{half}");
    let own = [find(&map, "own", "a.vert"), find(&map, "own", "a.frag")];
    assert!(own[0].contains("a.vert:5 ") && own[0].contains("=wide"), "{own:?}");
    assert!(own[1].contains("a.frag:6 ") && own[1].contains("=deep") && own[1].contains("=rest"), "{own:?}");
    for line in &map {
        // The names on the left are those of the text.
        assert!(text.contains(&format!("fn {}(", line.split(' ').next().unwrap())), "{line}\n{text}");
    }
    let is_main = |line: &&String| line.contains("= main a.vert:7");
    let mains: Vec<&String> = map.iter().filter(is_main).collect();
    assert!(mains.iter().any(|line| line.starts_with("vs_main ")), "{map:#?}");
    assert!(mains.iter().any(|line| line.contains("=size")), "{map:#?}");
    // What Kiln adds is in no file.
    let added = find(&map, "kiln_modf", "");
    assert!(added.ends_with(":0") || added.contains(":0 "), "{added}");
}

#[test]
fn map_follows_lines_and_names_and_text_does_not() {
    let before = glsl(VERTEX, FRAGMENT);
    let after =
        glsl(&VERTEX.replace("float own", "\n\n// wider\nfloat own").replace("wide", "broad"), FRAGMENT);
    assert_eq!(before.compiled, after.compiled);
    let own = find(&lines(&after), "own", "a.vert");
    assert!(own.contains("a.vert:8 ") && own.contains("=broad"), "{own}");
    assert_ne!(lines(&before), lines(&after));
    assert_eq!(lines(&before), lines(&glsl(VERTEX, FRAGMENT)));
}
