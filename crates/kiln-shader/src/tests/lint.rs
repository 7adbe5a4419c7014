//! The lint: each hazard is found, and each guard against it is seen.

use std::fmt::Write;
use std::time::{Duration, Instant};

use super::shaders::{FEATURES, shipped};
use super::{Files, compiled, rendered, set};
use crate::{Outcome, Program, lint};

/// Inputs that can be anything.
const INPUTS: &str = "
    struct Material { scale: f32, limit: f32, tint: vec3f }
    @group(0) @binding(0) var<uniform> material: Material;
    @group(0) @binding(1) var color: texture_2d<f32>;
    @group(0) @binding(2) var color_sampler: sampler;";

fn linted(source: &str) -> Outcome {
    let files = Files::new(&[("a.wgsl", source)]);
    lint(&Program::of("a.wgsl"), &set(&[]), &mut |path| files.0.get(path).cloned())
}

/// A fragment shader over any `x`, `y` and `v`, with `functions` around it.
fn shader(functions: &str, statements: &str) -> String {
    format!(
        "{INPUTS}\n{functions}\n@fragment fn fs_main(@builtin(position) position: vec4f, @location(0) x: f32, @location(1) y: f32, @location(2) v: vec3f, @location(3) @interpolate(flat, either) i: i32) -> @location(0) vec4f {{\n{statements}\n}}"
    )
}

#[track_caller]
fn messages(functions: &str, statements: &str) -> Vec<String> {
    let outcome = linted(&shader(functions, statements));
    let text = rendered(&outcome);
    assert!(outcome.compiled.is_some(), "does not compile:\n{text}");
    outcome.diagnostics.into_iter().map(|diagnostic| diagnostic.message).collect()
}

/// `guarded` gives no warning, `bare` one that begins with `expected`.
#[track_caller]
fn check_pair(functions: &str, guarded: &str, bare: &str, expected: &str) {
    assert_eq!(messages(functions, guarded), Vec::<String>::new(), "{guarded}");
    let found = messages(functions, bare);
    assert!(found.len() == 1 && found[0].starts_with(expected), "{bare}: {found:?}");
}

/// The same for two expressions.
#[track_caller]
fn check_values(guarded: &str, bare: &str, expected: &str) {
    let returned = |value: &str| format!("return vec4f({value});");
    check_pair("", &returned(guarded), &returned(bare), expected);
}

const DIVISION: &str = "division by a value that may be 0";
const SQRT: &str = "`sqrt` of a value that may be negative";
const NORMALIZE: &str = "`normalize` of a vector that may be zero";

#[test]
fn each_operator_is_checked_at_the_edge_of_its_domain() {
    check_values("1.0 / max(x, 1e-4)", "1.0 / max(x, 0.0)", DIVISION);
    check_values("1.0 / (abs(x) + 1e-4)", "1.0 / abs(x)", DIVISION);
    check_values("1.0 / (1.0 + x * x)", "1.0 / (1.0 + x)", DIVISION);
    check_values("x % max(y, 0.5)", "x % y", "remainder of a division by a value that may be 0");
    check_values("sqrt(max(x, 0.0))", "sqrt(x)", SQRT);
    check_values(
        "inverseSqrt(max(x, 1e-6))",
        "inverseSqrt(max(x, 0.0))",
        "`inverseSqrt` of a value that may be 0:",
    );
    check_values(
        "inverseSqrt(exp2(clamp(x, -9.0, 9.0)))",
        "inverseSqrt(x)",
        "`inverseSqrt` of a value that may be 0 or",
    );
    check_values("log(1.0 + saturate(x))", "log(saturate(x))", "`log` of a value that may be 0:");
    check_values("log2(max(x, 1e-6))", "log2(x)", "`log2` of a value that may be 0 or negative");
    check_values("acos(clamp(x, -1.0, 1.0))", "acos(x)", "`acos` of a value that may be outside -1 … 1");
    check_values("asin(sin(x))", "asin(2.0 * sin(x))", "`asin` of a value that may be outside");
    check_values("acosh(max(x, 1.0))", "acosh(x)", "`acosh` of a value that may be less than 1");
    check_values("atanh(0.5 * cos(x))", "atanh(cos(x))", "`atanh` of a value that may be -1 or 1");
    check_values("pow(max(x, 0.0), 2.2)", "pow(x, 2.2)", "`pow` of a base that may be negative");
    check_values("pow(max(x, 1e-3), y)", "pow(max(x, 0.0), y)", "`pow` of 0 with an exponent");
    check_values("pow(saturate(x), 1.0 + abs(y))", "pow(saturate(x), abs(y))", "`pow` of 0 with an exponent");
}

