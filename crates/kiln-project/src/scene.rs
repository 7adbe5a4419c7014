//! Actions of `[scene.NAME]`.

use std::collections::BTreeMap;
use std::sync::Arc;

use kiln_build::{Action, ActionOutput, Engine, Error, Input, Tracker, little_memory};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_scene::{EffectSet, variant_name};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::SceneConfig;
use crate::environment::{command, failure};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use crate::shader::Variants;

/// What a scan of a scene tells the planner.
#[derive(Default, Serialize, Deserialize)]
struct SceneScan {
    /// One list of effect names for each material that is used.
    effect_sets: Vec<Vec<String>>,
}

/// Version of the code behind both the scan and the action.
const PACK_RECIPE: u32 = 3;

/// Adds the actions and targets of one scene and notes the shader variants that it calls for.
pub(crate) fn plan_scene(
    planner: &mut Planner,
    engine: &Engine,
    name: &str,
    config: &SceneConfig,
    variants: &mut Variants,
) -> Result<(), Error> {
    let scan =
        engine.scan("scene", PACK_RECIPE, &config.source, |tracker| scan_scene(&config.source, tracker))?;
    let found = SceneScan::deserialize(&scan.found).unwrap_or_default();
    for effects in found.effect_sets {
        variants.ask(&config.shader, effects.into_iter().collect());
    }
    let inputs =
        scan.looked_at.iter().map(|(path, digest)| Input::Source { path: path.clone(), digest: *digest });
    let (source, files) = (config.source.clone(), scan.clone());
    let unreadable = unreadable(engine, &source);
    let pack = planner.graph.add(Action {
        name: format!("pack scene/{name}"),
        command: command(
            "pack",
            PACK_RECIPE,
            json!({"source": source, "unreadable": unreadable}),
            &["glb", "effects"],
        ),
        inputs: inputs.collect(),
        rank: rank::SCENE,
        memory: little_memory(),
        perform: Arc::new(move |inputs| {
            let mut contents = BTreeMap::new();
            for (index, (path, _)) in files.looked_at.iter().enumerate() {
                contents.insert(path.as_str(), inputs.bytes(index)?);
            }
            let mut read = |path: &str| contents.get(path).cloned().flatten();
            Ok(match read(&source) {
                Some(bytes) => pack_scene(&source, &bytes, &mut read),
                None => failure(no_content("scene", unreadable.as_deref())),
            })
        }),
    });
    planner.subjects.insert(pack, config.source.clone());
    let meta = json!({"env": config.env, "shader": config.shader});
    let parts = vec![PartSpec::one(pack, "glb"), PartSpec::one(pack, "effects")];
    planner.target(format!("scene/{name}"), "scene", meta, parts);
    Ok(())
}

/// Reads the scene once to learn which files it consists of and which effects it calls for. What is wrong
/// with it is said by the action, which reads the same files.
fn scan_scene(source: &str, tracker: &mut Tracker) -> (Value, Vec<Diagnostic>) {
    let Some(bytes) = tracker.read(source) else { return (json!(SceneScan::default()), Vec::new()) };
    let packed = kiln_scene::pack(source, &bytes, &mut |path| tracker.read(path));
    let sets: std::collections::BTreeSet<&EffectSet> =
        packed.effects.iter().map(|material| &material.effects).collect();
    let names = |set: &EffectSet| set.iter().map(|effect| effect.name().to_owned()).collect();
    (json!(SceneScan { effect_sets: sets.into_iter().map(names).collect() }), Vec::new())
}

fn pack_scene(source: &str, bytes: &[u8], read: &mut dyn FnMut(&str) -> Option<Arc<[u8]>>) -> ActionOutput {
    let packed = kiln_scene::pack(source, bytes, read);
    let Some(glb) = packed.glb.filter(|_| !has_errors(&packed.diagnostics)) else {
        return ActionOutput { diagnostics: packed.diagnostics, ..ActionOutput::default() };
    };
    let materials = packed.effects.iter().map(|material| {
        json!({
            "material": material.material,
            "variant": variant_name(&material.effects),
            "effects": material.effects.iter().map(|effect| effect.name()).collect::<Vec<_>>(),
            "roughness": material.roughness,
        })
    });
    let effects = serde_json::to_vec_pretty(&json!({"materials": materials.collect::<Vec<_>>()}));
    let notes: Vec<&str> = packed.diagnostics.iter().map(|diagnostic| diagnostic.message.as_str()).collect();
    let meta = json!({"shared": {"notes": notes}});
    let outputs = vec![("glb".to_owned(), glb), ("effects".to_owned(), effects.unwrap_or_default())];
    ActionOutput { outputs, meta, diagnostics: packed.diagnostics }
}
