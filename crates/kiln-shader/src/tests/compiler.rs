//! A compiler that remembers gives what one without memory gives.

use std::collections::BTreeSet;

use super::{Files, compiled, set};
use crate::{Compiler, Outcome, Program};

const ROOT: &str = "import lib::base::base;\n@if(wet && coat) import lib::coat::coat;\n\
    @fragment fn fs_main() -> @location(0) vec4f {\n    var colour = vec4f(base());\n    \
    @if(wet) { @if(coat) { colour *= coat(); } colour += 1.0; }\n    return colour;\n}\n";

fn files() -> Files {
    Files::new(&[
        ("a.wgsl", ROOT),
        ("lib/base.wgsl", "fn base() -> f32 { @if(wet) return 2.0; @else return 1.0; }"),
        ("lib/coat.wgsl", "fn coat() -> f32 { return 3.0; }"),
    ])
}

fn compile(compiler: &mut Compiler, files: &Files, features: &[&str]) -> Outcome {
    compiler.compile(&Program::of("a.wgsl"), &set(features), &mut |path| files.0.get(path).cloned())
}

const VARIANTS: [&[&str]; 5] = [&[], &["coat"], &["wet"], &["wet", "coat"], &["other"]];

#[test]
fn compiler_that_remembers_says_the_same() {
    let mut compiler = Compiler::default();
    let mut files = files();
    let broken = "fn base() -> f32 { return oops; }";
    let edits = [
        ("lib/base.wgsl", Some(broken)),
        ("lib/base.wgsl", None),
        ("base.wgsl", Some("fn base() -> f32 { return 4.0; }")),
    ];
    for edit in std::iter::once(None).chain(edits.map(Some)) {
        match edit {
            Some((path, Some(text))) => drop(files.0.insert(path.to_owned(), text.into())),
            Some((path, None)) => drop(files.0.remove(path)),
            None => {}
        }
        for features in VARIANTS.into_iter().chain(VARIANTS) {
            assert_eq!(
                compile(&mut compiler, &files, features),
                files.compile("a.wgsl", features),
                "{edit:?} {features:?}"
            );
        }
    }
}

#[test]
fn variants_with_the_same_text_are_compiled_once_and_others_are_not() {
    let (mut compiler, files) = (Compiler::default(), files());
    let mut texts = BTreeSet::new();
    let mut count = |features: &[&str]| {
        texts.insert(compiled(compile(&mut compiler, &files, features)).wgsl);
        (compiler.linked_count(), texts.len())
    };
    assert_eq!(count(&[]), (1, 1));
    assert_eq!(count(&["coat"]), (1, 1), "without `wet` the feature `coat` is nowhere");
    assert_eq!(count(&["wet"]), (2, 2));
    assert_eq!(count(&["wet", "coat"]), (3, 3));
}

#[test]
fn variant_looks_at_its_own_files_only() {
    let mut compiler = Compiler::default();
    let files = files();
    let mut looked_at = |features: &[&str]| -> Vec<String> {
        let found = compile(&mut compiler, &files, features).dependencies;
        found
            .into_iter()
            .map(|file| format!("{}{}", if file.found { "" } else { "no " }, file.path))
            .collect()
    };

    assert_eq!(looked_at(&["wet", "coat"]), ["a.wgsl", "lib/base.wgsl", "lib/coat.wgsl"]);
    assert_eq!(looked_at(&[]), ["a.wgsl", "lib/base.wgsl"]);
}
