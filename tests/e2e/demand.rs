//! Scenes decide what is baked: by command, under a running daemon, and in frames.

use serde_json::Value;

#[cfg(feature = "preview")]
use crate::corpus::{corpus, project_on};
use crate::harness::{Project, ran, text};

const CLOTH: &str =
    "\"sheenColorFactor\": [\n            0.42,\n            0.3,\n            0.72\n          ]";
const NO_CLOTH: &str =
    "\"sheenColorFactor\": [\n            0.0,\n            0.0,\n            0.0\n          ]";

fn demand(project: &Project) -> Value {
    let output = project.run(&["plan", "DIR", "--json"]);
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    plan["demand"].clone()
}

/// What stands in a list of the demand, with the reasons.
fn entries(demand: &Value, list: &str, what: &str) -> Vec<String> {
    let entries = demand[list].as_array().unwrap().iter();
    let named = entries.filter(|entry| entry["what"].as_str().unwrap().starts_with(what));
    named.map(ToString::to_string).collect()
}

#[test]
fn plan_says_which_material_needs_what_and_what_is_skipped() {
    let project = Project::sample();
    let with = demand(&project);
    let needed = entries(&with, "needed", "env/sky/sheen mip");
    assert!(
        !needed.is_empty() && needed.iter().all(|entry| entry.contains("scene/balls: velvet")),
        "{with:#}"
    );
    assert!(entries(&with, "skipped", "env/sky/sheen mip").iter().all(|entry| entry.contains("bytes")));
    assert!(with["variants"]["pbr"].to_string().contains("sheen"), "{with:#}");
    project.edit("scenes/material_balls.gltf", CLOTH, NO_CLOTH);
    let without = demand(&project);
    assert!(entries(&without, "needed", "env/sky/sheen").is_empty(), "{without:#}");
    let skipped = entries(&without, "skipped", "env/sky/sheen mip");
    assert!(skipped.iter().all(|entry| entry.contains("no material of its scenes has sheen")), "{without:#}");
    assert!(!without["variants"]["pbr"].to_string().contains("sheen"), "{without:#}");

    let svg = project.beside("plan.svg");
    let output = project.run(&["plan", "DIR", "--svg", &svg.to_string_lossy()]);
    let said = text(&output.stdout);
    assert!(
        said.contains("skipped  env/sky/sheen mip 0 to 6") && said.contains("needed   env/sky/irradiance"),
        "{said}"
    );
    let picture = std::fs::read_to_string(svg).unwrap();
    assert!(
        picture.contains("scene/balls: car_paint") && picture.contains("env/sky/sheen mip 0 to 6"),
        "{picture}"
    );
}

#[test]
fn cloth_that_comes_and_goes_brings_and_takes_exactly_its_own_under_a_daemon() {
    let project = Project::sample();
    project.edit("scenes/material_balls.gltf", CLOTH, NO_CLOTH);
    let watch = project.watch();
    let client = watch.client("cloth");
    watch.published();
    let without = client.revision();
    project.edit("scenes/material_balls.gltf", NO_CLOTH, CLOTH);
    let ran = ran(&watch.published());
    let is_own =
        |action: &&String| ["sheen", "charlie", "pack scene/balls"].iter().any(|own| action.contains(own));
    assert!(ran.len() > 3 && ran.iter().all(|action| is_own(&action)), "{ran:?}");
    let with = client.revision();
    for (name, target) in &without.table.targets {
        // What was measured of all maps together is one report, which has a part more.
        if (name.starts_with("env/") && !name.ends_with("/accuracy")) || name.starts_with("shader/") {
            assert_eq!(with.table.targets.get(name), Some(target), "{name}");
        }
    }
    let mut added: Vec<&String> = with.table.targets.keys().collect();
    added.retain(|name| !without.table.targets.contains_key(*name));
    let is_expected = |name: &&String| name.ends_with("/sheen") || *name == "lut/charlie";
    assert!(added.len() >= 3 && added.iter().all(is_expected), "{added:?}");
    project.edit("scenes/material_balls.gltf", CLOTH, NO_CLOTH);
    watch.published();
    let names = |revision: &kiln_link::Revision| revision.table.targets.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&client.revision()), names(&without));
}

