//! Scenes decide what of an environment is baked.

use super::*;

/// A project whose one scene has one material, and whose environment is baked as that asks.
fn place_of(material: &str) -> Place {
    let place = Place::new();
    place.edit("kiln.toml", "bake = \"all\"\n", "");
    place.edit("kiln.toml", "size = 8\n", "size = 32\n");
    place.write("quad.gltf", scene_of(material));
    place
}

fn scene_of(material: &str) -> String {
    let second = r#",{"attributes":{"POSITION":0},"material":1}"#;
    let materials = r#"{"name":"plain"},{"name":"sign","extensions":{"KHR_materials_unlit":{}}}"#;
    assert!(SCENE.contains(second) && SCENE.contains(materials));
    SCENE.replace(second, "").replace(materials, material).replace(
        r#""extensionsUsed":["KHR_materials_unlit"]"#,
        r#""extensionsUsed":["KHR_materials_unlit","KHR_materials_sheen"]"#,
    )
}

fn rough(factor: f64) -> String {
    format!(r#"{{"name":"plain","pbrMetallicRoughness":{{"roughnessFactor":{factor}}}}}"#)
}

const SHEEN: &str = r#"{"name":"plain","pbrMetallicRoughness":{"roughnessFactor":1},"extensions":{"KHR_materials_sheen":
    {"sheenColorFactor":[1,1,1],"sheenRoughnessFactor":0.5}}}"#;

fn levels(built: &Built, target: &str) -> Vec<String> {
    let target = built.targets.get(target);
    target.into_iter().flat_map(|target| &target.parts).map(|part| part.name.clone()).collect()
}

fn names(built: &Built) -> Vec<&str> {
    built.targets.keys().map(String::as_str).filter(|name| !name.starts_with("shader/")).collect()
}

#[test]
fn smooth_scene_has_no_rough_levels_and_a_rough_one_no_sharp_ones() {
    // Four levels, of roughness 0, 1/3, 2/3 and 1; filtering of normals brings roughness 0 up to 0.65 and 0.9 to 0.96.
    assert_eq!(levels(&place_of(&rough(0.0)).build(), "env/room/specular"), ["mip0", "mip1", "mip2"]);
    assert_eq!(levels(&place_of(&rough(0.9)).build(), "env/room/specular"), ["mip2", "mip3"]);
    let all = place_of(&rough(0.9));
    all.edit("kiln.toml", "size = 32\n", "size = 32\nbake = \"all\"\n");
    assert_eq!(levels(&all.build(), "env/room/specular"), ["mip0", "mip1", "mip2", "mip3"]);
}

#[test]
fn level_has_the_same_texels_whatever_else_is_read() {
    let few = place_of(&rough(0.9)).build();
    let all = place_of(&rough(0.9));
    all.edit("kiln.toml", "size = 32\n", "size = 32\nbake = \"all\"\n");
    let all = all.build();
    let (few, all) = (&few.targets["env/room/specular"], &all.targets["env/room/specular"]);
    assert_eq!(few.parts, all.parts[2..]);
    assert_ne!(few.parts[0].digest, all.parts[1].digest, "the check sees no difference");
    assert_eq!((few.meta["first_level"].as_u64(), &few.meta["levels"]), (Some(2), &all.meta["levels"]));
}

