//! What the user reads when something is wrong: whole messages, at their author's file, line and column.

use super::{Files, compiled, rendered};

/// A fragment shader that returns `f()`, imported from lib/b.wgsl.
const ROOT: &str =
    "import lib::b::f;\n@fragment\nfn fs_main() -> @location(0) vec4f {\n    return vec4f(f());\n}\n";

#[track_caller]
fn check(files: &[(&str, &str)], features: &[&str], expected: &str) {
    let outcome = Files::new(files).compile("a.wgsl", features);
    assert_eq!(rendered(&outcome), expected.trim_matches('\n'));
    assert!(outcome.compiled.is_none(), "an error gives no artefact");
}

#[test]
fn typo_in_root_suggests_the_name() {
    let text = "fn half(x: f32) -> f32 { return x; }\n@fragment\nfn fs_main() -> @location(0) vec4f {\n    return vec4f(hlaf(1.0));\n}\n";
    check(
        &[("a.wgsl", text)],
        &[],
        "
error: no definition in scope for identifier: `hlaf`
  --> a.wgsl:4:18
  |
4 |     return vec4f(hlaf(1.0));
  |                  ^^^^
  help: did you mean `half`?
",
    );
    let corrected = text.replace("hlaf", "half");
    compiled(Files::new(&[("a.wgsl", &corrected)]).compile("a.wgsl", &[]));
}

#[test]
fn typo_in_imported_module_points_there() {
    check(
        &[
            ("a.wgsl", ROOT),
            (
                "lib/b.wgsl",
                "// ä comment\n\nfn f() -> f32 {\n    let roughness = 1.0;\n    return roughnes;\n}\n",
            ),
        ],
        &[],
        "
error: no definition in scope for identifier: `roughnes`
  --> lib/b.wgsl:5:12
  |
5 |     return roughnes;
  |            ^^^^^^^^
  note: imported by a.wgsl:1
  help: did you mean `roughness`?
",
    );
}

#[test]
fn import_chain_is_named_up_to_the_root() {
    check(
        &[
            ("a.wgsl", ROOT),
            ("lib/b.wgsl", "\nimport super::c::g;\nfn f() -> f32 { return g(); }"),
            ("lib/c.wgsl", "fn g() -> f32 { return h; }"),
        ],
        &[],
        "
error: no definition in scope for identifier: `h`
  --> lib/c.wgsl:1:24
  |
1 | fn g() -> f32 { return h; }
  |                        ^
  note: imported by lib/b.wgsl:2
  note: imported by a.wgsl:1
  help: did you mean `f`?
",
    );
}

#[test]
fn type_error_after_cuts_points_at_the_authors_line() {
    let module = "@if(sheen)\nfn g() -> f32 { return 1.0; }\n\nfn f() -> f32 {\n    @if(sheen) let y = g();\n    @else let y = 2u;\n    return y;\n}\n";
    let files = [("a.wgsl", ROOT), ("lib/b.wgsl", module)];
    check(
        &files,
        &[],
        "
error: the function returns `f32`, this value is `u32`
  --> lib/b.wgsl:6:19
  |
6 |     @else let y = 2u;
  |                   ^^
  note: function 'f' is invalid
  note: see: lib/b.wgsl:4:1
  note: imported by a.wgsl:1
",
    );
    compiled(Files::new(&files).compile("a.wgsl", &["sheen"]));
}

#[test]
fn missing_semicolon_names_the_line_before() {
    check(
        &[(
            "a.wgsl",
            "@fragment\nfn fs_main() -> @location(0) vec4f {\n    let x = 1.0 // one\n    return vec4f(x);\n}\n",
        )],
        &[],
        "
error: expected `;`, found \"return\"
  --> a.wgsl:4:5
  |
4 |     return vec4f(x);
  |     ^^^^^^
  help: a `;` may be missing at the end of line 3
",
    );
}