#[test]
fn vectors_have_lengths() {
    check_values("normalize(vec3f(x, y, 1.0)).x", "normalize(vec3f(x, y, 0.0)).x", NORMALIZE);
    check_values("1.0 / length(vec2f(x, 2.0))", "1.0 / length(v)", DIVISION);
    check_values(
        "acos(clamp(dot(normalize(vec3f(x, 1.0, y)), normalize(vec3f(1.0, x, y))), -1.0, 1.0))",
        "acos(dot(normalize(vec3f(x, 1.0, y)), normalize(vec3f(1.0, x, y))))",
        "`acos` of a value that may be outside",
    );
    check_values("sqrt(dot(v, v))", "sqrt(dot(v, v.zxy))", SQRT);
    check_values("sqrt(1.0 - saturate(x) * saturate(x))", "sqrt(1.0 - x * x)", SQRT);
    check_values(
        "normalize(normalize(vec3f(x, 1.0, y)) * select(-1.0, 1.0, x > y)).x",
        "normalize(normalize(vec3f(x, 1.0, y)) * x).x",
        NORMALIZE,
    );
    check_values(
        "normalize(reflect(normalize(vec3f(x, 1.0, y)), normalize(vec3f(x, y, 1.0)))).x",
        "normalize(cross(normalize(vec3f(x, 1.0, y)), normalize(vec3f(x, y, 1.0)))).x",
        NORMALIZE,
    );
    check_values("(vec3f(1.0) / max(v, vec3f(0.1))).x", "(vec3f(1.0) / v).x", DIVISION);
    check_values(
        "(vec2f(1.0) / vec2f(textureDimensions(color))).x",
        "(vec2f(1.0) / material.tint.xy).x",
        DIVISION,
    );
}

#[test]
fn ranges_follow_arithmetic() {
    check_values("1.0 / (2.0 + cos(x))", "1.0 / (1.0 + cos(x))", DIVISION);
    check_values("sqrt(mix(0.0, 1.0, saturate(x)))", "sqrt(mix(0.0, 1.0, x))", SQRT);
    check_values("sqrt(smoothstep(0.0, 1.0, x) - 0.0)", "sqrt(smoothstep(0.0, 1.0, x) - 0.1)", SQRT);
    check_values("sqrt(f32(u32(abs(i))))", "sqrt(f32(i))", SQRT);
    check_values("sqrt(x * y * x * y)", "sqrt(x * y * x)", SQRT);
    check_values("sqrt(x * abs(y) * x)", "sqrt(x * y * abs(x))", SQRT);
    check_values("sqrt(fract(x))", "sqrt(fract(x) - 0.5)", SQRT);
    check_values("1.0 / (floor(max(x, 0.0)) + 1.0)", "1.0 / floor(max(x, 0.5))", DIVISION);
    // Below the smallest normal number a GPU may have zero.
    check_values("1.0 / (max(x, 1e-10) * max(y, 1e-10))", "1.0 / (max(x, 1e-30) * max(y, 1e-30))", DIVISION);
    // Integers have a rule for zero.
    assert_eq!(messages("", "return vec4f(f32(7 / i));"), Vec::<String>::new());
}

