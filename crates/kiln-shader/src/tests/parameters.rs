//! Annotated overrides and members.

use super::{Files, compiled, rendered};
use crate::{Parameter, ParameterPlace, Widget};

const SHADER: &str = "
override samples: u32 = 16u; // @slider(1, 64) samples a pixel
override plain: f32 = 1.5;
struct Params {
    tint: vec3f,    // @color(1.0, 0.5, 0.25)
    // @slider(0, 1, 0.25) how wet it looks
    wetness: f32,
    mode: u32,      // @choice(1, flat, smooth)
    is_lit: u32,    // @toggle(true)
    @if(rough) roughness: f32, // @slider(0, 1, 1)
}
@group(3) @binding(0) var<uniform> params: Params;
@fragment fn fs_main() -> @location(0) vec4f {
    return vec4f(params.tint * params.wetness * f32(params.mode + samples + params.is_lit), plain);
}";

fn parameters(text: &str, features: &[&str]) -> Vec<Parameter> {
    compiled(Files::new(&[("a.wgsl", text)]).compile("a.wgsl", features)).reflection.parameters
}

#[test]
fn annotations_become_parameters_where_the_shader_has_the_name() {
    let parameter = |name: &str, place: ParameterPlace, widget: Widget, default: &[f64], label: &str| {
        Parameter { name: name.into(), place, widget, default: default.to_vec(), label: label.into() }
    };
    let member = || ParameterPlace::Member { uniform: "params".into() };
    let slider = |least: f64, greatest: f64| Widget::Slider { least, greatest };
    let choice = Widget::Choice { names: vec!["flat".into(), "smooth".into()] };
    let mut expected = vec![
        parameter("samples", ParameterPlace::Override, slider(1.0, 64.0), &[16.0], "samples a pixel"),
        parameter("tint", member(), Widget::Color, &[1.0, 0.5, 0.25], ""),
        parameter("wetness", member(), slider(0.0, 1.0), &[0.25], "how wet it looks"),
        parameter("mode", member(), choice, &[1.0], ""),
        parameter("is_lit", member(), Widget::Toggle, &[1.0], ""),
    ];
    assert_eq!(parameters(SHADER, &[]), expected);
    expected.push(parameter("roughness", member(), slider(0.0, 1.0), &[1.0], ""));
    assert_eq!(parameters(SHADER, &["rough"]), expected);
}

#[test]
fn overrides_are_reflected_with_their_defaults() {
    let overrides = compiled(Files::new(&[("a.wgsl", SHADER)]).compile("a.wgsl", &[])).reflection.overrides;
    let found: Vec<_> =
        overrides.iter().map(|found| (found.name.as_str(), found.ty.as_str(), found.default)).collect();
    assert_eq!(found, [("samples", "u32", Some(16.0)), ("plain", "f32", Some(1.5))]);
}

#[test]
fn wrong_annotations_are_warned_of_at_their_place() {
    let cases = [
        ("// @slider(1, 0)", "a slider has a least and a greatest value"),
        ("// @slider(0, x)", "`x` is no number"),
        ("// @slider(0, 1, 2)", "the default lies outside the slider"),
        ("// @slider(0, 1", "this annotation is never closed"),
        ("// @color", "this annotation has no values in brackets"),
        ("// @toggle is lit", "this annotation has no values in brackets"),
        ("// @color(1, 2)", "a color has three components"),
        ("// @toggle(maybe)", "a toggle is true or false"),
        ("// @choice(2, a, b)", "the default of a choice is the number of one of its names"),
    ];
    for (comment, message) in cases {
        let text = SHADER.replace("// @slider(1, 64) samples a pixel", comment);
        let outcome = Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &[]);
        let expected = format!("warning: {message}\n  --> a.wgsl:2:33\n");
        assert!(rendered(&outcome).starts_with(&expected), "{comment}: {}", rendered(&outcome));
        assert!(outcome.compiled.is_some(), "a wrong annotation is no wrong shader");
    }
    let nowhere = format!("{SHADER}\n// @slider(0, 1)\n");
    let outcome = Files::new(&[("a.wgsl", &nowhere)]).compile("a.wgsl", &[]);
    assert!(rendered(&outcome).contains("stands at no declaration"), "{}", rendered(&outcome));
}

#[test]
fn glsl_declarations_are_read_with_their_layouts_and_first_values() {
    let text = "#version 450
layout(location = 3) uniform float wet; // @slider(0, 1)
uniform float dry = 0.5; // @slider(0, 2)
layout(location = 0) out vec4 color;
void main() { color = vec4(wet, dry, 0.0, 1.0); }";
    let outcome = Files::new(&[("a.frag", text)]).compile("a.frag", &[]);
    let found: Vec<_> =
        compiled(outcome).reflection.parameters.into_iter().map(|p| (p.name, p.default)).collect();
    assert_eq!(found, [("wet".to_owned(), vec![0.0]), ("dry".to_owned(), vec![0.5])]);
    let two = text.replace("float dry = 0.5", "float dry, damp");
    let outcome = Files::new(&[("a.frag", &two)]).compile("a.frag", &[]);
    assert!(rendered(&outcome).contains("stands at two declarations"), "{}", rendered(&outcome));
}

#[test]
fn annotations_of_what_conditions_cut_give_no_first_value() {
    let wgsl = "struct Params {
        @if(a) wetness: f32, // @slider(0, 1, 0.25)
        // @slider(0, 1, 0.75)
        @else wetness: f32,
        x: vec4f,
    }
    @group(3) @binding(0) var<uniform> params: Params;
    @fragment fn fs_main() -> @location(0) vec4f { return params.x * params.wetness; }";
    let glsl = "#version 450
#ifdef FEATURE_A
uniform float wetness; // @slider(0, 1, 0.25)
#else
uniform float wetness; // @slider(0, 1, 0.75)
#endif
layout(location = 0) out vec4 color;
void main() { color = vec4(wetness); }";
    for (file, text, feature) in [("a.wgsl", wgsl, "a"), ("a.frag", glsl, "a")] {
        let first = |features: &[&str]| {
            let outcome = Files::new(&[(file, text)]).compile(file, features);
            compiled(outcome).reflection.parameters[0].default[0]
        };
        assert_eq!((first(&[feature]), first(&[])), (0.25, 0.75), "{file}");
    }
}

#[test]
fn other_comments_are_none_of_ours() {
    let text = SHADER.replace("// @slider(1, 64)", "// see @slider(9, 0) and @group(0)");
    let outcome = Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &[]);
    assert_eq!(rendered(&outcome), "");
    assert_eq!(compiled(outcome).reflection.parameters.len(), 4);
}