#[test]
fn wrong_argument_is_named_with_its_type() {
    check(
        &[(
            "a.wgsl",
            "fn f(x: f32) -> f32 { return x; }\n@fragment\nfn fs_main() -> @location(0) vec4f {\n    return vec4f(f(1u));\n}\n",
        )],
        &[],
        "
error: argument 1 of `f` must be `f32`, this value is `u32`
  --> a.wgsl:4:20
  |
4 |     return vec4f(f(1u));
  |                    ^^
  note: entry point fs_main at Fragment is invalid
  note: invalid function call: a.wgsl:4:18
",
    );
}

#[test]
fn colliding_bindings_name_the_variable() {
    check(
        &[(
            "a.wgsl",
            "@group(0) @binding(0) var<uniform> u: f32;\n@group(0) @binding(0) var<uniform> v: f32;\n@fragment\nfn fs_main() -> @location(0) vec4f { return vec4f(u + v); }\n",
        )],
        &[],
        "
error: `v` has the group and binding of another variable
  --> a.wgsl:2:23
  |
2 | @group(0) @binding(0) var<uniform> v: f32;
  |                       ^^^^^^^^^^^^^^^^^^^^
  note: entry point fs_main at Fragment is invalid
",
    );
}

#[test]
fn unknown_member_is_suggested_from_the_module_of_its_struct() {
    check(
        &[
            (
                "a.wgsl",
                "import b::M;\n@group(0) @binding(0) var<uniform> m: M;\n@fragment\nfn fs_main() -> @location(0) vec4f { return vec4f(m.rogh); }\n",
            ),
            ("b.wgsl", "struct M { rough: f32 }"),
        ],
        &[],
        "
error: invalid field accessor `rogh`
  --> a.wgsl:4:53
  |
4 | fn fs_main() -> @location(0) vec4f { return vec4f(m.rogh); }
  |                                                     ^^^^
  help: did you mean `rough`?
",
    );
}

#[test]
fn f16_is_refused_because_not_every_device_has_it() {
    check(
        &[(
            "a.wgsl",
            "enable f16;\n@fragment\nfn fs_main() -> @location(0) vec4f { let x = 1.0h; return vec4f(f32(x)); }",
        )],
        &[],
        "
error: using `f16` values requires the `naga::valid::Capabilities::FLOAT16` flag
  --> a.wgsl:3:46
  |
3 | fn fs_main() -> @location(0) vec4f { let x = 1.0h; return vec4f(f32(x)); }
  |                                              ^^^^
  note: entry point fs_main at Fragment is invalid
  help: Kiln compiles for devices without optional features: use `f32`
",
    );
}

#[test]
fn missing_module_lists_where_it_was_searched() {
    let files = Files::new(&[("shaders/pbr/a.wgsl", "import lib::b::f;")]);
    let outcome = files.compile("shaders/pbr/a.wgsl", &[]);
    assert_eq!(
        rendered(&outcome),
        "error: module `lib::b` was not found
  --> shaders/pbr/a.wgsl:1:8
  |
1 | import lib::b::f;
  |        ^^^^^^
  note: searched: shaders/pbr/lib/b.wgsl, shaders/lib/b.wgsl, lib/b.wgsl
  help: create one of these, or correct the path"
    );
}

#[test]
fn missing_module_of_a_name_with_a_path_is_shown_there() {
    check(
        &[
            ("a.wgsl", "import lib::b;\nfn f() -> f32 { return b::x + lib::c::y; }"),
            ("lib/b.wgsl", "const x = 1.0;"),
        ],
        &[],
        "
error: module `lib::c` was not found
  --> a.wgsl:2:31
  |
2 | fn f() -> f32 { return b::x + lib::c::y; }
  |                               ^^^^^^
  note: searched: lib/c.wgsl
  help: create one of these, or correct the path
",
    );
}

#[test]
fn cycle_shows_its_chain() {
    check(
        &[
            ("a.wgsl", "import b::f;\nfn e() {}"),
            ("b.wgsl", "import c::g;\nfn f() {}"),
            ("c.wgsl", "import b::f;\nfn g() {}"),
        ],
        &[],
        "
error: modules import each other: b.wgsl → c.wgsl → b.wgsl
  --> c.wgsl:1:8
  |
1 | import b::f;
  |        ^
  note: imported by b.wgsl:1
  note: imported by a.wgsl:1
  help: move what both need into a third module
",
    );
}

