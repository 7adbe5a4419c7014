//! What CI and the curious ask: check, plan, why, graph, verify, gc, doctor.

use serde_json::Value;

use crate::harness::{Project, actions_with, text};

fn json(project: &Project, arguments: &[&str]) -> (i32, Value) {
    let output = project.run(arguments);
    let value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}{}", text(&output.stdout), text(&output.stderr)));
    (output.status.code().unwrap(), value)
}

#[test]
fn check_passes_on_a_committed_manifest_and_names_what_would_change() {
    let project = Project::sample();
    project.bake();
    let (code, report) = json(&project, &["bake", "DIR", "--check", "--json"]);
    assert_eq!((code, report["check"].as_array().unwrap().len()), (0, 0), "{:#}", report["diagnostics"]);

    let before = project.read("baked/manifest.json");
    project.edit("kiln.toml", "# irradiance_size = 64", "irradiance_size = 32 #");
    let output = project.run(&["bake", "DIR", "--check"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("`env/sky/irradiance` is not what the manifest says"), "{said}");
    assert!(said.contains("facts.size: 64 → 32"), "{said}");
    assert_eq!(project.read("baked/manifest.json"), before, "a check writes nothing");

    std::fs::write(project.beside("committed.json"), &before).unwrap();
    let committed = project.beside("committed.json");
    let (code, _) =
        json(&project, &["bake", "DIR", "--check", "--json", "--manifest", &committed.to_string_lossy()]);
    assert_eq!(code, 1);
}

#[test]
fn byte_budget_fails_the_bake_that_exceeds_it() {
    let project = Project::sample();
    project.edit("kiln.toml", "# max_bytes = \"256 MiB\"", "max_bytes = \"1 KiB\" #");
    let output = project.run(&["bake", "DIR"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("over the budget of 1.0 KiB") && said.contains("env/sky/specular"), "{said}");
    project.edit("kiln.toml", "max_bytes = \"1 KiB\"", "max_bytes = \"1 GiB\"");
    assert_eq!(project.bake().0, 0);
}

#[test]
fn junit_report_and_annotations_name_the_faulty_target_and_line() {
    let project = Project::sample();
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, half, 1.0)");
    let report = project.beside("report.xml");
    let output = project.run(&[
        "bake",
        "DIR",
        "--keep-going",
        "--junit",
        &report.to_string_lossy(),
        "--annotate",
        "github",
    ]);
    assert_eq!(output.status.code(), Some(1));
    let xml = std::fs::read_to_string(report).unwrap();
    let document = roxmltree::Document::parse(&xml).unwrap();
    let cases = document.descendants().filter(|node| node.has_tag_name("testcase"));
    let faulty = cases.filter(|case| case.has_children());
    let faulty: Vec<_> = faulty.map(|case| case.attribute("name").unwrap().to_owned()).collect();
    assert_eq!(faulty, ["shader/tonemap/base"], "{xml}");
    let said = text(&output.stdout);
    assert!(said.contains("::error file=") && said.contains("tonemap.wgsl,line="), "{said}");
}

#[test]
fn reports_go_to_bare_file_names_too() {
    let project = Project::sample();
    let run =
        |arguments: &[&str]| project.command(arguments).current_dir(project.beside("")).output().unwrap();
    for arguments in [["bake", "project", "--junit", "kiln.xml"], ["graph", "project", "--out", "graph.svg"]]
    {
        let output = run(&arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        assert!(project.beside(arguments[3]).is_file());
    }
}

#[test]
fn check_of_a_broken_project_names_the_fault_and_nothing_else() {
    let project = Project::sample();
    project.bake();
    std::fs::remove_dir_all(project.beside("cache")).unwrap();
    project.edit("shaders/pbr/background.wgsl", "fn fs_main", "fn fs_main(");
    for arguments in [vec!["bake", "DIR", "--check", "-j", "1"], vec!["bake", "DIR", "--check", "-k"]] {
        let output = project.run(&arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(said.matches("error:").count(), 1, "{said}");
        assert!(said.contains("background.wgsl") && !text(&output.stdout).contains("commit"), "{said}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_is_a_failure() {
    let project = Project::sample();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = project.command(&["plan", "DIR", "--json"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

#[test]
fn failure_stops_the_bake_unless_it_is_to_keep_going() {
    let project = Project::sample();
    project.edit("shaders/pbr/background.wgsl", "fn fs_main", "fn fs_main(");
    let (code, stopped) = json(&project, &["bake", "DIR", "--json", "-j", "1"]);
    assert_eq!(code, 1);
    assert!(!actions_with(&stopped, "not run").is_empty());
    let (code, all) = json(&project, &["bake", "DIR", "--json", "--keep-going"]);
    assert_eq!(code, 1);
    assert!(actions_with(&all, "not run").is_empty());
    assert_eq!(actions_with(&all, "failed"), ["compile shader/background/base"]);
    assert_eq!(all["targets"]["env/sky/specular"]["state"], "fresh");
}

#[test]
fn plan_names_what_the_next_bake_then_runs() {
    let project = Project::sample();
    project.bake();
    let planned = |status: &str| actions_with(&json(&project, &["plan", "DIR", "--json"]).1, status);
    assert!(planned("would run").is_empty() && planned("may run").is_empty());
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 0.9, 0.8)");
    project.edit("kiln.toml", "# texels = \"repair\"", "texels = \"error\" #");
    assert_eq!(planned("would run"), ["compile shader/tonemap/base", "decode env/sky"]);
    let may_run = planned("may run");
    assert!(may_run.contains(&"analyse env/sky".to_owned()), "{may_run:?}");
    assert!(project.run(&["plan", "DIR"]).status.success());
    let (_, report) = project.bake();
    assert_eq!(actions_with(&report, "ran"), ["compile shader/tonemap/base", "decode env/sky"]);
}

#[test]
fn why_names_old_and_new_value_and_what_was_left_alone() {
    let project = Project::sample();
    project.bake();
    project.edit("kiln.toml", "# irradiance_size = 64", "irradiance_size = 32 #");
    project.bake();
    let dir = project.dir();
    let why = |target: &str| {
        let output = project.run(&["why", target, "--dir", &dir.to_string_lossy()]);
        (output.status.code().unwrap(), text(&output.stdout) + &text(&output.stderr))
    };
    let (code, said) = why("env/sky/irradiance");
    assert_eq!(code, 0);
    assert!(said.contains("ran in build 2") && said.contains("parameter size: 64 → 32"), "{said}");
    assert!(said.contains("after the result of build 1"), "{said}");
    let (_, said) = why("env/sky/specular");
    assert!(said.contains("build 2 had no reason to touch it"), "{said}");
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, half, 1.0)");
    project.bake();
    let (_, said) = why("shader/tonemap/base");
    assert!(said.contains("cannot be made from its present sources"), "{said}");
    let (code, said) = why("env/sky/specula");
    assert_eq!(code, 1);
    assert!(said.contains("did you mean `env/sky/specular`?"), "{said}");
}

#[test]
fn graph_is_drawn_as_dot_and_as_svg() {
    let project = Project::sample();
    let picture = project.beside("graph.svg");
    assert!(project.run(&["graph", "DIR", "--out", &picture.to_string_lossy()]).status.success());
    let svg = std::fs::read_to_string(picture).unwrap();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let texts: Vec<_> = document.descendants().filter_map(|node| node.text()).collect();
    for label in ["environments/sky.hdr", "decode env/sky", "env/sky/specular", "would run"] {
        assert!(texts.contains(&label), "{label}");
    }
    let output = project.run(&["graph", "DIR", "--target", "env/sky/sh"]);
    let dot = text(&output.stdout);
    assert!(
        dot.starts_with("digraph kiln {") && dot.contains("env/sky/sh") && !dot.contains("tonemap"),
        "{dot}"
    );
}

#[test]
fn verification_of_everything_finds_equal_bytes() {
    let project = Project::sample();
    let (code, _) = project.bake();
    assert_eq!(code, 0);
    let (code, verified) = json(&project, &["verify", "DIR", "--all", "--json"]);
    assert_eq!(code, 0, "{verified:#}");
    assert_eq!(verified["mismatches"], Value::Array(Vec::new()));
    assert!(verified["outputs"].as_u64().unwrap() > 40, "{verified:#}");
}

#[test]
fn collection_keeps_what_is_published_and_the_next_bake_runs_nothing() {
    let project = Project::sample();
    project.bake();
    let (code, collected) = json(&project, &["gc", "--max-size", "0", "--json"]);
    assert_eq!(code, 0);
    assert!(
        collected["removed_bytes"].as_u64().unwrap() > 0 && collected["held_bytes"].as_u64().unwrap() > 0
    );
    let (code, report) = project.bake();
    assert_eq!(code, 0);
    assert!(actions_with(&report, "ran").is_empty(), "{:?}", actions_with(&report, "ran"));
}

#[test]
fn doctor_finds_a_damaged_file_and_is_content_with_a_sound_cache() {
    let project = Project::sample();
    project.bake();
    let (code, findings) = json(&project, &["doctor", "--deep", "--json"]);
    assert_eq!((code, findings["cache"]["damaged"].as_u64()), (0, Some(0)), "{findings:#}");
    let blobs = std::fs::read_dir(project.beside("cache/v2/cas")).unwrap();
    let folder = blobs.into_iter().next().unwrap().unwrap().path();
    let blob = std::fs::read_dir(folder).unwrap().next().unwrap().unwrap().path();
    let mut bytes = std::fs::read(&blob).unwrap();
    bytes[0] ^= 1;
    std::fs::write(&blob, bytes).unwrap();
    let (code, findings) = json(&project, &["doctor", "--deep", "--json"]);
    assert_eq!((code, findings["cache"]["damaged"].as_u64()), (1, Some(1)), "{findings:#}");
    assert_eq!(project.bake().0, 0);
}

#[test]
fn unchanged_files_are_not_read_again() {
    let project = Project::sample();
    project.bake();
    let deadline = std::time::Instant::now() + crate::harness::LIMIT;
    // Files that were just written may still change within their time stamp; when that has passed, `stat` is enough.
    loop {
        let (_, report) = project.bake();
        if report["sources"]["hashed"] == 0 {
            break;
        }
        assert!(std::time::Instant::now() < deadline, "{:#}", report["sources"]);
    }
    let path = project.path("environments/sky.hdr");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    let (_, report) = project.bake();
    assert_eq!(report["sources"]["hashed"], 1, "the touched file, once");
    assert!(actions_with(&report, "ran").is_empty());
}

#[cfg(unix)]
#[test]
fn closed_pipe_ends_the_report_quietly() {
    use std::process::Stdio;
    let project = Project::sample();
    let mut child = project
        .command(&["bake", "DIR", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(!text(&output.stderr).contains("panicked"), "{}", text(&output.stderr));
}
