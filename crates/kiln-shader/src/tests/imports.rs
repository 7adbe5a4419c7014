//! Names across modules: what each means, whatever others call theirs.

use super::{Files, compiled, rendered};

const MAIN: &str = "@fragment fn fs_main() -> @location(0) vec4f { return vec4f(result()); }";

/// Canonical text of a root that returns `result()`.
#[track_caller]
fn canonical(root: &str, modules: &[(&str, &str)]) -> String {
    let root = format!("{root}\n{MAIN}");
    let files: Vec<(&str, &str)> =
        [("a.wgsl", root.as_str())].into_iter().chain(modules.iter().copied()).collect();
    compiled(Files::new(&files).compile("a.wgsl", &[])).wgsl
}

const B: (&str, &str) = (
    "lib/b.wgsl",
    "const GAIN = 2.0; struct Pair { x: f32, GAIN: f32 }
    fn half(x: f32) -> f32 { return x * 0.5; } fn pair() -> Pair { return Pair(GAIN, 3.0); }",
);
const C: (&str, &str) =
    ("lib/c.wgsl", "const GAIN = 5.0; fn half(x: f32) -> f32 { return x * 0.25 * GAIN; }");

/// All ways to say the same give the same text, but for the names that two modules share.
#[test]
fn alias_path_module_and_nested_import_mean_the_same() {
    let plain = canonical("import lib::b::{half, GAIN}; fn result() -> f32 { return half(GAIN); }", &[B]);
    for root in [
        "import lib::b::{half as h, GAIN as G}; fn result() -> f32 { return h(G); }",
        "import lib::b; fn result() -> f32 { return b::half(b::GAIN); }",
        "import lib::b as other; fn result() -> f32 { return other::half(other::GAIN); }",
        "fn result() -> f32 { return lib::b::half(package::lib::b::GAIN); }",
        "import lib::{b::{half, GAIN}}; fn result() -> f32 { return half(GAIN); }",
        "import lib::{b, b::GAIN}; fn result() -> f32 { return b::half(GAIN); }",
        "@if(!none) import lib::b as b; @if(none) import lib::c as b; fn result() -> f32 { return b::half(b::GAIN); }",
    ] {
        assert_eq!(canonical(root, &[B]), plain, "{root}");
    }
}

#[test]
fn two_modules_may_declare_the_same_names() {
    let root = "import lib::{b, c}; const GAIN = 7.0;
        fn result() -> f32 { return b::half(b::GAIN) + c::half(c::GAIN) + GAIN + b::pair().GAIN; }";
    let text = canonical(root, &[B, C]);
    // Constants are folded: each call has its own module's value.
    for part in ["half(2f)", "half_c(5f)", "+ 7f"] {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
    assert!(text.contains("GAIN: f32"), "a member keeps its name:\n{text}");
}

/// The plain name is a local's in the importer: it must not capture what the alias stands for.
#[test]
fn local_does_not_capture_an_aliased_name() {
    let root = "import lib::b::half as h; fn result() -> f32 { let half = 3.0; return h(half); }";
    let text = canonical(root, &[B]);
    assert!(text.contains("let value_1 = 3f") && text.contains("half_b(value_1)"), "{text}");
    let capturing = "import lib::b::half; fn result() -> f32 { let half = 3.0; return half(half); }";
    let outcome = Files::new(&[("a.wgsl", &format!("{capturing}\n{MAIN}")), B]).compile("a.wgsl", &[]);
    assert!(outcome.compiled.is_none(), "the author's own shadowing stays an error");
}

#[test]
fn local_that_would_capture_a_path_is_refused() {
    let root = "import lib::b::GAIN; fn f(GAIN: f32) -> f32 { return GAIN * lib::b::GAIN; } fn result() -> f32 { return f(1.0); }";
    let outcome = Files::new(&[("a.wgsl", &format!("{root}\n{MAIN}")), B]).compile("a.wgsl", &[]);
    let message =
        "error: `GAIN` is a local here, and is imported under another name too\n  --> a.wgsl:1:27\n";
    assert!(rendered(&outcome).starts_with(message), "{}", rendered(&outcome));
    // Without the local both names mean the same, and without the import the local is told apart.
    let text = canonical("import lib::b::GAIN; fn result() -> f32 { return GAIN * lib::b::GAIN; }", &[B]);
    assert!(text.contains("vec4(4f)") || text.contains("4f"), "{text}");
    let apart =
        "fn f(GAIN: f32) -> f32 { return GAIN * lib::b::GAIN; } fn result() -> f32 { return f(1.0); }";
    assert!(canonical(apart, &[B]).contains("* 2f"), "{}", canonical(apart, &[B]));
}

#[test]
fn module_of_the_same_folder_and_paths_in_attributes_are_found() {
    let module = ("k.wgsl", "const N = 8; const M = 2;");
    let root = "import super::k;
        @group(0) @binding(k::M) var<storage, read_write> out: f32;
        @compute @workgroup_size(package::k::N) fn main() { out = f32(k::N); }";
    let compiled = compiled(Files::new(&[("a.wgsl", root), module]).compile("a.wgsl", &[]));
    assert_eq!(compiled.reflection.entry_points[0].workgroup_size, [8, 1, 1]);
    assert_eq!(compiled.reflection.bindings[0].binding, 2);
}

#[test]
fn variable_keeps_the_name_it_is_bound_by() {
    let module =
        ("lib/v.wgsl", "@group(0) @binding(0) var<uniform> tint: vec4f; fn own() -> f32 { return tint.x; }");
    let root =
        "import lib::v::tint as t; const own = 1.0; fn result() -> f32 { return t.x * own + lib::v::own(); }";
    let text = canonical(root, &[module]);
    assert!(text.contains("var<uniform> tint: vec4<f32>"), "{text}");
    let captured = "import lib::v::tint as t; fn result() -> f32 { let tint = 1.0; return t.x * tint; }";
    let outcome = Files::new(&[("a.wgsl", &format!("{captured}\n{MAIN}")), module]).compile("a.wgsl", &[]);
    let message = "error: `tint` means something else here than in `lib/v.wgsl`\n  --> a.wgsl:1:52\n";
    assert!(rendered(&outcome).starts_with(message), "{}", rendered(&outcome));
}

/// Places stay exact where names were replaced by longer ones.
#[test]
fn errors_after_a_renamed_name_are_at_their_column() {
    let root =
        "import lib::{b, c}; const half = 1.0;\nfn result() -> f32 { return half + c::half(1.0) + missing; }";
    let outcome = Files::new(&[("a.wgsl", &format!("{root}\n{MAIN}")), B, C]).compile("a.wgsl", &[]);
    let span = outcome.diagnostics[0].span.clone().expect("a place");
    assert_eq!((span.line, span.column, span.length_chars), (2, 51, 7), "{}", rendered(&outcome));
}

#[test]
fn name_that_a_module_does_not_have_is_suggested_with_its_path() {
    let root = "import lib::b; fn result() -> f32 { return b::hlaf(1.0); }";
    let outcome = Files::new(&[("a.wgsl", &format!("{root}\n{MAIN}")), B]).compile("a.wgsl", &[]);
    let text = rendered(&outcome);
    assert!(text.contains("module `lib/b.wgsl` does not declare `hlaf`\n  --> a.wgsl:1:47"), "{text}");
    assert!(text.contains("did you mean `half`?"), "{text}");
}