#[test]
fn import_of_itself_is_a_cycle() {
    let outcome = Files::new(&[("a.wgsl", "import a::f;\nfn f() {}")]).compile("a.wgsl", &[]);
    assert!(rendered(&outcome).starts_with("error: modules import each other: a.wgsl → a.wgsl\n"));
}

#[test]
fn variable_declared_in_two_modules_names_both() {
    check(
        &[
            ("a.wgsl", "import b::f;\nimport c::g;\n"),
            ("b.wgsl", "fn f() {}\nvar<private> PI: f32;"),
            ("c.wgsl", "fn g() {}\n\nvar<private> PI: f32;"),
        ],
        &[],
        "
error: `PI` is declared twice
  --> c.wgsl:3:14
  |
3 | var<private> PI: f32;
  |              ^^
  note: imported by a.wgsl:2
  note: first declared at b.wgsl:2:14
",
    );
}

#[test]
fn unknown_imported_name_is_suggested() {
    check(
        &[("a.wgsl", "import b::{d_gxg, f_schlick};"), ("b.wgsl", "fn d_ggx() {}\nfn f_schlick() {}")],
        &[],
        "
error: module `b.wgsl` does not declare `d_gxg`
  --> a.wgsl:1:12
  |
1 | import b::{d_gxg, f_schlick};
  |            ^^^^^
  help: did you mean `d_ggx`?
",
    );
}

#[test]
fn import_of_a_name_that_a_condition_cut_says_so() {
    let files =
        [("a.wgsl", "import b::f;\n@fragment fn fs_main() { f(); }"), ("b.wgsl", "@if(sheen) fn f() {}")];
    check(
        &files,
        &[],
        "
error: module `b.wgsl` does not declare `f`
  --> a.wgsl:1:11
  |
1 | import b::f;
  |           ^
  help: `f` is declared there under an `@if` that does not hold; put this import under the same `@if`
",
    );
    compiled(Files::new(&files).compile("a.wgsl", &["sheen"]));
}

