//! What is made for somebody who looks into frames or turns an error up and down, and for nobody else.

use std::collections::BTreeMap;

use super::*;

const KNOWING: &str = "
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }
@fragment fn fs_main() -> @location(0) vec4f {
    @if(inspect) return vec4f(0.5);
    @elif(unlit) return vec4f(1.0);
    @else return vec4f(0.25);
}
";

impl Place {
    fn build_with(&self, wishes: Wishes) -> Built {
        let engine = self.engine();
        let cancel = AtomicBool::new(false);
        let built = build_with(&engine, None, wishes, &options(&cancel)).unwrap().unwrap();
        engine.save_memory().unwrap();
        built
    }
}

const INSPECT: Wishes = Wishes { inspect: true, errors: BTreeMap::new() };

fn extras(built: &Built) -> Vec<&str> {
    built.targets.keys().map(String::as_str).filter(|name| Wishes::is_extra(name)).collect()
}

#[test]
fn variants_that_show_channels_are_made_by_wish_and_gone_without() {
    let place = Place::new();
    place.write("flat.wgsl", KNOWING);
    let plain = place.build();
    let manifest = place.write_outputs(&plain.targets).manifest;
    let inspected = place.build_with(INSPECT);
    assert_eq!(extras(&inspected), ["inspect/flat/base", "inspect/flat/unlit", "inspect/shaders"]);
    assert_eq!(ran(&inspected), ["compile shader/flat/inspect", "compile shader/flat/inspect+unlit"]);
    assert_eq!(inspected.targets["inspect/shaders"].meta["shaders"], serde_json::json!(["flat"]));
    let without: Targets = inspected
        .targets
        .iter()
        .filter(|(name, _)| !Wishes::is_extra(name))
        .map(|(k, v)| (k.clone(), v.clone()))
        .collect();
    assert_eq!(without, *plain.targets, "what everybody gets is as it was");
    assert_eq!(
        place.write_outputs(&inspected.targets).manifest,
        manifest,
        "files for engines know nothing of it"
    );
    let again = place.build();
    assert_eq!((again.targets, extras(&plain)), (plain.targets.clone(), Vec::new()));
    assert_eq!(again.plan.graph.iter().count(), plain.plan.graph.iter().count());
}

#[test]
fn error_keeps_no_variants_that_nobody_wishes_for() {
    let place = Place::new();
    place.write("flat.wgsl", KNOWING);
    place.build_with(INSPECT);
    place.edit("flat.wgsl", "vec4f(0.25)", "vec4f(quarter)");
    let stale = place.build_with(INSPECT);
    assert_eq!(errors(&stale).len(), 1);
    assert_eq!(stale.targets["inspect/flat/base"].state, TargetState::Fresh, "its own text has no fault");
    assert_eq!(stale.targets["shader/flat/base"].state, TargetState::Stale);
    assert_eq!(extras(&place.build()), Vec::<&str>::new());
}

#[test]
fn shader_without_the_feature_has_no_such_variants() {
    let place = Place::new();
    let built = place.build_with(INSPECT);
    assert_eq!(extras(&built), ["inspect/shaders"]);
    assert_eq!(built.targets["inspect/shaders"].meta["shaders"], serde_json::json!([]));
}

#[test]
fn environment_is_baked_at_another_error_by_wish_and_as_kiln_toml_says_without() {
    let place = Place::new();
    let plain = place.build();
    let error = 0.05;
    let wishes =
        |name: &str| Wishes { errors: BTreeMap::from([(name.to_owned(), error)]), ..Wishes::default() };
    assert!(wishes("room").change_maps() && !INSPECT.change_maps());
    let coarse = place.build_with(wishes("room"));
    assert_eq!(coarse.plan.project.envs["room"].error, error);
    assert!(ran(&coarse).iter().any(|name| name.contains("env/room")), "{:?}", ran(&coarse));
    let again = place.build();
    assert!(ran(&again).is_empty(), "the cache has what kiln.toml asks for: {:?}", ran(&again));
    assert_eq!(again.targets, plain.targets);
    let nobody = place.build_with(wishes("dusk"));
    assert!(ran(&nobody).is_empty(), "no environment has this name: {:?}", ran(&nobody));
}
