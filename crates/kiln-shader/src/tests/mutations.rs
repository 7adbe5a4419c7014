//! Programs nobody should write: limits give errors, mutations neither panic nor hang.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::cases::{Case, cases, summary};
use super::damage::{bytes, tokens};
use super::random::Random;
use super::rendered;

const HEAD: &str = "#version 450\nlayout(location = 0) out vec4 colour;\n";

#[track_caller]
fn check_message(text: &str, expected: &str) {
    let case = Case::of(&[("a.frag", &format!("{HEAD}{text}"))]);
    let outcome = case.compile();
    assert!(outcome.compiled.is_none(), "compiles, but should say {expected:?}");
    assert!(rendered(&outcome).contains(expected), "no {expected:?} in:\n{}", rendered(&outcome));
}

fn main_with(statement: &str) -> String {
    format!("void main() {{ float x = 1.0; {statement} colour = vec4(x); }}")
}

#[test]
fn long_and_deep_expressions_are_refused_and_shorter_ones_are_not() {
    check_message(&main_with(&format!("x = {}x;", "x+".repeat(600))), "more than 500 operators");
    check_message(&main_with(&format!("x = {}x;", "-".repeat(600))), "more than 500 operators");
    check_message(
        &main_with(&format!("{} x = 2.0;", "if (x > 1.0) x = 1.0; else ".repeat(600))),
        "more than 200 statements",
    );
    check_message(&main_with(&"{".repeat(200)), "brackets are nested deeper than 100");
    check_message("#if ((((((((((1\n#endif\nvoid main() {}", "expected `)`");
    check_message(&format!("#if {}1\n#endif\nvoid main() {{}}", "!".repeat(1000)), "nest at most 64 deep");
    check_message(
        &format!("#define F(x) x\nfloat y = {}1.0{};", "F(".repeat(90), ")".repeat(90)),
        "macro calls nest at most 64 deep",
    );
    let text = format!("{HEAD}{}", main_with(&format!("x = {}x;", "x+".repeat(90))));
    assert!(Case::of(&[("a.frag", &text)]).compile().compiled.is_some());
}

/// naga panics on these.
#[test]
fn types_larger_than_memory_are_refused() {
    let text = "void main() { float x[3]; x[1] = 2.0; colour = vec4(x[1]); }\nfloat huge[2147483647];\nuniform vec4 tint;";
    check_message(text, "an array or struct has 2 GiB or more");
}

/// Runs on naga's thread with its real stack: an overflow would abort the test binary.
#[test]
fn deepest_allowed_input_ends_in_a_result() {
    let texts = [
        main_with(&format!("x = {}x;", "x+".repeat(470))),
        main_with(&format!("x = {}x{};", "(".repeat(90), ")".repeat(90))),
        main_with(&format!("x = {}x{};", "sin(".repeat(90), ")".repeat(90))),
        main_with(&format!("x = {}x;", "-".repeat(470))),
        main_with(&format!("x = {}x;", "x > 1.0 ? x : ".repeat(150))),
        main_with(&format!("{}{}", "{".repeat(95), "}".repeat(95))),
        main_with(&format!("{} x = 2.0;", "for (;;) ".repeat(190))),
        main_with(&format!("{} x = 2.0;", "if (x > 1.0) ".repeat(190))),
        main_with(&format!("{} x = 2.0;", "while (x > 1.0) ".repeat(190))),
        format!("float a{}; void main() {{}}", "[2]".repeat(400)),
    ];
    for text in texts {
        let outcome = Case::of(&[("a.frag", &format!("{HEAD}{text}"))]).compile();
        assert!(outcome.compiled.is_some() != kiln_diagnostic::has_errors(&outcome.diagnostics));
    }
}

/// Large input of each kind whose work could grow faster than the input: about half a mebibyte.
#[test]
fn large_input_takes_time_in_proportion() {
    let texts = [
        "uniform sampler2D a;\n".repeat(20_000),
        (0..20_000).map(|index| format!("uniform sampler2D a{index};\n")).collect(),
        (0..20_000).map(|index| format!("in vec4 a{index}; out vec4 b{index};\n")).collect(),
        main_with(&"double x; ".repeat(40_000)),
        main_with(&"switch (1) { case 0: x = 1.0; case 1: x = 2.0; } ".repeat(8_000)),
        main_with(&"x = a[]; ".repeat(40_000)),
        (0..20_000).map(|index| format!("#define A{index} A{} x\n", index + 1)).collect::<String>()
            + "float y = A0;",
        format!("#define E(p) {}\n{}", "p ".repeat(200_000), "E() ".repeat(40_000)),
        (0..2_000)
            .map(|index| format!("struct S{} {{ {} }};\n", index + 1, format!("S{index} a; ").repeat(20)))
            .collect(),
        (0..20_000).map(|index| format!("float f{index}() {{ return f{}(); }}\n", index + 1)).collect(),
        "#if 1\n".repeat(80_000),
    ];
    for (index, text) in texts.iter().enumerate() {
        let outcome = Case::of(&[("a.frag", &format!("{HEAD}{text}"))]).compile();
        assert!(outcome.compiled.is_none(), "text {index} compiles");
        assert!(outcome.diagnostics.len() <= 200);
    }
}

