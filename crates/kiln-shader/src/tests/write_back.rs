//! Values written back: the parameter has them, and nothing else is touched.

use std::sync::Arc;

use super::random::Random;
use super::{Files, compiled, damage, rendered, set};
use crate::{Program, SourceEdit, write_parameter};

const MODULE: &str = "\u{feff}// wet paint\r
override samples: u32 = 16u;   // @slider(1, 64) samples a pixel\r
override gain: f32 = -1.50f; /* dB */ // @slider(-4, 4)\r
override plain = 2.0;          // @slider(0, 8)\r
override is_on: bool = true;   // @toggle(true)\r
override twice: f32 = 2.0 * 1.5; // @slider(0, 9)\r
struct Params {\r
    tint: vec3f,   // @color(1.0, 0.5 , 0.25) what colour\r
    // @slider(0, 1, 0.25)   how wet it looks\r
    wetness: f32,\r
    bare: vec2f,   // @slider(0, 10)\r
    mode: u32,     // @choice(1, flat, smooth)\r
    is_lit: u32,   // @toggle(true)\r
}\r
@group(3) @binding(0) var<uniform> params: Params;\r
@fragment fn fs_main() -> @location(0) vec4f {\r
    let all = params.tint * params.wetness * params.bare.x * f32(params.mode + samples + params.is_lit);\r
    return vec4f(all, gain + plain + twice + f32(is_on));\r
}";

const PROGRAM: &str = "#version 450
uniform vec2 size = vec2(64, 0.5); // texels
uniform float wet = .5f;
uniform bool is_lit = true;
uniform int least = -3; // @slider(-8, 8)
#define HALF 0.5
uniform float half_way = HALF;
uniform vec3 grey = vec3(0.5);
layout(location = 0) out vec4 color;
void main() { color = vec4(size * wet + grey.xy, half_way * float(least), is_lit ? 1.0 : 0.0); }";

/// The file after `name` got `value`.
fn written(
    files: &Files,
    root: &str,
    features: &[&str],
    name: &str,
    value: &[f64],
) -> Result<SourceEdit, String> {
    let reflection = compiled(files.compile(root, features)).reflection;
    let mut read = |path: &str| files.0.get(path).cloned();
    write_parameter(&Program::of(root), &set(features), &reflection, name, value, &mut read)
        .map_err(|fault| fault.to_string())
}

/// What stands in place of what after `name` got `value`.
fn changes(root: &str, text: &str, name: &str, value: &[f64]) -> Vec<(String, String)> {
    let edit = written(&Files::new(&[(root, text)]), root, &[], name, value).unwrap();
    assert_eq!(edit.path, root);
    edit.replacements.iter().map(|(range, new)| (text[range.clone()].to_owned(), new.clone())).collect()
}

#[track_caller]
fn check(root: &str, text: &str, name: &str, value: &[f64], expected: &[(&str, &str)]) {
    let found = changes(root, text, name, value);
    let found: Vec<(&str, &str)> = found.iter().map(|(old, new)| (old.as_str(), new.as_str())).collect();
    assert_eq!(found, expected, "{name} = {value:?}");
}

#[test]
fn numbers_stand_where_the_author_wrote_them_and_as_he_did() {
    let wgsl =
        |name: &str, value: &[f64], expected: &[(&str, &str)]| check("a.wgsl", MODULE, name, value, expected);
    wgsl("samples", &[32.0], &[("16u", "32u")]);
    wgsl("gain", &[0.1], &[("-1.50f", "0.1f")]);
    wgsl("gain", &[3.0], &[("-1.50f", "3.0f")]);
    wgsl("plain", &[3.0], &[("2.0", "3.0")]);
    wgsl("is_on", &[0.0], &[("true", "false"), ("true", "false")]);
    wgsl("tint", &[1.0, 0.7, 1.0], &[("0.5", "0.7"), ("0.25", "1.0")]);
    wgsl("wetness", &[0.333], &[("0.25", "0.333")]);
    wgsl("wetness", &[1.0], &[("0.25", "1.0")]);
    wgsl("mode", &[0.0], &[("1", "0")]);
    wgsl("is_lit", &[0.0], &[("true", "false")]);
    let glsl = |name: &str, value: &[f64], expected: &[(&str, &str)]| {
        check("a.frag", PROGRAM, name, value, expected);
    };
    glsl("size", &[32.0, 0.5], &[("64", "32")]);
    glsl("size", &[32.5, 1.0], &[("64", "32.5"), ("0.5", "1.0")]);
    glsl("wet", &[0.25], &[(".5f", "0.25f")]);
    glsl("is_lit", &[0.0], &[("true", "false")]);
    glsl("least", &[-8.0], &[("-3", "-8")]);
}