#[test]
fn faults_of_all_modules_are_reported_at_once() {
    let files = [
        ("a.wgsl", "import b::f;\nimport nowhere::g;\nfn e() { ("),
        ("b.wgsl", "import c::h;\n@else fn f() {}"),
        ("c.wgsl", "fn h() {} }"),
    ];
    // Imports of a module with unbalanced brackets are not followed: its tokens have no structure.
    let text = rendered(&Files::new(&files).compile("a.wgsl", &[]));
    assert_eq!(text.matches("error:").count(), 1, "{text}");
    let balanced = [("a.wgsl", "import b::f;\nimport nowhere::g;\n"), files[1], files[2]];
    let text = rendered(&Files::new(&balanced).compile("a.wgsl", &[]));
    for part in ["`nowhere` was not found", "b.wgsl:2:2", "`}` closes nothing"] {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
}

#[test]
fn missing_root_is_an_error_and_a_dependency() {
    let outcome = Files::new(&[]).compile("a.wgsl", &[]);
    assert_eq!(rendered(&outcome), "error: shader `a.wgsl` does not exist\n  --> a.wgsl");
    assert_eq!(outcome.dependencies.len(), 1);
    assert!(!outcome.dependencies[0].found);
}

#[test]
fn empty_file_has_no_entry_point() {
    check(
        &[("a.wgsl", "")],
        &[],
        "
error: this shader has no entry point
  --> a.wgsl
  help: mark a function with `@vertex`, `@fragment` or `@compute`
",
    );
}

#[test]
fn import_syntax_faults_say_what_to_write() {
    let cases = [
        ("import b::f as ;", "expected a new name in an import"),
        ("import b::{f as g, g as g};", "`g` is imported from two modules"),
        ("import b::{c::f};", "module `b::c` was not found"),
        ("import b::f;\nfn f() {}", "`f` is declared twice"),
        ("import b::{f, g,,};", "expected a module path in an import"),
        ("import b;", "an import names a module and what it takes from it"),
        ("import b::{};", "this import takes nothing"),
        ("import b::f", "expected `;` after an import"),
        ("import ::f;", "expected a module path in an import"),
        ("import super::super::b::f;", "`super::super::b` names no module inside the project"),
        ("fn f() {}\nimport b::g;", "imports stand before all declarations"),
    ];
    for (text, expected) in cases {
        let outcome =
            Files::new(&[("a.wgsl", text), ("b.wgsl", "fn f() {}\nfn g() {}")]).compile("a.wgsl", &[]);
        let message = outcome.diagnostics.first().map(|diagnostic| diagnostic.message.as_str());
        assert_eq!(message, Some(expected), "for {text:?}");
    }
}

#[test]
fn first_fault_of_every_module_is_reported() {
    let files = Files::new(&[
        (
            "a.wgsl",
            "import b::f;\nimport c::g;\n@fragment fn fs_main() -> @location(0) vec4f { return vec3f(f() + g()); }",
        ),
        ("b.wgsl", "fn f() -> f32 { return missing; }\nfn also() -> f32 { return gone; }"),
        ("c.wgsl", "import d::h;\nfn g() -> f32 { return h() + true; }"),
        ("d.wgsl", "fn h() -> f32 { return 1.0; }"),
        ("e.wgsl", "import d::h;\n@fragment fn fs_main() -> @location(0) vec4f { return vec3f(h()); }"),
    ]);
    let places = |root: &str| -> Vec<(String, u32)> {
        let outcome = files.compile(root, &[]);
        assert!(outcome.compiled.is_none());
        let diagnostics = outcome.diagnostics.into_iter();
        diagnostics.map(|found| (found.file.unwrap(), found.span.unwrap().line)).collect()
    };
    let place = |file: &str, line: u32| (file.to_owned(), line);
    // The broken functions are known by their heads.
    assert_eq!(places("a.wgsl"), [place("a.wgsl", 3), place("b.wgsl", 1), place("c.wgsl", 2)]);
    assert_eq!(places("e.wgsl"), [place("e.wgsl", 2)]);
}

#[test]
fn what_only_follows_from_a_broken_declaration_is_not_reported() {
    let root = "import b::{S, f};\nfn g(s: S) -> f32 { return s.x; }\n@fragment fn fs_main() -> @location(0) vec4f { return vec4f(g(S()) + f(), LIMIT); }";
    let places = |root: &str, b: &str| -> Vec<String> {
        let outcome = Files::new(&[("a.wgsl", root), ("b.wgsl", b)]).compile("a.wgsl", &[]);
        outcome.diagnostics.into_iter().map(|found| found.file.unwrap()).collect()
    };
    let broken = "struct S { x: flaot }\nfn f() -> f32 { return 1.0; }\nconst LIMIT = oops;";
    assert_eq!(places(root, broken), ["b.wgsl"]);
    // The twin: what the root has wrong besides is.
    let root = format!("{root}\nfn own() -> f32 {{ return 1u; }}");
    assert_eq!(places(&root, broken), ["a.wgsl", "b.wgsl"]);
}

#[test]
fn assertion_hides_no_fault_of_another_module() {
    let root = "import b::LIMIT;\nfn own() -> f32 { return 1u; }\n@fragment fn fs_main() -> @location(0) vec4f { return vec4f(LIMIT); }";
    let places = |b: &str| -> Vec<String> {
        let outcome = Files::new(&[("a.wgsl", root), ("b.wgsl", b)]).compile("a.wgsl", &[]);
        outcome.diagnostics.into_iter().map(|found| found.file.unwrap()).collect()
    };
    assert_eq!(places("const LIMIT = oops;\nconst_assert LIMIT > 2.0;"), ["a.wgsl", "b.wgsl"]);
    assert_eq!(places("const LIMIT = 1.0;\nconst_assert LIMIT > 2.0;"), ["a.wgsl", "b.wgsl"]);
    assert_eq!(places("const LIMIT = 3.0;\nconst_assert LIMIT > 2.0;"), ["a.wgsl"]);
}

#[test]
fn module_that_ends_within_a_declaration_is_named_and_not_the_one_behind_it() {
    let root = "import b::LIMIT;\nfn own() -> f32 { return LIMIT; }\n@fragment fn fs_main() -> @location(0) vec4f { return vec4f(own()); }";
    let said = |end: &str| {
        let b = format!("const LIMIT: f32 = 1.0; // first\n{end}");
        let outcome = Files::new(&[("a.wgsl", root), ("b.wgsl", &b)]).compile("a.wgsl", &[]);
        let said = outcome.diagnostics.into_iter().map(|found| {
            let span = found.span.unwrap();
            format!("{} {}:{} {}", found.file.unwrap(), span.line, span.column, found.message)
        });
        said.collect::<Vec<String>>().join("\n")
    };
    for (end, column) in [
        ("const A = 1.0", 11),
        ("fn f() -> f32", 11),
        ("@fragment", 2),
        ("@group(0) @binding(1) var<uniform> x: vec4f // last", 39),
        ("struct", 1),
        ("const_assert", 1),
    ] {
        assert_eq!(said(end), format!("b.wgsl 2:{column} this module ends within a declaration"), "{end}");
    }
    for end in ["", "const A = 1.0;", "fn f() { }", "struct S { x: f32 };", "const_assert true;"] {
        assert_eq!(said(end), "", "{end}");
    }
}

#[test]
fn types_that_do_not_go_together_are_named_as_their_author_writes_them() {
    let message = |statement: &str| {
        let text = format!(
            "var<private> v: vec3f;\nvar<private> u: u32;\nfn f(x: f32) -> f32 {{ return x; }}\n@fragment fn fs_main() {{ {statement} }}"
        );
        rendered(&Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &[]))
            .lines()
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let expected = [
        ("let x = v + vec2f(1.0);", "error: `+` does not take `vec3<f32>` and `vec2<f32>`"),
        ("let x = -u;", "error: `-` does not take `u32`"),
        ("let x = u && true;", "error: `&&` does not take `u32`"),
        ("if u { }", "error: the condition of `if` must be `bool`, this is `u32`"),
        ("let x = f(v);", "error: argument 1 of `f` must be `f32`, this value is `vec3<f32>`"),
        ("let x = v + v.x;", ""),
    ];
    let actual = expected.map(|(statement, _)| (statement, message(statement)));
    assert_eq!(actual, expected.map(|(statement, expected)| (statement, expected.to_owned())));
}

#[test]
fn what_depends_on_overrides_outside_of_functions_is_refused_by_name_and_place() {
    let said = |declarations: &str, attribute: &str, statement: &str| {
        let text = format!(
            "override n: u32 = 8u;\n{declarations}\n{attribute} fn main() {{ {statement} }}\n@group(0) @binding(0) var<storage, read_write> out: array<u32>;"
        );
        let outcome = Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &[]);
        let found = outcome.diagnostics.first().map(|found| {
            let span = found.span.as_ref().unwrap();
            assert!(found.help.is_some());
            format!("{}:{} {}", span.line, span.column, found.message)
        });
        found.unwrap_or_default()
    };
    let plain = "@compute @workgroup_size(1)";
    let ending = "an override, which only functions may do";
    for (declarations, attribute, statement, expected) in [
        ("override b: u32 = 4u / n;", plain, "out[0] = b;", "2:19 the default value of `b` computes with"),
        (
            "var<private> p: u32 = n * 2u;",
            plain,
            "out[0] = p;",
            "2:23 the initial value of `p` computes with",
        ),
        ("var<workgroup> w: array<u32, n>;", plain, "out[0] = w[1];", "2:1 the length of `w` depends on"),
        ("var<workgroup> w: array<u32, n * 2>;", plain, "out[0] = w[1];", "2:1 the length of `w` depends on"),
        ("", "@compute @workgroup_size(4, n)", "", "3:29 the workgroup size of `main` depends on"),
    ] {
        let found = said(declarations, attribute, statement);
        assert_eq!(found, format!("{expected} {ending}"), "{declarations}");
    }
    // The twins: what is plain, and what nobody uses.
    assert_eq!(said("override b: u32 = n; var<private> p: u32 = n;", plain, "out[0] = 4u / b + p;"), "");
    assert_eq!(said("override b: u32 = 4u / n;", plain, ""), "");
}
