//! Input nobody should write: limits give errors, and the worst that they allow neither panics nor overflows.

use std::fmt::Write;

use super::{Files, compiled, rendered};
use crate::limits::{EXPRESSION_DEPTH_MAX, MODULE_BYTES_MAX, MODULE_COUNT_MAX, NESTING_MAX};
use crate::token;

/// A fragment shader that returns `expression`.
fn returning(expression: &str) -> String {
    format!(
        "@fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f {{ return vec4f({expression}); }}"
    )
}

#[track_caller]
fn check_message(text: &str, expected: &str) {
    let outcome = Files::new(&[("a.wgsl", text)]).compile("a.wgsl", &[]);
    assert!(outcome.compiled.is_none(), "compiles, but should say {expected:?}");
    let messages = rendered(&outcome);
    assert!(messages.contains(expected), "no {expected:?} in:\n{messages}");
}

fn nested(open: &str, inner: &str, close: &str, count: usize) -> String {
    format!("{}{inner}{}", open.repeat(count), close.repeat(count))
}

#[test]
fn ten_thousand_parentheses_are_refused() {
    check_message(&returning(&nested("(", "x", ")", 10_000)), "brackets are nested deeper than 100");
    compiled(Files::new(&[("a.wgsl", &returning(&nested("(", "x", ")", 20)))]).compile("a.wgsl", &[]));
}

#[test]
fn long_chains_are_refused() {
    let too_long = EXPRESSION_DEPTH_MAX + 1;
    let limit = format!("more than {EXPRESSION_DEPTH_MAX} operators");
    check_message(&returning(&format!("{}x", "x+".repeat(too_long))), &limit);
    check_message(&returning(&format!("{}x", "-".repeat(too_long))), &limit);
    check_message(&returning(&format!("x{}", ".x".repeat(too_long))), &limit);
    check_message(&format!("alias T = {};", nested("array<", "f32", ">", too_long)), &limit);
    check_message(&else_chain(too_long), &limit);
}

/// naga's writer adds parentheses, so text that it accepts may come out too deep for it.
#[test]
fn chain_too_long_to_be_written_out_is_refused_and_a_long_one_is_not() {
    check_message(&returning(&format!("{}x", "x+".repeat(400))), "too long to be written out");
    compiled(Files::new(&[("a.wgsl", &returning(&format!("{}x", "x+".repeat(190))))]).compile("a.wgsl", &[]));
}

fn else_chain(count: usize) -> String {
    format!("@fragment fn fs_main() {{ var y = 1; if y < 0 {{}} {} }}", "else if true {}".repeat(count))
}

/// Runs on naga's thread with its real stack: an overflow would abort the test binary.
#[test]
fn deepest_allowed_input_ends_in_a_result() {
    let chain = EXPRESSION_DEPTH_MAX - 20;
    let texts = [
        returning(&format!("{}x", "x+".repeat(chain))),
        returning(&nested("(", "x", ")", NESTING_MAX - 3)),
        returning(&nested("sin(", "x", ")", NESTING_MAX - 3)),
        returning(&format!("{}x", "-".repeat(chain))),
        returning(&format!("{}true", "!".repeat(chain))),
        returning(&nested("x+sin(x*", "x", ")", NESTING_MAX - 3)),
        else_chain(chain / 3),
        format!("alias T = {};", nested("array<", "f32", ",2>", NESTING_MAX)),
        format!("@fragment fn fs_main() {}", nested("{", "", "}", NESTING_MAX)),
        format!("@fragment fn fs_main() {{ {} }}", nested("loop {", "break;", "}", NESTING_MAX - 2)),
        format!("@if({}a) fn f() {{}}", "!".repeat(chain)),
    ];
    for text in texts {
        let outcome = Files::new(&[("a.wgsl", &text)]).compile("a.wgsl", &[]);
        assert!(outcome.compiled.is_some() != kiln_diagnostic::has_errors(&outcome.diagnostics));
        assert!(!rendered(&outcome).contains("compiler failed"), "{}", rendered(&outcome));
    }
}

#[test]
fn binary_garbage_is_not_text() {
    let bytes: Vec<u8> = (0..=255).cycle().take(5000).collect();
    check_message(&String::from_utf8_lossy(&bytes), "this is not a UTF-8 text");
}

#[test]
fn unclosed_and_crossed_brackets_point_at_the_bracket() {
    check_message("fn f() {\n", "`{` is never closed\n  --> a.wgsl:1:8");
    check_message("fn f() { (] }", "`]` does not close `(`\n  --> a.wgsl:1:11");
    check_message("fn f() {} )", "`)` closes nothing\n  --> a.wgsl:1:11");
    check_message("fn f() {} /* /* */", "`/*` is never closed\n  --> a.wgsl:1:11");
}

#[test]
fn oversized_module_is_refused() {
    let text = " ".repeat(MODULE_BYTES_MAX + 1);
    check_message(&text, "module has 1048577 bytes, the limit is 1048576");
}

#[test]
fn endless_imports_are_refused() {
    let files: Vec<(String, String)> = (0..=MODULE_COUNT_MAX)
        .map(|index| {
            (format!("m{index}.wgsl"), format!("import m{}::f{};\nfn f{index}() {{}}", index + 1, index + 1))
        })
        .collect();
    let files: Vec<(&str, &str)> = files.iter().map(|(path, text)| (path.as_str(), text.as_str())).collect();
    let messages = rendered(&Files::new(&files).compile("m0.wgsl", &[]));
    assert!(
        messages.starts_with("error: more than 256 modules are imported\n  --> m255.wgsl:1:8"),
        "{messages}"
    );
}

/// Every prefix of a module, and every module with one byte replaced, gives a result.
#[test]
fn mutated_modules_never_panic() {
    let text = "import b::f;\n@if(a || !b) struct S { @if(a) x: array<f32, 2>, y: f32 }\n@else const T: f32 = 1.0e-3;\n/* c */ @fragment fn fs_main() -> @location(0) vec4f { let p = 0x1p-2; return vec4f(f(p)); }";
    let library = "fn f(x: f32) -> f32 { return x; }";
    let mut variants: Vec<String> = (0..text.len()).map(|end| text[..end].to_owned()).collect();
    for (at, with) in (0..text.len()).flat_map(|at| ["{", ")", "@", "::", "é"].map(|with| (at, with))) {
        variants.push(format!("{}{with}{}", &text[..at], &text[at + 1..]));
    }
    let mut failed = 0;
    for variant in variants {
        let outcome = Files::new(&[("a.wgsl", &variant), ("b.wgsl", library)]).compile("a.wgsl", &[]);
        let has_errors = kiln_diagnostic::has_errors(&outcome.diagnostics);
        assert!(outcome.compiled.is_some() != has_errors, "for {variant:?}");
        failed += usize::from(has_errors);
    }
    assert!(failed > 500, "only {failed} variants fail: the mutations do not bite");
    compiled(Files::new(&[("a.wgsl", text), ("b.wgsl", library)]).compile("a.wgsl", &[]));
}

#[test]
fn tokens_cover_all_but_space_and_comments() {
    let text = "a1 _b // c\n/* d /* e */ */ 1.5e-3f 0x1p+2 .5 1.x ä @@";
    let tokens = token::tokenize(text).unwrap();
    let words = tokens.iter().fold(String::new(), |mut words, token| {
        let _ = write!(words, "[{}]", &text[token.range()]);
        words
    });
    assert_eq!(words, "[a1][_b][1.5e-3f][0x1p+2][.5][1.x][ä][@][@]");
}