#[test]
fn literal_that_says_what_its_annotation_does_changes_with_it() {
    let text = |literal: &str, annotation: &str| {
        format!(
            "override mode: u32 = {literal}; // @choice({annotation}) how
@fragment fn fs_main() -> @location(0) vec4f {{ return vec4f(f32(mode)); }}"
        )
    };
    let both = text("0u", "0, neutral, agx, none");
    check("a.wgsl", &both, "mode", &[2.0], &[("0u", "2u"), ("0", "2")]);
    check("a.wgsl", &both, "mode", &[0.0], &[]);
    // Its author meant two things.
    check("a.wgsl", &text("1u", "0, neutral, agx, none"), "mode", &[2.0], &[("0", "2")]);
}

#[test]
fn slider_without_a_first_value_gets_one() {
    check("a.wgsl", MODULE, "bare", &[2.5, 2.5], &[("", ", 2.5")]);
    check("a.wgsl", MODULE, "bare", &[2.5, 3.0], &[("", ", 2.5, 3")]);
    check("a.wgsl", MODULE, "twice", &[4.0], &[("", ", 4")]);
}

#[test]
fn one_number_for_all_components_becomes_a_list_and_a_list_stays_one() {
    check("a.frag", PROGRAM, "grey", &[0.1, 0.2, 0.3], &[("0.5", "0.1, 0.2, 0.3")]);
    check("a.frag", PROGRAM, "grey", &[1.0; 3], &[("0.5", "1.0")]);
    check("a.frag", PROGRAM, "size", &[1.0, 1.0], &[("64", "1"), ("0.5", "1.0")]);
}

#[test]
fn value_that_stands_there_already_changes_nothing() {
    check("a.wgsl", MODULE, "wetness", &[0.25], &[]);
    check("a.wgsl", MODULE, "tint", &[1.0, 0.5, 0.25], &[]);
}

#[test]
fn type_and_widget_decide_what_is_taken() {
    let refused = |name: &str, value: &[f64], reason: &str| {
        let error = written(&Files::new(&[("a.wgsl", MODULE)]), "a.wgsl", &[], name, value).unwrap_err();
        assert!(error.contains(reason), "{name} = {value:?}: {error}");
    };
    refused("samples", &[2.5], "`samples` cannot be 2.5: it is a u32 from 1 to 64");
    refused("samples", &[65.0], "cannot be 65");
    refused("samples", &[-1.0], "cannot be -1");
    refused("gain", &[f64::NAN], "cannot be NaN");
    refused("gain", &[f64::INFINITY], "cannot be inf");
    refused("tint", &[1e39, 0.0, 0.0], "an f32");
    refused("mode", &[2.0], "the number of one of flat, smooth");
    refused("is_lit", &[0.5], "true (1) or false (0)");
    refused("tint", &[1.0], "takes 3 numbers; 1 are given");
    refused("nothing", &[1.0], "no parameter `nothing` is declared here or in what it imports");
}

#[test]
fn value_that_a_macro_gives_is_refused_with_a_way_out() {
    let error = written(&Files::new(&[("a.frag", PROGRAM)]), "a.frag", &[], "half_way", &[0.25]).unwrap_err();
    assert!(error.contains("the first value of `half_way` is worked out"), "{error}");
    assert!(error.contains("help: give it a literal, or an annotation"), "{error}");
}

#[test]
fn import_or_include_that_declares_it_is_the_one_that_changes() {
    let module = "import super::look::Params;
        @group(3) @binding(0) var<uniform> params: Params;
        @fragment fn fs_main() -> @location(0) vec4f { return vec4f(params.wetness); }";
    let look = "struct Params { x: vec4f,\n wetness: f32, // @slider(0, 1, 0.25)\n}";
    let files = Files::new(&[("s/a.wgsl", module), ("s/look.wgsl", look)]);
    let edit = written(&files, "s/a.wgsl", &[], "wetness", &[0.5]).unwrap();
    assert_eq!((edit.path.as_str(), edit.apply(look)), ("s/look.wgsl", look.replace("0.25", "0.5")));
    let main = "#version 450
#include \"look.glsl\"
layout(location = 0) out vec4 color;
void main() { color = vec4(wet); }";
    let look = "uniform float wet = 0.25;\n";
    let files = Files::new(&[("s/a.frag", main), ("s/look.glsl", look)]);
    let edit = written(&files, "s/a.frag", &[], "wet", &[0.5]).unwrap();
    assert_eq!((edit.path.as_str(), edit.apply(look)), ("s/look.glsl", look.replace("0.25", "0.5")));
}

#[test]
fn branch_that_the_features_keep_is_the_one_that_changes() {
    let text = "struct Params {
        @if(a) wetness: f32, // @slider(0, 1, 0.25)
        // @slider(0, 1, 0.75)
        @else wetness: f32,
        x: vec4f,
    }
    @group(3) @binding(0) var<uniform> params: Params;
    @fragment fn fs_main() -> @location(0) vec4f { return params.x * params.wetness; }";
    let files = Files::new(&[("a.wgsl", text)]);
    let apply =
        |features: &[&str]| written(&files, "a.wgsl", features, "wetness", &[0.5]).unwrap().apply(text);
    assert_eq!(apply(&["a"]), text.replace("0.25", "0.5"));
    assert_eq!(apply(&[]), text.replace("0.75", "0.5"));
}