#[test]
fn conditions_guard() {
    let pairs = [
        (
            "if x > 0.0 { return vec4f(1.0 / x); } return vec4f(0.0);",
            "if x >= 0.0 { return vec4f(1.0 / x); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if x != 0.0 { return vec4f(1.0 / x); } return vec4f(0.0);",
            "if x != 1.0 { return vec4f(1.0 / x); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if x <= 0.0 { return vec4f(0.0); } return vec4f(1.0 / x);",
            "if x <= -1.0 { return vec4f(0.0); } return vec4f(1.0 / x);",
            DIVISION,
        ),
        (
            "if !(x < 1e-3) { return vec4f(1.0 / x); } return vec4f(0.0);",
            "if x < 1e-3 { return vec4f(1.0 / x); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if 0.0 < x { return vec4f(log(x)); } return vec4f(0.0);",
            "if 0.0 > x { return vec4f(log(x)); } return vec4f(0.0);",
            "`log`",
        ),
        (
            "if x > 0.0 && y > 0.0 { return vec4f(x / y); } return vec4f(0.0);",
            "if x > 0.0 || y > 0.0 { return vec4f(x / y); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if x <= 0.0 || y <= 0.0 { return vec4f(0.0); } return vec4f(x / y);",
            "if x <= 0.0 && y <= 0.0 { return vec4f(0.0); } return vec4f(x / y);",
            DIVISION,
        ),
        (
            "if x > 0.0 && sqrt(x) > 0.0 { return vec4f(1.0); } return vec4f(0.0);",
            "if y > 0.0 && sqrt(x) > 0.0 { return vec4f(1.0); } return vec4f(0.0);",
            SQRT,
        ),
        (
            "if dot(v, v) > 0.0 { return vec4f(normalize(v), 1.0); } return vec4f(0.0);",
            "if dot(v, v) >= 0.0 { return vec4f(normalize(v), 1.0); } return vec4f(0.0);",
            NORMALIZE,
        ),
        (
            "if length(v) > 1e-6 { return vec4f(v / length(v), 1.0); } return vec4f(0.0);",
            "if length(v) < 1e-6 { return vec4f(v / length(v), 1.0); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if abs(x) > 1e-6 { return vec4f(1.0 / x); } return vec4f(0.0);",
            "if abs(y) > 1e-6 { return vec4f(1.0 / x); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "if all(v > vec3f(0.0)) { return vec4f(log(v), 1.0); } return vec4f(0.0);",
            "if any(v > vec3f(0.0)) { return vec4f(log(v), 1.0); } return vec4f(0.0);",
            "`log`",
        ),
        (
            "if material.scale > 0.0 { return vec4f(x / material.scale); } return vec4f(0.0);",
            "if material.limit > 0.0 { return vec4f(x / material.scale); } return vec4f(0.0);",
            DIVISION,
        ),
        (
            "return vec4f(select(0.0, 1.0 / x, x > 0.0));",
            "return vec4f(select(1.0 / x, 0.0, x > 0.0));",
            DIVISION,
        ),
        (
            "let q = y / x; return vec4f(select(2.0 * q, 0.0, x == 0.0));",
            "let q = y / x; return vec4f(select(2.0 * q, 0.0, y == 0.0));",
            DIVISION,
        ),
    ];
    for (guarded, bare, expected) in pairs {
        check_pair("", guarded, bare, expected);
    }
}

#[test]
fn variables_are_followed() {
    let pairs = [
        (
            "var d = x; if d < 0.1 { d = 0.1; } return vec4f(1.0 / d);",
            "var d = x; if d < -0.1 { d = 0.1; } return vec4f(1.0 / d);",
        ),
        (
            "var d = x; d = max(d, 0.1); return vec4f(1.0 / d);",
            "var d = max(x, 0.1); d = x; return vec4f(1.0 / d);",
        ),
        (
            "var d = x; if d > 0.0 { return vec4f(1.0 / d); } return vec4f(0.0);",
            "var d = x; if d > 0.0 { d = y; return vec4f(1.0 / d); } return vec4f(0.0);",
        ),
        (
            "var d = 1.0; if x > 0.0 { d = 2.0; } return vec4f(1.0 / d);",
            "var d: f32; if x > 0.0 { d = 2.0; } return vec4f(1.0 / d);",
        ),
        (
            "var d: f32; switch i { case 1, 2: { d = 1.0; } default: { d = 2.0; } } return vec4f(1.0 / d);",
            "var d: f32; switch i { case 1, 2: { d = 1.0; } default: { } } return vec4f(1.0 / d);",
        ),
        (
            "var m: Material; m.scale = 2.0; return vec4f(1.0 / m.scale);",
            "var m: Material; m.limit = 2.0; return vec4f(1.0 / m.scale);",
        ),
        (
            "let m = Material(1.0, x, v); return vec4f(1.0 / m.scale);",
            "let m = Material(1.0, x, v); return vec4f(1.0 / m.limit);",
        ),
        (
            "var a = array<f32, 3>(1.0, 2.0, 3.0); a[i] = 4.0; return vec4f(1.0 / a[i]);",
            "var a = array<f32, 3>(1.0, 2.0, 3.0); a[i] = x; return vec4f(1.0 / a[0]);",
        ),
        (
            "var w = vec3f(1.0); w.y = 2.0; return vec4f(1.0 / w.x);",
            "var w = vec3f(1.0); w.y = x; return vec4f(1.0 / w.y);",
        ),
    ];
    for (guarded, bare) in pairs {
        check_pair("", guarded, bare, DIVISION);
    }
    let normal = "var w = vec3f(0.0, 0.0, 1.0); w.z = x;";
    check_pair(
        "",
        "var w = vec3f(0.0, 0.0, 1.0); return vec4f(normalize(w), x);",
        &format!("{normal} return vec4f(normalize(w), x);"),
        NORMALIZE,
    );
}