#[cfg(feature = "preview")]
#[test]
fn frames_of_what_scenes_ask_for_and_of_everything_are_identical() {
    let frame = |project: &Project, name: &str| {
        let out = project.beside(name);
        let mut command = project.command(&["preview", "DIR", "--headless", "--size", "320x180", "--out"]);
        let output = command.arg(&out).output().unwrap();
        let said = text(&output.stderr);
        if said.contains("mesa-vulkan-drivers") {
            crate::harness::skip("frames of partial bakes", "there is no graphics device");
            return None;
        }
        assert!(output.status.success(), "{said}");
        Some(image::open(out.join("frame_0001.png")).unwrap().to_rgb8())
    };
    let project = Project::sample();
    let watch = project.watch();
    let count =
        |published: &Value| published["targets"].as_object().unwrap()["env/sky/sheen"]["bytes"].as_u64();
    let few = count(&watch.published());
    let Some(needed) = frame(&project, "needed") else { return };
    project.edit("kiln.toml", "# bake = \"needed\"", "bake = \"all\"\nsheen = true #");
    assert!(count(&watch.published()) > few, "nothing more was baked");
    assert!(frame(&project, "all").unwrap() == needed, "the frames differ");
    project.edit("kiln.toml", "# background_blur = 0.0", "max_radiance = 5.0 #");
    watch.published();
    assert!(frame(&project, "dimmer").unwrap() != needed, "the check sees no difference");
}

/// Real scenes by what they call for: cloth, coats, glass, light without lobes, copies.
#[cfg(feature = "preview")]
const SCENES: [(&str, &str); 5] = [
    ("chair", "SheenChair/glTF/SheenChair.gltf"),
    ("coats", "ClearCoatTest/glTF/ClearCoatTest.gltf"),
    ("glass", "TransmissionTest/glTF-Binary/TransmissionTest.glb"),
    ("unlit", "UnlitTest/glTF/UnlitTest.gltf"),
    ("copies", "SimpleInstancing/glTF/SimpleInstancing.gltf"),
];

#[cfg(feature = "preview")]
#[test]
fn frames_of_real_scenes_are_those_of_full_bakes() {
    let name = "frames_of_real_scenes_are_those_of_full_bakes";
    let Some(corpus) = corpus(name) else { return };
    // Each has an environment of its own, so that nothing is baked for it because of another.
    let section = |(name, path): (&str, &str)| {
        format!(
            "[env.{name}]\nsource = \"environments/studio.hdr\"\nsize = 64\n\
             [scene.{name}]\nsource = \"corpus/gltf/khronos-sample-assets/{path}\"\nenv = \"{name}\"\n"
        )
    };
    let project = project_on(&corpus, &SCENES.map(section).concat());
    let drawn = |keys: &str, folder: &str| {
        project.write(
            "kiln.toml",
            project.read("kiln.toml").replace("size = 64\n", &format!("size = 64\n{keys}")),
        );
        let out = project.beside(folder);
        let mut command =
            project.command(&["render", "DIR", "--size", "160x90", "--scene", "all", "--exr", "--out"]);
        let output = command.arg(&out).output().unwrap();
        let said = text(&output.stderr);
        if said.contains("mesa-vulkan-drivers") {
            crate::harness::skip(name, "there is no graphics device");
            return None;
        }
        assert!(output.status.success(), "{said}{}", text(&output.stdout));
        // What was drawn before tone mapping and rounding.
        let read = |(name, _): (&str, &str)| std::fs::read(out.join(format!("{name}-{name}.exr"))).unwrap();
        Some(SCENES.map(read))
    };
    let levels = || {
        project.bake().1["targets"]
            .as_object()
            .unwrap()
            .values()
            .map(|it| it["bytes"].as_u64().unwrap())
            .sum::<u64>()
    };
    let Some(needed) = drawn("", "needed") else { return };
    let few = levels();
    let all = drawn("bake = \"all\"\nsheen = true\n", "all").unwrap();
    assert!(levels() > few, "nothing more was baked");
    let dimmer = drawn("max_radiance = 2.0\n", "dimmer").unwrap();
    for (index, (scene, _)) in SCENES.iter().enumerate() {
        assert!(all[index] == needed[index], "{scene}: the frames differ");
        assert!(dimmer[index] != needed[index], "{scene}: the check sees no difference");
    }
}