/// Some value that the type and widget of the parameter take.
fn any_value(name: &str, random: &mut Random) -> Vec<f64> {
    let unit = |random: &mut Random| match random.below(4) {
        0 => random.below(2) as f64,
        1 => random.below(1001) as f64 / 1000.0,
        2 => f64::from(random.below(1 << 24) as f32 / (1 << 24) as f32),
        _ => random.below(1 << 40) as f64 / (1_u64 << 40) as f64,
    };
    match name {
        "samples" => vec![1.0 + random.below(64) as f64],
        "gain" => vec![unit(random) * 8.0 - 4.0],
        "plain" | "twice" => vec![unit(random) * 8.0],
        "tint" => (0..3).map(|_| unit(random) * 1e30).collect(),
        "bare" => (0..2).map(|_| unit(random) * 10.0).collect(),
        "wetness" => vec![unit(random)],
        _ => vec![random.below(2) as f64],
    }
}

/// The parameters by their names, with their values as an `f32` holds them.
fn firsts(root: &str, text: &str) -> Vec<(String, Vec<f32>)> {
    let outcome = Files::new(&[(root, text)]).compile(root, &[]);
    assert_eq!(rendered(&outcome), "", "{text}");
    let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect();
    let parameters = compiled(outcome).reflection.parameters;
    parameters.iter().map(|parameter| (parameter.name.clone(), narrow(&parameter.default))).collect()
}

#[track_caller]
fn check_only_literals_changed(before: &str, edit: &SourceEdit, after: &str) {
    let (mut at, mut rest) = (0, after);
    for (range, replacement) in &edit.replacements {
        let is_of_literal =
            |character: char| character.is_ascii_alphanumeric() || "+-. ,".contains(character);
        assert!(before[range.clone()].chars().all(is_of_literal), "{}", &before[range.clone()]);
        let kept = format!("{}{replacement}", &before[at..range.start]);
        rest = rest.strip_prefix(&kept).expect("what stands before the literal is as it was");
        at = range.end;
    }
    assert_eq!(rest, &before[at..]);
}

#[test]
#[should_panic(expected = "what stands before the literal is as it was")]
fn check_of_literals_finds_a_comment_that_changed() {
    let edit = SourceEdit { path: "a.wgsl".into(), replacements: vec![(5..6, "2".into())] };
    check_only_literals_changed("/*a*/1", &edit, "/*b*/2");
}

#[test]
fn any_value_is_read_again_as_it_was_written_and_nothing_else_changes() {
    let mut random = Random::new(7);
    let mut text: Arc<str> = MODULE.into();
    for _ in 0..300 {
        let before = firsts("a.wgsl", &text);
        let name = before[random.below(before.len())].0.clone();
        let value = any_value(&name, &mut random);
        let edit = written(&Files::new(&[("a.wgsl", &text)]), "a.wgsl", &[], &name, &value).unwrap();
        let after_text = edit.apply(&text);
        check_only_literals_changed(&text, &edit, &after_text);
        for ((known, before), (same, after)) in before.iter().zip(firsts("a.wgsl", &after_text)) {
            assert_eq!(*known, same);
            if *known != name {
                assert_eq!(*before, after, "{known} stays when {name} is written");
                continue;
            }
            let last = after[after.len() - 1];
            let read: Vec<f32> = (0..value.len()).map(|at| *after.get(at).unwrap_or(&last)).collect();
            let expected: Vec<f32> = value.iter().map(|value| *value as f32).collect();
            assert_eq!(read, expected, "{name} in\n{after_text}");
        }
        text = after_text.into();
    }
    assert!(text.starts_with('\u{feff}') && text.matches("\r\n").count() == MODULE.matches("\r\n").count());
}

#[test]
fn damaged_sources_are_refused_or_written_and_never_a_panic() {
    let mut random = Random::new(11);
    let reflection = compiled(Files::new(&[("a.wgsl", MODULE)]).compile("a.wgsl", &[])).reflection;
    let glsl = compiled(Files::new(&[("a.frag", PROGRAM)]).compile("a.frag", &[])).reflection;
    let mut written = 0;
    for round in 0..600 {
        let (root, reflection, text) =
            if round % 2 == 0 { ("a.wgsl", &reflection, MODULE) } else { ("a.frag", &glsl, PROGRAM) };
        let text: Arc<str> = damage::bytes(text.to_owned(), &mut random).into();
        let parameter = &reflection.parameters[random.below(reflection.parameters.len())];
        let mut read = |path: &str| (path == root).then(|| text.clone());
        let value = &parameter.default;
        let edit =
            write_parameter(&Program::of(root), &set(&[]), reflection, &parameter.name, value, &mut read);
        written += usize::from(edit.is_ok_and(|edit| !edit.apply(&text).is_empty()));
    }
    assert!(written > 50, "the damage leaves some as they are: {written}");
}