#[test]
fn unlit_scene_bakes_nothing_but_the_background() {
    let unlit = place_of(r#"{"name":"sign","extensions":{"KHR_materials_unlit":{}}}"#).build();
    assert_eq!(names(&unlit), ["env/room/skybox", "project", "scene/quad"]);
    let lit = place_of(&rough(0.9)).build();
    assert!(names(&lit).contains(&"env/room/irradiance") && names(&lit).contains(&"lut/ggx"));
}

#[test]
fn first_cloth_adds_its_chain_table_and_variant_and_nothing_else_and_the_last_takes_them_away() {
    let place = place_of(&rough(1.0));
    let before = place.build();
    place.write("quad.gltf", scene_of(SHEEN));
    let with = place.build();
    let is_cloth = |action: &str| action.contains("sheen") || action.contains("charlie");
    let others: Vec<String> = ran(&with).into_iter().filter(|action| !is_cloth(action)).collect();
    assert_eq!(others, ["pack scene/quad"], "{:?}", ran(&with));
    assert_eq!(levels(&with, "env/room/sheen"), ["mip1", "mip2"]);
    let added: Vec<&str> =
        names(&with).into_iter().filter(|name| !before.targets.contains_key(*name)).collect();
    assert_eq!(added, ["env/room/sheen", "lut/charlie"]);
    for same in ["env/room/specular", "env/room/irradiance", "env/room/skybox", "lut/ggx"] {
        assert_eq!(with.targets[same].digest(), before.targets[same].digest(), "{same}");
    }
    place.write("quad.gltf", scene_of(&rough(1.0)));
    let after = place.build();
    assert_eq!(names(&after), names(&before));
    assert!(ran(&after).is_empty(), "{:?}", ran(&after));
}

#[test]
fn effects_are_forced_and_forbidden_by_the_project() {
    let forced = place_of(&rough(1.0));
    forced.edit("kiln.toml", "[scene.quad]", "[effects]\nforce = [\"sheen\"]\n[scene.quad]");
    assert_eq!(levels(&forced.build(), "env/room/sheen").len(), 4);
    let forbidden = place_of(SHEEN);
    forbidden.edit("kiln.toml", "[scene.quad]", "[effects]\nforbid = [\"sheen\"]\n[scene.quad]");
    let built = forbidden.build();
    assert!(!built.targets.contains_key("env/room/sheen") && !built.targets.contains_key("lut/charlie"));
    forbidden.edit("kiln.toml", "forbid = [\"sheen\"]", "forbid = [\"shine\"]");
    let wrong = forbidden.build();
    assert!(errors(&wrong)[0].to_string().contains("there is no effect `shine`"), "{:?}", wrong.diagnostics);
}

#[test]
fn scene_that_was_never_readable_may_need_anything_and_one_that_was_keeps_what_it_had() {
    let never = place_of("{ not json");
    assert_eq!(levels(&never.build(), "env/room/specular").len(), 4);
    let place = place_of(&rough(0.9));
    place.build();
    place.write("quad.gltf", "{ not json");
    let broken = place.build();
    assert_eq!(levels(&broken, "env/room/specular"), ["mip2", "mip3"]);
    assert_eq!(broken.targets["env/room/specular"].state, TargetState::Fresh);
}

#[test]
fn blurred_background_is_a_reader() {
    let place = place_of(&rough(1.0));
    place.edit("kiln.toml", "size = 32\n", "size = 32\nbackground_blur = 0.3\n");
    assert_eq!(levels(&place.build(), "env/room/specular"), ["mip0", "mip1", "mip2", "mip3"]);
    let unlit = place_of(r#"{"name":"sign","extensions":{"KHR_materials_unlit":{}}}"#);
    unlit.edit("kiln.toml", "size = 32\n", "size = 32\nbackground_blur = 0.3\n");
    assert_eq!(levels(&unlit.build(), "env/room/specular"), ["mip0", "mip1"]);
}

#[test]
fn file_of_a_partial_chain_begins_at_its_first_level_and_says_so() {
    let place = place_of(&rough(0.9));
    place.build();
    let engine = place.engine();
    let targets = engine.published();
    let files = write_outputs(&engine, &targets, "baked").unwrap();
    assert!(files.written.contains(&"env/room/specular.ktx2".to_owned()), "{:?}", files.written);
    let bytes = fs::read(place.folder.path().join("baked/env/room/specular.ktx2")).unwrap();
    let width = u32::from_le_bytes(bytes[20..24].try_into().unwrap());
    let level_count = u32::from_le_bytes(bytes[40..44].try_into().unwrap());
    assert_eq!((width, level_count), (32 >> 2, 2));
    let says = |text: &[u8]| bytes.windows(text.len()).any(|window| window == text);
    assert!(
        says(b"KilnFirstLevel\x002") && says(b"KilnLevels\x004"),
        "the file does not say which levels it has"
    );
}

#[test]
fn each_environment_is_baked_for_the_union_of_its_own_scenes() {
    let place = place_of(&rough(0.0));
    place.write("cloth.gltf", scene_of(SHEEN));
    place.write("matt.gltf", scene_of(&rough(1.0)));
    let scene = |name: &str, env: &str| {
        format!("[scene.{name}]\nsource = \"{name}.gltf\"\nenv = \"{env}\"\nshader = \"flat\"\n")
    };
    let hall = "[env.hall]\nsource = \"room.hdr\"\nsize = 32\nirradiance_size = 4\n";
    place.edit("kiln.toml", "[shader.flat]", &format!("{hall}{}[shader.flat]", scene("cloth", "hall")));
    let apart = place.build();
    assert_eq!(levels(&apart, "env/room/specular"), ["mip0", "mip1", "mip2"]);
    assert_eq!(levels(&apart, "env/hall/specular"), ["mip3"]);
    assert!(!apart.targets.contains_key("env/room/sheen"));
    assert_eq!(levels(&apart, "env/hall/sheen"), ["mip1", "mip2"]);
    place.edit("kiln.toml", "[shader.flat]", &format!("{}[shader.flat]", scene("matt", "room")));
    let joined = place.build();
    assert_eq!(levels(&joined, "env/room/specular"), ["mip0", "mip1", "mip2", "mip3"]);
    let of_hall = |built: &Built| {
        let targets = built.targets.iter().filter(|(name, _)| name.starts_with("env/hall/"));
        targets.map(|(name, target)| (name.clone(), target.digest())).collect::<Vec<_>>()
    };
    assert_eq!(of_hall(&joined), of_hall(&apart));
    assert!(!ran(&joined).iter().any(|action| action.contains("hall")), "{:?}", ran(&joined));
}

/// Names of the material shader's variants.
fn variants(built: &Built) -> Vec<&str> {
    built.targets.keys().filter_map(|name| name.strip_prefix("shader/flat/")).collect()
}

#[test]
fn extracted_sun_calls_for_the_variant_that_it_lights_and_elsewhere_for_one_more() {
    let without = place_of(&rough(0.9));
    assert_eq!(variants(&without.build()), ["base"]);
    let own = place_of(&rough(0.9));
    own.edit("kiln.toml", "size = 32\n", "size = 32\nsun = \"extract\"\n");
    let built = own.build();
    assert_eq!(variants(&built), ["sun"]);
    assert!(built.plan.scenes[0].materials[0].effects.contains(&Effect::Sun));
    // Somebody may look at the scene in the light of an environment that it does not name.
    let other = place_of(&rough(0.9));
    other.edit(
        "kiln.toml",
        "[env.room]",
        "[env.yard]\nsource = \"room.hdr\"\nsize = 8\nsun = \"extract\"\n[env.room]",
    );
    assert_eq!(variants(&other.build()), ["base", "sun"]);
    let forbidden = place_of(&rough(0.9));
    forbidden.edit("kiln.toml", "size = 32\n", "size = 32\nsun = \"extract\"\n");
    forbidden.edit("kiln.toml", "[env.room]", "[effects]\nforbid = [\"sun\"]\n[env.room]");
    assert_eq!(variants(&forbidden.build()), ["base"]);
}

#[test]
fn project_without_scenes_shows_built_in_shapes_and_bakes_its_environment_whole() {
    let place = place_of(&rough(0.9));
    place.edit("kiln.toml", "[scene.quad]\nsource = \"quad.gltf\"\nenv = \"room\"\nshader = \"flat\"\n", "");
    let built = place.build();
    assert!(errors(&built).is_empty(), "{:?}", built.diagnostics);
    let shapes: Vec<&str> = built.targets.keys().filter_map(|name| name.strip_prefix("scene/")).collect();
    assert_eq!(shapes, ["cloth", "knob", "plane", "sphere"]);
    assert_eq!(variants(&built), ["base"]);
    assert_eq!(levels(&built, "env/room/specular"), ["mip0", "mip1", "mip2", "mip3"]);
    assert_eq!(built.targets["project"].meta["scenes"], serde_json::json!(shapes));
    let named = place_of(&rough(0.9));
    named.edit("kiln.toml", "source = \"quad.gltf\"", "source = \"shape:knob\"");
    assert!(names(&named.build()).contains(&"scene/quad"), "a scene may name a shape");
}
