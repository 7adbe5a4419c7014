//! kiln.toml.

use super::*;

#[test]
fn wrong_project_files_are_explained() {
    let cases = [
        ("version = 2\n", "version 1", 1),
        ("[env.a]\nsource = \"a.hdr\"\n", "does not say its version", 1),
        ("version = 1\n[env.a]\nsouce = \"a.hdr\"\n", "did you mean `source`?", 3),
        ("version = 1\n[env.a]\nsize = 64\n", "[env.a] has no `source`", 2),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nsize = 100\n", "use 64 or 128", 4),
        ("version = 1\n[env.a]\nsource = 5\n", "must be a string", 3),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nerror = 0\n", "`error` in [env.a] must be from", 4),
        ("version = 1\n[env.a]\nsource = \"a.hdr\"\nformat = \"rgba16\"\n", "did you mean `rgba16f`?", 4),
        (
            "version = 1\n[shader.a]\nsource = \"a.wgsl\"\nvariants = [\"../../b\"]\n",
            "`../../b` is no feature",
            4,
        ),
        ("version = 1\n[project]\nallow_folders = [\"x/../lib\"]\n", "lies in the project", 3),
        ("version = 1\n[shader.a]\nsource = \"../a.wgsl\"\n", "lies outside the project", 3),
        (
            "version = 1\n[env.a]\nsource = \"a.hdr\"\n[shader.pbr]\nsource = \"a.wgsl\"\n\
             [scene.s]\nsource = \"s.glb\"\nspecular_glossiness = \"speculr\"\n",
            "did you mean `specular`?",
            8,
        ),
        (
            "version = 1\n[shader.a]\nsource = \"a.frag\"\nprelude = [\"/etc/passwd\"]\n",
            "lies outside the project",
            4,
        ),
        (
            "version = 1\n[shader.a]\nsource = \"a.frag\"\ninclude = [\"x/../..\"]\n",
            "lies outside the project",
            4,
        ),
        (
            "version = 1\n[shader.a]\nsource = \"a.frag\"\ntextures = [\"t=../t.png\"]\n",
            "lies outside the project",
            4,
        ),
        (
            "version = 1\n[shader.a]\nsource = \"a.frag\"\ntextures = [\"t.png\"]\n",
            "names no variable and file",
            4,
        ),
        (
            "version = 1\n[shader.a]\nsource = \"a.frag\"\ndefines = [\"A B=1\"]\n",
            "`A B` is no name of a macro",
            4,
        ),
        ("version = 1\n[shader.a]\nsource = \"a.wgsl\"\ndefines = [\"A=1\"]\n", "`defines` is for GLSL", 4),
        ("version = 1\n[shader.a]\nsource = []\n", "`source` names no file", 3),
        ("version = 1\n[shader.a]\nsource = \"a.wgsl\"\nemit = [\"spirw\"]\n", "did you mean `spirv`?", 4),
        ("version = 1\n[envs.a]\nsource = \"a.hdr\"\n", "did you mean `env`?", 2),
        (
            "version = 1\n[env.sky]\nsource = \"a\"\n[scene.s]\nsource = \"s\"\nenv = \"skyy\"\n[shader.pbr]\nsource = \"p\"\n",
            "did you mean `sky`?",
            6,
        ),
        ("version = 1\n[output]\ndir = \"../..\"\n", "folder inside the project", 3),
        ("version = 1\n[output]\ndir = \"/etc\"\n", "folder inside the project", 3),
        ("version = 1\n[output]\ndir = \".\"\n", "folder inside the project", 3),
        ("version = 1\n[check]\nmax_bytes = \"64 MXB\"\n", "which is no size", 3),
        ("version = 1\n[env.a\nsource = \"a.hdr\"\n", "", 2),
        ("version = 1\n[env.\"a/b\"]\nsource = \"a.hdr\"\n", "letters, digits", 2),
    ];
    for (text, expected, line) in cases {
        let (_, diagnostics) = parse_project(text);
        let found = diagnostics.iter().find(|diagnostic| {
            diagnostic.to_string().contains(expected)
                && diagnostic.span.as_ref().is_some_and(|span| span.line == line)
        });
        assert!(found.is_some(), "{text}\nwanted {expected:?} in line {line}, got {diagnostics:#?}");
    }
    assert_eq!(
        parse_project("version = 1\n[env.a]\nsouce = \"a.hdr\"\n").1.len(),
        1,
        "one fault, one message"
    );
    assert!(parse_project(TOML).1.is_empty());
}

#[test]
fn section_with_an_error_is_left_out_and_the_others_are_used() {
    let text = "version = 1\n[env.a]\nsource = \"a.hdr\"\n[env.b]\nsource = \"b.hdr\"\nsizes = 4\n";
    let (project, diagnostics) = parse_project(text);
    assert_eq!(project.envs.keys().collect::<Vec<_>>(), ["a"]);
    assert_eq!(diagnostics.len(), 1);
}

#[test]
fn forced_effects_of_geometry_are_warned_of_and_others_are_not() {
    let read = |effects: &str| parse_project(&format!("version = 1\n[effects]\n{effects}\n"));
    let (project, diagnostics) = read("force = [\"skin\", \"sheen\", \"instancing\"]");
    assert!(project.effects.force.contains(&Effect::Sheen), "the section is used");
    let warned: Vec<String> = diagnostics.iter().map(ToString::to_string).collect();
    assert_eq!(warned.len(), 2, "{warned:?}");
    assert!(
        diagnostics.iter().all(|it| it.severity == Severity::Warning && it.span.as_ref().unwrap().line == 3)
    );
    assert!(warned[1].contains("no setting gives a mesh what `skin` reads"), "{warned:?}");
    assert!(read("force = [\"sheen\"]\nforbid = [\"skin\"]").1.is_empty(), "what is there can be left out");
}

#[test]
fn sizes_are_read_with_their_units() {
    let cases = [
        ("200000", Some(200_000)),
        ("64 MiB", Some(64 << 20)),
        ("1.5GB", Some(1_500_000_000)),
        ("2K", Some(2048)),
    ];
    for (text, expected) in cases {
        assert_eq!(parse_bytes(text), expected, "{text}");
    }
    for wrong in ["", "MiB", "-1", "1 mile", "1e400", "99999999999 GiB"] {
        assert_eq!(parse_bytes(wrong), None, "{wrong}");
    }
    assert_eq!(parse_project("version = 1\n[check]\nmax_bytes = \"2 KiB\"\n").0.bytes_max, Some(2048));
    assert_eq!(parse_project("version = 1\n[check]\nmax_bytes = 4096\n").0.bytes_max, Some(4096));
}