#[test]
fn loops_are_followed() {
    let pairs = [
        (
            "var s = 0.0; for (var k = 1; k < 9; k++) { s += 1.0 / f32(k); } return vec4f(s);",
            "var s = 0.0; for (var k = 0; k < 9; k++) { s += 1.0 / f32(k); } return vec4f(s);",
        ),
        (
            "var s = 1.0; for (var k = 0; k < 9; k++) { s += 1.0; } return vec4f(1.0 / s);",
            "var s = 1.0; for (var k = 0; k < 9; k++) { s -= 1.0; } return vec4f(1.0 / s);",
        ),
        (
            "var k = 0; loop { if k > i { break; } k += 1; if k == 3 { continue; } } return vec4f(1.0 / f32(k + 1));",
            "var k = 0; loop { if k > i { break; } k -= 1; if k == 3 { continue; } } return vec4f(1.0 / f32(k + 1));",
        ),
        (
            "var d = 1.0; while x > d { d = d * 2.0; } return vec4f(1.0 / d);",
            "var d = 1.0; while x > d { d = d * 0.5; } return vec4f(1.0 / d);",
        ),
        (
            "var d = x; loop { if d > 1.0 { break; } d += 1.0; } return vec4f(1.0 / d);",
            "var d = x; loop { if d < 1.0 { break; } d += 1.0; } return vec4f(1.0 / d);",
        ),
    ];
    for (guarded, bare) in pairs {
        check_pair("", guarded, bare, DIVISION);
    }
    // A value that a later round brings back to the start.
    let around =
        "var d = 1.0; var e = 1.0; for (var k = 0; k < 9; k++) { d = e; e = x; } return vec4f(1.0 / d);";
    assert_eq!(messages("", around).len(), 1);
    let nested = "var d = 1.0; for (var a = 0; a < 3; a++) { for (var b = 0; b < 3; b++) { for (var c = 0; c < 3; c++) { d = STEP; } } } return vec4f(1.0 / d);";
    check_pair("", &nested.replace("STEP", "2.0"), &nested.replace("STEP", "x"), DIVISION);
}

#[test]
fn calls_are_followed() {
    let inverse = "fn inverse(d: f32) -> f32 { return 1.0 / d; }";
    check_pair(
        inverse,
        "return vec4f(inverse(1.0) + inverse(abs(x) + 1.0));",
        "return vec4f(inverse(1.0) + inverse(x));",
        DIVISION,
    );
    let bounded = "fn bounded(d: f32) -> f32 { return max(d, 0.5); } fn twice(d: f32) -> f32 { return 2.0 * bounded(d); }";
    check_pair(bounded, "return vec4f(1.0 / twice(x));", "return vec4f(1.0 / (twice(x) - 1.0));", DIVISION);
    // Each call of a small function gives its own result.
    let or = "fn normalize_or(v: vec3f, otherwise: vec3f) -> vec3f { let l = dot(v, v); if l < 1e-30 { return otherwise; } return v * inverseSqrt(l); }";
    check_pair(
        or,
        "return vec4f(normalize(normalize_or(v, vec3f(0.0, 1.0, 0.0))), normalize_or(v, vec3f(0.0)).x);",
        "return vec4f(normalize(normalize_or(v, vec3f(0.0))), normalize_or(v, vec3f(0.0, 1.0, 0.0)).x);",
        NORMALIZE,
    );
    let pointer = "fn reset(p: ptr<function, f32>) { *p = 0.0; } fn look(p: f32) { }";
    check_pair(
        pointer,
        "var d = 1.0; look(d); return vec4f(1.0 / d);",
        "var d = 1.0; reset(&d); return vec4f(1.0 / d);",
        DIVISION,
    );
    // Too large to be followed for each call: the joined arguments count.
    let mut large = "fn large(d: f32) -> f32 { var s = d;".to_owned();
    (0..70).for_each(|_| large.push_str("s = abs(s) + 1.0;"));
    large.push_str("return s; }");
    check_pair(&large, "return vec4f(1.0 / large(x));", "return vec4f(1.0 / (large(x) - 100.0));", DIVISION);
}

