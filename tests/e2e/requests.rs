//! Changes that people ask Kiln for: `kiln set`, `kiln add`, and a client that asks the daemon.

use kiln_link::{Ask, ClientEvent, ParameterWrite};

use crate::harness::{LIMIT, Project, text};

const TONEMAP: &str = "shaders/pbr/tonemap.wgsl";

fn assert_done(output: &std::process::Output) {
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn set_writes_a_value_with_a_daemon_and_without() {
    let project = Project::sample();
    let before = project.read(TONEMAP);
    let unbuilt = project.run(&["set", "tonemap.tone_mapper=agx", "--dir", "DIR"]);
    assert_eq!(unbuilt.status.code(), Some(1));
    assert!(text(&unbuilt.stderr).contains("is not built"), "{}", text(&unbuilt.stderr));
    project.bake();
    let set = project.run(&["set", "tonemap.tone_mapper=agx", "--dir", "DIR"]);
    assert_done(&set);
    assert_eq!(text(&set.stdout), format!("wrote {TONEMAP}\n"));
    assert_eq!(project.read(TONEMAP), before.replace("0u; // @choice(0, ", "1u; // @choice(1, "));
    let watch = project.watch();
    watch.published();
    assert_done(&project.run(&["set", "tonemap.tone_mapper=reinhard", "--dir", "DIR"]));
    assert_eq!(watch.wait_for("asked")["request"]["ask"], "write_parameters");
    assert_eq!(watch.published()["work"]["changed_files"][0], TONEMAP);
    assert_eq!(project.read(TONEMAP), before.replace("0u; // @choice(0, ", "3u; // @choice(3, "));
    for (value, reason) in [
        ("tonemap.tone_mapper=pretty", "names no parameter and value"),
        ("tonemap.tone_mapper=9", "the number of one of neutral, agx, aces, reinhard, none"),
        ("tonemap.tone_maper=1", "did you mean `tone_mapper`?"),
        ("tone_mapper=1", "write it as pbr.wetness=0.5"),
    ] {
        let refused = project.run(&["set", value, "--dir", "DIR"]);
        assert_eq!(refused.status.code(), Some(1), "{value}");
        assert!(text(&refused.stderr).contains(reason), "{value}: {}", text(&refused.stderr));
    }
    assert_eq!(project.read(TONEMAP), before.replace("0u; // @choice(0, ", "3u; // @choice(3, "));
}

#[test]
fn add_brings_a_panorama_and_a_scene_with_a_daemon_and_without() {
    let project = Project::sample();
    let sky = project.beside("dusk.hdr");
    std::fs::copy(project.path("environments/sky.hdr"), &sky).unwrap();
    let sky = sky.to_str().unwrap();
    let added = project.run(&["add", sky, "--dir", "DIR"]);
    assert_done(&added);
    assert_eq!(text(&added.stdout), "added environment `dusk`: environments/dusk.hdr\n");
    let (code, report) = project.bake();
    assert_eq!(code, 0, "{report}");
    let watch = project.watch();
    watch.published();
    let folder = project.beside("balls");
    let copied = std::process::Command::new("cp").arg("-r").args([&project.path("scenes"), &folder]).status();
    assert!(copied.unwrap().success());
    let scene = folder.join("material_balls.gltf");
    assert_done(&project.run(&["add", scene.to_str().unwrap(), "--dir", "DIR"]));
    let published = watch.published();
    assert!(published["targets"].get("scene/material_balls").is_some(), "{published}");
    let nothing = project.run(&["add", folder.to_str().unwrap(), "--dir", "DIR"]);
    assert_eq!(nothing.status.code(), Some(1));
    assert!(
        text(&nothing.stderr).contains("balls is a folder; it was not added"),
        "{}",
        text(&nothing.stderr)
    );
}

#[test]
fn file_that_is_saved_while_a_client_asks_is_the_savers() {
    let project = Project::sample();
    let watch = project.watch();
    watch.published();
    let client = watch.client("asks");
    client.revision();
    let write = |value: f64| {
        let (shader, name) = ("tonemap".to_owned(), "tone_mapper".to_owned());
        Ask::WriteParameters { parameters: vec![ParameterWrite { shader, name, value: vec![value] }] }
    };
    let mut refused = 0;
    for round in 0..40 {
        let mine = format!("{}\n// {round}\n", project.read(TONEMAP));
        project.write(TONEMAP, &mine);
        let id = client.0.request(write(f64::from(round % 5))).unwrap();
        let answer = loop {
            if let ClientEvent::Answer(answer) = client.0.events().recv_timeout(LIMIT).unwrap() {
                break answer;
            }
        };
        assert_eq!(answer.id, id);
        let now = project.read(TONEMAP);
        assert!(now.ends_with(&format!("// {round}\n")), "the saved line is lost");
        refused += usize::from(!answer.is_done());
        let is_mine = now == mine;
        assert!(answer.is_done() || is_mine, "{:?}", answer.diagnostics);
    }
    assert!(refused > 0, "a save that the daemon has not built is never overwritten");
}
