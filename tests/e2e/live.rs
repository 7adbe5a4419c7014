//! The loop: edits in, revisions out, whatever dies in between.

use kiln_link::TargetState;
use serde_json::json;

use crate::harness::{PANORAMA_WIDTH, Project, ran};

#[test]
fn every_kind_of_edit_reaches_two_clients() {
    let project = Project::sample();
    let watch = project.watch();
    let first = watch.published();
    assert_eq!(
        first["diagnostics"].as_array().unwrap().iter().filter(|d| d["severity"] == "error").count(),
        0
    );
    let clients = [watch.client("one"), watch.client("two")];
    let expect_on_both = |number: u64| {
        let revisions = clients.each_ref().map(|client| client.revision());
        revisions.iter().for_each(|revision| assert_eq!(revision.table.number, number));
        revisions[0].clone()
    };
    let before = expect_on_both(1);

    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 0.9, 0.8)");
    assert_eq!(ran(&watch.published()), ["compile shader/tonemap/base"]);
    let after = expect_on_both(2);
    assert_ne!(before.part("shader/tonemap/base", "wgsl"), after.part("shader/tonemap/base", "wgsl"));
    assert_eq!(before.table.targets["env/sky/specular"], after.table.targets["env/sky/specular"]);

    let sun = kiln_sample::sky::SunPosition { elevation_deg: 5.0, azimuth_deg: 0.0 };
    project.write("environments/sky.hdr", kiln_sample::sky_hdr(PANORAMA_WIDTH.parse().unwrap(), sun));
    let published = watch.published();
    assert!(ran(&published).iter().all(|action| action.contains(" env/sky")), "{:?}", ran(&published));
    assert_eq!(published["work"]["changed_files"], json!(["environments/sky.hdr"]));
    let after = expect_on_both(3);
    assert_ne!(before.part("env/sky/specular", "mip3"), after.part("env/sky/specular", "mip3"));

    project.edit("scenes/material_balls.gltf", "\"clearcoatFactor\": 1.0", "\"clearcoatFactor\": 0.5");
    assert_eq!(ran(&watch.published()), ["pack scene/balls"]);
    expect_on_both(4);

    project.edit("kiln.toml", "env = \"sky\"", "env = \"studio\"");
    assert!(ran(&watch.published()).is_empty(), "only a fact about the scene has changed");
    assert_eq!(expect_on_both(5).table.targets["scene/balls"].meta["env"], "studio");
}

#[test]
fn save_without_a_difference_publishes_nothing() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let text = project.read("shaders/pbr/tonemap.wgsl");
    project.write("shaders/pbr/tonemap.wgsl", &text);
    watch.wait_for("unchanged");
    project.edit("shaders/pbr/tonemap.wgsl", "const WHITE_BALANCE", "// a comment\nconst WHITE_BALANCE");
    watch.wait_for("unchanged");
}

#[test]
fn atomic_save_by_rename_is_noticed() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let text = project.read("shaders/pbr/tonemap.wgsl").replace("1.0, 1.0, 1.0", "1.0, 0.5, 0.5");
    project.write("shaders/pbr/tonemap.wgsl~", &text);
    std::fs::rename(project.path("shaders/pbr/tonemap.wgsl~"), project.path("shaders/pbr/tonemap.wgsl"))
        .unwrap();
    assert_eq!(ran(&watch.published()), ["compile shader/tonemap/base"]);
}

#[test]
fn broken_then_mended_shader_keeps_serving() {
    let project = Project::sample();
    let watch = project.watch();
    let client = watch.client("viewer");
    let good = client.revision();
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(1.0, 1.0, oops)");
    let broken = client.revision();
    let target = &broken.table.targets["shader/tonemap/base"];
    assert_eq!(target.state, TargetState::Stale);
    assert_eq!(target.parts, good.table.targets["shader/tonemap/base"].parts);
    let error = broken.table.diagnostics.iter().find(|diagnostic| diagnostic.is_error()).unwrap();
    let span = error.span.as_ref().unwrap();
    assert_eq!(error.file.as_deref(), Some("shaders/pbr/tonemap.wgsl"));
    assert!(span.source_line.contains("oops") && span.length_chars == 4, "{error}");
    project.edit("shaders/pbr/tonemap.wgsl", "oops", "1.0");
    let mended = client.revision();
    assert_eq!(mended.table.targets, good.table.targets);
    assert!(!mended.table.diagnostics.iter().any(kiln_diagnostic::Diagnostic::is_error));
}