#[test]
fn what_can_change_is_not_taken_for_the_same() {
    let private = "var<private> p: f32; fn touch() { p = 0.0; }";
    let twin = "if p > 0.0 { touch(); return vec4f(1.0 / p); } return vec4f(0.0);";
    check_pair(private, "if p > 0.0 { return vec4f(1.0 / p); } return vec4f(0.0);", twin, DIVISION);
    let square = "var d = x; let a = d; d = y; return vec4f(sqrt(a * d));";
    check_pair("", "var d = x; return vec4f(sqrt(d * d));", square, SQRT);
}

#[test]
fn derivatives_need_neighbours() {
    let level = "a texture's level is taken where neighbouring pixels may not be";
    let sample = "textureSample(color, color_sampler, vec2f(x))";
    let pairs = [
        (
            "if material.scale > 0.0 { return SAMPLE; } return vec4f(0.0);",
            "if x > 0.0 { return SAMPLE; } return vec4f(0.0);",
        ),
        (
            "let s = SAMPLE; if x > 0.0 { return s; } return vec4f(0.0);",
            "if x > 0.0 { return vec4f(0.0); } return SAMPLE;",
        ),
        (
            "var s = vec4f(0.0); for (var k = 0; k < 4; k++) { s += SAMPLE; } return s;",
            "var s = vec4f(0.0); for (var k = 0; k < i; k++) { s += SAMPLE; } return s;",
        ),
        (
            "if x > 0.0 { discard; } return SAMPLE;",
            "var k = 0; if x > 0.0 { k = 1; } if k == 1 { return SAMPLE; } return vec4f(0.0);",
        ),
        (
            "if x > 0.0 { return textureSampleLevel(color, color_sampler, vec2f(x), 0.0); } return SAMPLE * 0.0 + vec4f(material.scale);",
            "if x > 0.0 { return SAMPLE; } return vec4f(0.0);",
        ),
    ];
    for (guarded, bare) in &pairs[..4] {
        check_pair("", &guarded.replace("SAMPLE", sample), &bare.replace("SAMPLE", sample), level);
    }
    let called = format!(
        "fn read(x: f32) -> vec4f {{ return {sample}; }} fn early(x: f32) -> f32 {{ if x > 0.0 {{ return 1.0; }} return 0.0; }}"
    );
    check_pair(
        &called,
        "let e = early(x); return read(x) * e;",
        "if early(x) > 0.5 { return read(x); } return vec4f(0.0);",
        level,
    );
    check_pair(
        "",
        "let d = dpdx(x); if x > 0.0 { return vec4f(d); } return vec4f(0.0);",
        "if x > 0.0 { return vec4f(dpdx(x)); } return vec4f(0.0);",
        "a derivative is taken",
    );
}

#[test]
fn what_hurts_is_reported() {
    check_values("pow(max(x, 0.0), 2.5)", "pow(max(x, 0.0), 2.0)", "`pow` with a small whole exponent");
    let looped = "var s = x; for (var k = 0; k < COUNT; k++) { s = s * 0.5; } return vec4f(s);";
    check_pair(
        "",
        &looped.replace("COUNT", "4096"),
        &looped.replace("COUNT", "4097"),
        "4097 rounds of a loop for each pixel",
    );
    let nested = "var s = x; for (var a = 64u; a > 0u; a -= 1u) { for (var b = 1; b <= COUNT; b += 2) { s = s * 0.5; } } return vec4f(s);";
    check_pair(
        "",
        &nested.replace("COUNT", "128"),
        &nested.replace("COUNT", "130"),
        "4160 rounds of a loop for each pixel",
    );
    let array = "var a: array<f32, COUNT>; a[i] = x; return vec4f(a[3]);";
    check_pair(
        "",
        &array.replace("COUNT", "64"),
        &array.replace("COUNT", "65"),
        "a local array of 65 elements",
    );
    let uniform = "@group(1) @binding(0) var<uniform> many: array<vec4f, COUNT>;";
    let statements = "return many[i];";
    assert_eq!(messages(&uniform.replace("COUNT", "1024"), statements), Vec::<String>::new());
    assert_eq!(
        messages(&uniform.replace("COUNT", "1025"), statements),
        ["uniform `many` has 16400 bytes, some devices take 16384"]
    );
}

