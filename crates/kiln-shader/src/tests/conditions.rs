//! `@if`, `@elif`, `@else` on everything they may stand before.

use super::{Files, compiled, rendered};

/// Canonical text of `text` for `features`.
#[track_caller]
fn canonical(text: &str, features: &[&str]) -> String {
    compiled(Files::new(&[("a.wgsl", text)]).compile("a.wgsl", features)).wgsl
}

/// A fragment shader that returns `f()`.
fn with_main(text: &str) -> String {
    format!("{text}\n@fragment fn fs_main() -> @location(0) vec4f {{ return vec4f(f()); }}")
}

#[track_caller]
fn check_same(conditional: &str, features: &[&str], plain: &str) {
    assert_eq!(canonical(&with_main(conditional), features), canonical(&with_main(plain), &[]));
}

#[test]
fn declaration_member_parameter_and_statement_are_cut() {
    let text = "
        @if(a) const X = 1.0;
        @else const X = 2.0;
        struct S { @if(a) p: array<vec2<f32>, 2>, @if(!a) @align(16) p: f32, q: f32 }
        fn g(@if(a) x: f32, y: f32, @if(!a) z: vec2<f32>) -> f32 { return y; }
        fn f() -> f32 {
            var s: S;
            @if(a) s.p[0].x = X;
            @else s.p = X;
            @if(a) return s.p[0].x + g(1.0, 2.0);
            @if(!a) return s.p + g(3.0, vec2f(4.0));
        }";
    check_same(
        text,
        &["a"],
        "struct S { p: array<vec2<f32>, 2>, q: f32 }
        fn g(x: f32, y: f32) -> f32 { return y; }
        fn f() -> f32 { var s: S; s.p[0].x = 1.0; return s.p[0].x + g(1.0, 2.0); }",
    );
    check_same(
        text,
        &[],
        "struct S { @align(16) p: f32, q: f32 }
        fn g(y: f32, z: vec2<f32>) -> f32 { return y; }
        fn f() -> f32 { var s: S; s.p = 2.0; return s.p + g(3.0, vec2f(4.0)); }",
    );
}

#[test]
fn chain_takes_the_first_branch_that_holds() {
    let text = "@if(a) fn f() -> f32 { return 1.0; }
        @elif(b && !c) fn f() -> f32 { return 2.0; }
        @elif(b) fn f() -> f32 { return 3.0; }
        @else fn f() -> f32 { return 4.0; }";
    for (features, value) in
        [(&["a", "b"][..], 1), (&["b"], 2), (&["b", "c"], 3), (&["c"], 4), (&[], 4), (&["a", "c"], 1)]
    {
        check_same(text, features, &format!("fn f() -> f32 {{ return {value}.0; }}"));
    }
}

#[test]
fn operators_bind_as_in_wgsl() {
    for (condition, features, holds) in [
        ("a || b && c", &["a"][..], true),
        ("(a || b) && c", &["a"], false),
        ("!a && (b || c)", &["c"], true),
        ("!(a && b)", &["a", "b"], false),
        ("!!a", &["a"], true),
        ("true", &[], true),
        ("false || a", &[], false),
    ] {
        let text =
            format!("@if({condition}) fn f() -> f32 {{ return 1.0; }} @else fn f() -> f32 {{ return 2.0; }}");
        check_same(&text, features, &format!("fn f() -> f32 {{ return {}.0; }}", if holds { 1 } else { 2 }));
    }
}

#[test]
fn blocks_and_control_flow_are_cut_whole() {
    let text = "fn f() -> f32 {
            var y = 0.0;
            @if(a) if y > 1.0 { y = 1.0; } else if y > 2.0 { y = 2.0; } else { y = 3.0; }
            @if(a) for (var i = 0; i < 3; i++) { y += 1.0; }
            @if(a) { y += 5.0; @if(b) { y += 6.0; } @else { y += 7.0; } }
            @else { y += 8.0; }
            switch 1 { @if(a) case 1: { y = 2.0; } default: {} }
            return y;
        }";
    check_same(text, &[], "fn f() -> f32 { var y = 0.0; { y += 8.0; } switch 1 { default: {} } return y; }");
    check_same(
        text,
        &["a"],
        "fn f() -> f32 {
            var y = 0.0;
            if y > 1.0 { y = 1.0; } else if y > 2.0 { y = 2.0; } else { y = 3.0; }
            for (var i = 0; i < 3; i++) { y += 1.0; }
            { y += 5.0; { y += 7.0; } }
            switch 1 { case 1: { y = 2.0; } default: {} }
            return y;
        }",
    );
}

#[test]
fn import_under_a_condition_is_not_followed_unless_it_holds() {
    let text = with_main("@if(a) import lib::x::f;\n@else import lib::y::{f};");
    let files = Files::new(&[("a.wgsl", &text), ("lib/y.wgsl", "fn f() -> f32 { return 1.0; }")]);
    let outcome = files.compile("a.wgsl", &[]);
    assert!(outcome.dependencies.iter().all(|dependency| dependency.path != "lib/x.wgsl"));
    compiled(outcome);
    assert!(rendered(&files.compile("a.wgsl", &["a"])).contains("`lib::x` was not found"));
}

#[test]
fn features_lists_what_conditions_name_even_in_cut_parts() {
    let text = with_main("@if(a) fn h() { @if(b) return; }\nfn f() -> f32 { return 1.0; }");
    let outcome = Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &["unrelated"]);
    assert_eq!(outcome.features, super::set(&["a", "b"]));
}

#[test]
fn comment_with_a_condition_is_a_comment() {
    check_same(
        "// @if(a)\n/* @if( /* nested */ */ fn f() -> f32 { return 1.0; }",
        &[],
        "fn f() -> f32 { return 1.0; }",
    );
}

#[test]
fn faulty_conditions_say_what_is_wrong_in_any_branch() {
    let cases = [
        ("@if(a fn f() {}", "`(` is never closed"),
        ("@if(a) ", "nothing follows this condition that it could apply to"),
        ("fn g() { @if(a) }", "nothing follows this condition that it could apply to"),
        ("@if(a b) fn f() {}", "expected `&&`, `||` or `)` in a condition"),
        ("@if() fn f() {}", "expected a feature name"),
        ("@if fn f() {}", "this condition has no parentheses"),
        ("@else fn f() {}", "`@else` without an `@if` before it"),
        ("@if(a) fn f() {} fn g() {} @else fn h() {}", "`@else` without an `@if` before it"),
        ("@if(a) @if(b) fn f() {}", "a second condition on the same element"),
        ("fn f() -> f32 { return max(@if(a) 1.0, 2.0); }", "a condition cannot stand here"),
        ("@if(a) fn f() { @if( ) return; }", "expected a feature name"),
    ];
    for (text, expected) in cases {
        let outcome = Files::new(&[("a.wgsl", text)]).compile("a.wgsl", &[]);
        let message = outcome.diagnostics.first().map(|diagnostic| diagnostic.message.as_str());
        assert_eq!(message, Some(expected), "for {text:?}");
    }
}
