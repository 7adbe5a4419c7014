//! Each effect by itself: what its coming runs and publishes, and what a scene without it holds.

use std::collections::BTreeSet;

use kiln_scene::variant_name;

use self::rows::{Patch, Row, groups, rows};
use super::*;

mod rows;

const PROJECT: &str = r#"version = 1
[env.room]
source = "room.hdr"
size = 32
irradiance_size = 4
[scene.thing]
source = "thing.gltf"
env = "room"
shader = "pbr"
[shader.pbr]
source = "shaders/pbr/pbr.wgsl"
"#;

/// A project with the shipped shaders, whose one scene is still to be written.
fn place() -> Place {
    let place = Place::new();
    place.write("kiln.toml", PROJECT);
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for folder in ["shaders/lib", "shaders/pbr"] {
        for entry in fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{folder}/{}", path.file_name().unwrap().to_str().unwrap());
            place.write(&name, fs::read(path).unwrap());
        }
    }
    place.write(rows::GEOMETRY, rows::accessors().2);
    for (name, texel) in rows::TEXTURES {
        place.write(name, kiln_image::png::encode_rgb8(1, 1, &texel));
    }
    place
}

/// Builds with the scene of these patches.
#[track_caller]
fn build_scene(place: &Place, patches: &[&Patch]) -> Built {
    place.write("thing.gltf", rows::scene(patches));
    let built = place.build();
    assert!(errors(&built).is_empty(), "{:?}", built.diagnostics);
    built
}

/// Features that conditions of the material shader name: others make no difference to it.
fn known_features() -> BTreeSet<String> {
    let place = place();
    let program = kiln_shader::Program::of("shaders/pbr/pbr.wgsl");
    let mut read = |path: &str| {
        let text = fs::read_to_string(place.folder.path().join(path)).ok()?;
        Some(text.into())
    };
    kiln_shader::scan(&program, &mut read).features.into_iter().collect()
}

fn variant(effects: &BTreeSet<Effect>) -> String {
    format!("shader/pbr/{}", variant_name(effects))
}

/// Names of the actions that ran, sorted, and why.
fn ran_because(built: &Built) -> Vec<(String, String)> {
    let mut ran: Vec<(String, String)> = Vec::new();
    for (id, outcome) in built.plan.graph.iter().map(|(id, _)| (id, built.report.outcome(id))) {
        if let Status::Ran { reason } = &outcome.status {
            ran.push((built.plan.graph.action(id).name.clone(), reason.to_string()));
        }
    }
    ran.sort();
    ran
}

fn names(built: &Built) -> BTreeSet<&str> {
    built.targets.keys().map(String::as_str).collect()
}

fn set<'a>(names: impl IntoIterator<Item = &'a str>) -> BTreeSet<&'a str> {
    names.into_iter().collect()
}

#[test]
fn there_is_a_row_for_each_effect() {
    let effects: Vec<Effect> = rows().iter().map(|row| row.effect).collect();
    // The sun is no effect of a scene's.
    let of_scenes = Effect::ALL.into_iter().filter(|effect| *effect != Effect::Sun).collect::<BTreeSet<_>>();
    assert_eq!(effects.len(), of_scenes.len());
    assert_eq!(effects.into_iter().collect::<BTreeSet<_>>(), of_scenes);
}

#[test]
fn effect_that_comes_and_goes_brings_and_takes_exactly_what_its_row_lists() {
    let known = known_features();
    let grouped = groups().map(|group| (place(), group));
    for (place, row) in grouped.iter().flat_map(|(place, group)| group.iter().map(move |row| (place, row))) {
        let before = build_scene(place, &[&row.before]);
        let with = build_scene(place, &[&row.before, &row.with]);
        check_runs(row, &known, &with);
        check_targets(row, &before, &with);
        let after = build_scene(place, &[&row.before]);
        assert!(ran(&after).is_empty(), "{:?} goes: {:?}", row.effect, ran(&after));
        assert_eq!(after.targets, before.targets, "{:?}", row.effect);
    }
}

/// The pack runs because the scene's files changed, all else because it was never built.
#[track_caller]
fn check_runs(row: &Row, known: &BTreeSet<String>, with: &Built) {
    let compiled = row.sets().map(|set| {
        let features: BTreeSet<Effect> = set.into_iter().filter(|it| known.contains(it.name())).collect();
        format!("compile {}", variant(&features))
    });
    let mut expected = set(row.runs.iter().copied().chain(["pack scene/thing"]));
    if compiled[0] != compiled[1] {
        expected.insert(&compiled[1]);
    }
    let ran = ran_because(with);
    assert_eq!(set(ran.iter().map(|(name, _)| name.as_str())), expected, "{:?} comes: {ran:?}", row.effect);
    for (name, reason) in &ran {
        let is_changed = name == "pack scene/thing" || name.starts_with("measure env/room/specular");
        assert_eq!(reason == "first build", !is_changed, "{name}: {reason}");
    }
}