#[test]
fn author_may_allow_a_finding_with_a_reason() {
    let lines = |comment: &str| format!("let q = 1.0 / x; {comment}\nreturn vec4f(q);");
    check_pair(
        "",
        &lines("// kiln: allow(domain) the mesh has no zeros here"),
        &lines("// kiln: allow(cost) why not"),
        DIVISION,
    );
    let above = "// kiln: allow(domain) the mesh has no zeros here\nlet q = 1.0 / x;\nreturn vec4f(q);";
    assert_eq!(messages("", above), Vec::<String>::new());
    let far = "// kiln: allow(domain) the mesh has no zeros here\n\nlet q = 1.0 / x;\nreturn vec4f(q);";
    assert_eq!(messages("", far).len(), 1);
    let silent = messages("", &lines("// kiln: allow(domain)"));
    assert_eq!(silent.len(), 2);
    assert_eq!(silent[0], "an allowance gives no reason, so it allows nothing");
    assert_eq!(messages("", &lines("// kiln: allow(domains) x"))[0], "there is no lint `domains`");
}

#[test]
fn warning_stands_at_its_authors_line_and_breaks_nothing() {
    let files = Files::new(&[
        ("lib/m.wgsl", "// a comment\nfn half_of(d: f32) -> f32 {\n    return 0.5 / d;\n}\n"),
        (
            "a.wgsl",
            "import lib::m::half_of;\n@fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f { return vec4f(half_of(x)); }",
        ),
    ]);
    let outcome = lint(&Program::of("a.wgsl"), &set(&[]), &mut |path| files.0.get(path).cloned());
    let expected = "warning: division by a value that may be 0: -inf … inf
  --> lib/m.wgsl:3:12
  |
3 |     return 0.5 / d;
  |            ^^^^^^^
  note: imported by a.wgsl:1
  help: branch on `x != 0.0`, or keep it away from 0; or say `// kiln: allow(domain) why`";
    assert_eq!(rendered(&outcome), expected);
    assert_eq!(compiled(outcome), compiled(files.compile("a.wgsl", &[])));
}

#[test]
fn errors_are_as_without_the_lint() {
    let source = "@fragment fn fs_main() -> @location(0) vec4f { return vec4f(y); }";
    let outcome = linted(source);
    assert!(outcome.compiled.is_none());
    assert_eq!(outcome.diagnostics, Files::new(&[("a.wgsl", source)]).compile("a.wgsl", &[]).diagnostics);
}

/// What is found in a shader that users start from: file, line, message up to its numbers.
fn found(root: &str, features: &[&str]) -> Vec<String> {
    let files = shipped();
    let outcome = lint(&Program::of(root), &set(features), &mut |path| files.0.get(path).cloned());
    let diagnostics = outcome.diagnostics.iter();
    let mut lines: Vec<String> = diagnostics
        .map(|diagnostic| {
            let line = diagnostic.span.as_ref().map_or(0, |span| span.line);
            let message = diagnostic.message.split(':').next().unwrap_or_default();
            format!("{}:{line}: {message}", diagnostic.file.as_deref().unwrap_or_default())
        })
        .collect();
    lines.sort();
    lines
}

/// A snapshot: a new finding is to be looked at, a mended one to be taken out.
#[test]
fn shipped_shaders_have_known_findings_only() {
    let nothing: [&str; 0] = [];
    for root in ["shaders/pbr/background.wgsl", "shaders/pbr/tonemap.wgsl", "shaders/pbr/pbr.wgsl"] {
        assert_eq!(found(root, &[]), nothing, "{root}");
    }
    for feature in FEATURES {
        assert_eq!(found("shaders/pbr/pbr.wgsl", &[feature]), nothing, "{feature}");
    }
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    assert_eq!(found("shaders/pbr/pbr.wgsl", &all), nothing);
}