#[test]
fn endless_and_repeated_includes_are_refused() {
    let deep: Vec<(String, String)> = (0..100)
        .map(|index| (format!("i{index}.glsl"), format!("#include \"i{}.glsl\"\n", index + 1)))
        .collect();
    let root = "#include \"i0.glsl\"\nvoid main() {}";
    let mut files: Vec<(&str, &str)> =
        deep.iter().map(|(path, text)| (path.as_str(), text.as_str())).collect();
    files.push(("a.frag", root));
    let mut case = Case::of(&files);
    case.roots = vec!["a.frag".to_owned()];
    assert!(rendered(&case.compile()).contains("included too deep, the limit is 64"));
    // Each file includes the next twice: 2^60 inclusions.
    let twice = deep.iter().take(60).map(|(path, text)| (path.as_str(), text.repeat(2)));
    let twice: Vec<(&str, String)> = twice.collect();
    let mut files: Vec<(&str, &str)> = twice.iter().map(|(path, text)| (*path, text.as_str())).collect();
    files.extend([("i60.glsl", ""), ("a.frag", root)]);
    let mut case = Case::of(&files);
    case.roots = vec!["a.frag".to_owned()];
    assert!(rendered(&case.compile()).contains("included too often, the limit is 256"));
}

#[test]
fn scan_finds_what_no_condition_keeps_and_what_is_missing() {
    let files = [
        ("s/a.frag", "#if 0\n#include \"b.glsl\"\n#endif\n#include <lib/c.glsl>\nvoid main() {}"),
        ("s/b.glsl", "#include \"b.glsl\"\n#include \"gone.glsl\"\n"),
        ("lib/c.glsl", ""),
    ];
    let mut case = Case::of(&files);
    case.roots = vec!["s/a.frag".to_owned()];
    let scanned = case.scan();
    let seen: Vec<(&str, bool)> = scanned.iter().map(|file| (&*file.path, file.found)).collect();
    let expected = [
        ("s/a.frag", true),
        ("s/b.glsl", true),
        ("s/lib/c.glsl", false),
        ("lib/c.glsl", true),
        ("s/gone.glsl", false),
    ];
    assert_eq!(seen, expected);
    // A compile looks at nothing that the scan did not find.
    let scanned: BTreeSet<_> = scanned.into_iter().collect();
    assert!(case.compile().dependencies.iter().all(|dependency| scanned.contains(dependency)));
}

#[test]
fn all_dependencies_of_all_cases_are_scanned() {
    for (name, case) in cases() {
        let scanned: BTreeSet<_> = case.scan().into_iter().collect();
        let missed: Vec<_> =
            case.compile().dependencies.into_iter().filter(|file| !scanned.contains(file)).collect();
        assert!(missed.is_empty(), "{name}: {missed:?}");
    }
}

#[test]
fn equal_programs_give_equal_text_whatever_their_comments() {
    for (name, case) in cases() {
        let outcome = case.compile();
        assert_eq!(summary(&outcome), summary(&case.compile()), "{name}");
        let Some(compiled) = outcome.compiled else { continue };
        let mut spaced = case.clone();
        for path in case.roots {
            if let Some(text) = spaced.files.get_mut(&path) {
                *text = Arc::from(format!("{text}\n// a comment\n\n"));
            }
        }
        assert_eq!(spaced.compile().compiled, Some(compiled), "{name}");
    }
}

/// A word in code is the author's own, a comment nobody's.
#[test]
fn features_are_named_by_conditions_and_macros_alone() {
    let features = |text: &str| -> String {
        let text = format!("{HEAD}{text}\nvoid main() {{ colour = vec4(1.0); }}");
        let case = Case::of(&[("a.frag", &text)]);
        let outcome = case.compile();
        assert!(outcome.compiled.is_some(), "{}", rendered(&outcome));
        let scanned = crate::scan(&crate::Program::of("a.frag"), &mut |path| case.files.get(path).cloned());
        assert_eq!(scanned.features, outcome.features);
        outcome.features.into_iter().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(
        features("const int FEATURE_COUNT = 3; // FEATURE_NOTE\n/*\n#ifdef FEATURE_OLD\n#endif */"),
        ""
    );
    assert_eq!(features("#define FEATURE_OWN 2"), "");
    // The twins.
    let text = "#if FEATURE_A && defined(FEATURE_B)\n#elif FEATURE_C\n#endif\n#ifdef FEATURE_D\n#endif\n#ifndef FEATURE_E\n#endif";
    assert_eq!(features(text), "a b c d e");
    assert_eq!(features("#if 0\n#ifdef FEATURE_INNER\n#endif\n#endif"), "inner");
    assert_eq!(features("#define HAS(x) FEATURE_F\n#if HAS(1)\n#endif"), "f");
}

#[test]
fn mutated_programs_neither_panic_nor_hang() {
    let mut random = Random::new(1);
    let (mut failed, mut count) = (0, 0);
    for (name, case) in cases() {
        for _ in 0..60 {
            let mut mutated = case.clone();
            let paths: Vec<String> =
                case.files.keys().filter(|path| !path.ends_with(".txt")).cloned().collect();
            let path = random.pick(&paths);
            let mut text = case.files[path].to_string();
            for _ in 0..=random.below(3) {
                text = if random.one_in(4) { bytes(text, &mut random) } else { tokens(&text, &mut random) };
            }
            mutated.files.insert(path.clone(), Arc::from(text.as_str()));
            let outcome = mutated.compile();
            let has_errors = kiln_diagnostic::has_errors(&outcome.diagnostics);
            assert!(outcome.compiled.is_some() != has_errors, "{name}: {text}");
            failed += usize::from(has_errors);
            count += 1;
            let message = rendered(&outcome);
            assert!(!message.contains("no thread"), "{name}: {message}");
        }
    }
    assert!(failed > count / 2, "only {failed} of {count} mutations bite");
}