#[track_caller]
fn check_targets(row: &Row, before: &Built, with: &Built) {
    let variants = row.sets().map(|set| variant(&set));
    let names = [before, with].map(names);
    let came: BTreeSet<&str> = names[1].difference(&names[0]).copied().collect();
    assert_eq!(came, set(row.comes.iter().copied().chain([&*variants[1]])), "{:?} comes", row.effect);
    let gone: BTreeSet<&str> = names[0].difference(&names[1]).copied().collect();
    assert_eq!(gone, set(row.goes.iter().copied().chain([&*variants[0]])), "{:?} comes", row.effect);
    let stayed = names[0].intersection(&names[1]).copied();
    let changed: BTreeSet<&str> =
        stayed.filter(|name| before.targets[*name].digest() != with.targets[*name].digest()).collect();
    assert_eq!(changed, set(row.changes.iter().copied().chain(["scene/thing"])), "{:?} comes", row.effect);
}

#[test]
fn values_that_do_nothing_run_the_pack_alone_and_leave_no_trace() {
    let place = place();
    let mut wrong = Vec::new();
    for row in rows() {
        let Some(idle) = &row.idle else { continue };
        let before = build_scene(&place, &[&row.before]);
        let built = build_scene(&place, &[&row.before, idle]);
        // What geometry is like at rest is written where it was read; what materials are like, as if it had not been there.
        let is_compared = |name: &str| name != "scene/thing" || !row.effect.is_of_geometry();
        let parts = |built: &Built| -> Vec<_> {
            let compared = built.targets.iter().filter(|(name, _)| is_compared(name));
            compared.map(|(name, target)| (name.clone(), target.parts.clone())).collect()
        };
        let [without, _] = row.sets();
        let found = Held::of(&place, &built, &without).found(&row);
        if ran(&built) != ["pack scene/thing"] || parts(&built) != parts(&before) || !found.is_empty() {
            wrong.push((row.effect, ran(&built), found));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// What a scene's variant and pack hold of an effect.
struct Held {
    /// The variant's text and reflection.
    shader: String,
    /// The JSON of its pack.
    pack: String,
    /// The effects that were published.
    effects: String,
    /// The names of the shaders' targets and their features.
    published: String,
}

impl Held {
    fn of(place: &Place, built: &Built, effects: &BTreeSet<Effect>) -> Held {
        let engine = place.engine();
        let part = |target: &str, part: &str| {
            let parts = &built.targets[target].parts;
            let digest = &parts.iter().find(|it| it.name == part).unwrap().digest;
            engine.store().get(digest).unwrap()
        };
        let text = |target: &str, name: &str| String::from_utf8(part(target, name).to_vec()).unwrap();
        let shader = variant(effects);
        let glb = part("scene/thing", "glb");
        let json_len = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let shaders = built.targets.iter().filter(|(name, _)| name.starts_with("shader/"));
        let published: Vec<String> =
            shaders.map(|(name, target)| format!("{name} {}", target.meta["features"])).collect();
        Held {
            shader: text(&shader, "wgsl") + &text(&shader, "reflection"),
            pack: String::from_utf8(glb[20..20 + json_len].to_vec()).unwrap(),
            effects: text("scene/thing", "effects"),
            published: published.join(" "),
        }
    }

    /// Where a row's names are found.
    fn found(&self, row: &Row) -> Vec<String> {
        let begins = |text: &str, prefix: &str| words(text).any(|word| word.starts_with(prefix));
        let shader = row.shader.iter().filter(|prefix| begins(&self.shader, prefix));
        let pack = row.pack.iter().filter(|key| self.pack.contains(&format!("\"{key}\"")));
        let name = row.effect.name();
        let is_named = |text: &&str| words(text).any(|word| word == name);
        let lists = [("effects", &self.effects), ("published", &self.published)];
        let lists = lists.into_iter().filter(|(_, text)| is_named(&text.as_str()));
        let shader = shader.map(|prefix| format!("shader: {prefix}"));
        let pack = pack.map(|key| format!("pack: {key}"));
        shader.chain(pack).chain(lists.map(|(list, _)| list.to_owned())).collect()
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|character: char| !(character.is_ascii_alphanumeric() || character == '_'))
}

#[test]
fn scene_without_an_effect_holds_nothing_of_it_and_one_with_it_does() {
    let (place, known) = (place(), known_features());
    let mut wrong = Vec::new();
    for row in rows() {
        let [before, with] = row.sets();
        let held = Held::of(&place, &build_scene(&place, &[&row.before]), &before);
        if !held.found(&row).is_empty() {
            wrong.push(format!("without {:?}: {:?}", row.effect, held.found(&row)));
        }
        let held = Held::of(&place, &build_scene(&place, &[&row.before, &row.with]), &with);
        let shader: &[&str] = if known.contains(row.effect.name()) { row.shader } else { &[] };
        let shader = shader.iter().map(|prefix| format!("shader: {prefix}"));
        let pack = row.pack.iter().map(|key| format!("pack: {key}"));
        let lists = ["effects", "published"].map(str::to_owned);
        let expected: Vec<String> = shader.chain(pack).chain(lists).collect();
        if held.found(&row) != expected {
            wrong.push(format!("with {:?} the check sees only {:?}", row.effect, held.found(&row)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