#[test]
fn file_missing_at_first_is_picked_up_when_it_appears() {
    let project = Project::sample();
    let shader = project.read("shaders/lib/colour.wgsl");
    std::fs::remove_file(project.path("shaders/lib/colour.wgsl")).unwrap();
    let watch = project.watch();
    let client = watch.client("viewer");
    assert!(client.revision().table.diagnostics.iter().any(kiln_diagnostic::Diagnostic::is_error));
    project.write("shaders/lib/colour.wgsl", shader);
    let mended = client.revision();
    assert!(!mended.table.diagnostics.iter().any(kiln_diagnostic::Diagnostic::is_error));
    assert_eq!(mended.table.targets["shader/tonemap/base"].state, TargetState::Fresh);
}

#[test]
fn killed_daemon_is_followed_by_the_next_and_nothing_is_lost() {
    let project = Project::sample();
    let watch = project.watch();
    let client = watch.client("viewer");
    let before = client.revision();
    watch.kill();
    client.disconnected();
    let watch = project.watch();
    let again = client.revision();
    assert_eq!(again.table.targets, before.table.targets);
    assert!(again.table.work.ran.is_empty(), "{:?}", again.table.work.ran);
    project.edit("shaders/pbr/tonemap.wgsl", "vec3f(1.0, 1.0, 1.0)", "vec3f(0.9, 1.0, 1.0)");
    watch.published();
    watch.published();
    assert_eq!(client.revision().table.number, 2);
    assert_eq!(watch.interrupt(), 0);
}

#[test]
fn second_daemon_says_who_holds_the_project() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let output = project.run(&["watch", "DIR"]);
    assert_eq!(output.status.code(), Some(1));
    let said = crate::harness::text(&output.stderr);
    assert!(said.contains("already watches this project"), "{said}");
}

#[cfg(unix)]
#[test]
fn socket_is_for_this_user_alone() {
    use std::os::unix::fs::PermissionsExt as _;
    let project = Project::sample();
    let watch = project.watch();
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&watch.socket), 0o600);
    assert_eq!(mode(watch.socket.parent().unwrap()), 0o700);
}

#[test]
fn project_file_that_goes_and_comes_back_is_followed_again() {
    let project = Project::sample();
    let watch = project.watch();
    let client = watch.client("viewer");
    let before = client.revision();
    std::fs::rename(project.path("kiln.toml"), project.path("kiln.away")).unwrap();
    let without = client.revision();
    assert!(without.table.diagnostics.iter().any(kiln_diagnostic::Diagnostic::is_error));
    assert_eq!(without.table.targets["env/sky/specular"].state, TargetState::Stale);
    std::fs::rename(project.path("kiln.away"), project.path("kiln.toml")).unwrap();
    assert_eq!(client.revision().table.targets, before.table.targets);
}

#[test]
fn cache_deleted_under_a_running_daemon_is_made_anew_for_the_next_client() {
    let project = Project::sample();
    let watch = project.watch();
    let before = watch.client("first").revision();
    // At once: the daemon may notice and begin to make it anew.
    std::fs::rename(project.beside("cache/v2/cas"), project.beside("gone")).unwrap();
    let again = watch.client("second").revision();
    assert_eq!(again.table.targets, before.table.targets);
}

#[cfg(unix)]
#[test]
fn link_that_leads_elsewhere_is_followed_and_so_are_edits_behind_it() {
    let project = Project::sample();
    let tinted = |blue: &str| {
        format!("@fragment fn fs_main() -> @location(0) vec4f {{ return vec4f(1.0, 1.0, {blue}, 1.0); }}\n")
    };
    for folder in ["v1", "v2"] {
        std::fs::create_dir_all(project.path(folder)).unwrap();
        project.write(&format!("{folder}/tonemap.wgsl"), tinted(if folder == "v1" { "0.5" } else { "0.6" }));
    }
    std::os::unix::fs::symlink("v1", project.path("cur")).unwrap();
    // The second shader is the same file by another name.
    project.write(
        "kiln.toml",
        "version = 1\n[shader.tonemap]\nsource = \"cur/../cur/tonemap.wgsl\"\n\
         [shader.other]\nsource = \"./cur/tonemap.wgsl\"\nrole = \"tonemap\"\n",
    );
    let both = ["compile shader/other/base", "compile shader/tonemap/base"];
    let watch = project.watch();
    let first = watch.published();
    let is_sound = |published: &serde_json::Value| published["diagnostics"].as_array().unwrap().is_empty();
    assert!(is_sound(&first), "{first:#}");
    project.write("v1/tonemap.wgsl", tinted("0.7"));
    assert_eq!(ran(&watch.published()), both);
    std::os::unix::fs::symlink("v2", project.path("next")).unwrap();
    std::fs::rename(project.path("next"), project.path("cur")).unwrap();
    assert_eq!(ran(&watch.published()), both);
    project.write("v2/tonemap.wgsl", tinted("0.8"));
    assert_eq!(ran(&watch.published()), both);
}