/// What no shipped shader uses, called with what its comments ask for.
#[test]
fn library_functions_have_known_findings_only() {
    let root = "import lib::brdf::{d_charlie, d_ggx, f_schlick_roughness, v_ashikhmin, v_smith_height_correlated};
        import lib::colour::{from_srgb, tone_map_aces_fitted};
        @fragment fn fs_main(@location(0) x: f32, @location(1) y: f32) -> @location(0) vec4f {
            let c = saturate(x);
            let alpha = clamp(y, 1e-3, 1.0);
            let d = d_ggx(c, 1.0 - c * c, alpha) * v_smith_height_correlated(c, c, alpha) + d_charlie(c, alpha) * v_ashikhmin(c, c);
            let f = f_schlick_roughness(vec3f(c), c, alpha);
            return vec4f(from_srgb(f) + tone_map_aces_fitted(vec3f(max(x, 0.0))), d);
        }";
    let mut files = shipped();
    files.0.insert("shaders/test/root.wgsl".to_owned(), root.into());
    let outcome =
        lint(&Program::of("shaders/test/root.wgsl"), &set(&[]), &mut |path| files.0.get(path).cloned());
    let messages: Vec<&str> = outcome.diagnostics.iter().map(|found| found.message.as_str()).collect();
    assert!(messages.is_empty(), "{messages:?}");
}

#[test]
fn every_function_of_wgsl_is_followed() {
    for expression in super::emit::EXPRESSIONS {
        let outcome = linted(&super::emit::sum(&[expression]));
        assert!(outcome.compiled.is_some(), "{expression}: {}", rendered(&outcome));
    }
}

#[test]
fn equal_input_gives_equal_findings() {
    let all: Vec<&str> = FEATURES.iter().copied().filter(|name| *name != "unlit").collect();
    assert_eq!(found("shaders/pbr/pbr.wgsl", &all), found("shaders/pbr/pbr.wgsl", &all));
}

/// As much as a module may hold, in the shapes that cost most.
#[test]
fn work_is_bounded() {
    let mut wide = String::new();
    for index in 0..4000 {
        writeln!(wide, "if x > {index}.5 {{ s += sqrt(x - {index}.0) / y; }}").unwrap();
    }
    let mut called = "fn f0x(x: f32) -> f32 { return x; }".to_owned();
    for index in 1..300 {
        let before = index - 1;
        let calls = format!("f{before}x(x) + ").repeat(12);
        write!(called, "fn f{index}x(x: f32) -> f32 {{ return {calls} 1.0 / x; }}").unwrap();
    }
    let mut nested = String::new();
    (0..60).for_each(|depth| {
        write!(nested, "for (var k{depth}x = 0; k{depth}x < 9; k{depth}x++) {{ s += 1.0 / s;").unwrap();
    });
    nested.push_str(&"}".repeat(60));
    let mut variables = String::new();
    (0..3000).for_each(|index| {
        write!(variables, "var v{index}x = x; if x > {index}.0 {{ v{index}x = y / v{index}x; }}").unwrap();
    });
    let (mut declared, mut went_on) = (String::new(), String::new());
    for index in 0..1000 {
        write!(declared, "var w{index}x = x + {index}.0;").unwrap();
        write!(went_on, "if x > w{index}x {{ w{index}x = y; if y > 0.5 {{ continue; }} }}").unwrap();
    }
    let shaders = [
        shader(
            "",
            &format!(
                "{declared} loop {{ if x > 1.0 {{ break; }} loop {{ if x > 2.0 {{ break; }} {went_on} }} }} return vec4f(w0x);"
            ),
        ),
        shader("", &format!("var s = 0.0; {wide} return vec4f(s);")),
        shader(&called, "return vec4f(f299x(x));"),
        shader("", &format!("var s = 0.0; {nested} return vec4f(s);")),
        shader("", &format!("{variables} return vec4f(x);")),
    ];
    for (index, source) in shaders.iter().enumerate() {
        let plain = Files::new(&[("a.wgsl", source)]).compile("a.wgsl", &[]);
        let start = Instant::now();
        let outcome = linted(source);
        let time = start.elapsed();
        assert_eq!(plain.compiled.is_some(), outcome.compiled.is_some());
        let is_cut = rendered(&outcome).contains("too large to be checked in full");
        assert_eq!(is_cut, index == 0, "{index}");
        assert!(time < Duration::from_secs(30), "{index}: {time:?}");
    }
}
