//! Actions of `[scene.NAME]`.

use std::collections::BTreeMap;
use std::sync::Arc;

use kiln_build::{Action, ActionOutput, Engine, Error, Input, Tracker, little_memory};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_scene::{MaterialEffects, variant_name};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::demand::overridden;
use crate::environment::{command, failure};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use crate::shader::Variants;
use crate::{EffectOverrides, SceneConfig, SceneDemand};

/// What a scan of a scene tells the planner.
#[derive(Default, Serialize, Deserialize)]
struct SceneScan {
    /// `None` if the scene cannot be drawn.
    materials: Option<Vec<MaterialEffects>>,
}

/// Version of the code behind both the scan and the action.
const PACK_RECIPE: u32 = 6;

/// Adds the actions and targets of one scene and notes the shader variants that it calls for.
pub(crate) fn plan_scene(
    planner: &mut Planner,
    engine: &Engine,
    name: &str,
    config: &SceneConfig,
    overrides: &EffectOverrides,
    variants: &mut Variants,
) -> Result<SceneDemand, Error> {
    let scan =
        engine.scan("scene", PACK_RECIPE, &config.source, |tracker| scan_scene(&config.source, tracker))?;
    let found = SceneScan::deserialize(&scan.found).unwrap_or_default();
    // While a scene cannot be read, what it last called for stays.
    let materials = found.materials.or_else(|| last_materials(engine, name));
    let is_known = materials.is_some();
    let materials: Vec<MaterialEffects> =
        materials.iter().flatten().map(|material| overridden(overrides, material)).collect();
    for material in &materials {
        let features = material.effects.iter().map(|effect| effect.name().to_owned());
        variants.ask(&config.shader, features.collect());
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
    let (env, shader) = (config.env.clone(), config.shader.clone());
    Ok(SceneDemand { name: name.to_owned(), env, shader, materials, is_known })
}

/// The materials of what was published last of a scene.
fn last_materials(engine: &Engine, name: &str) -> Option<Vec<MaterialEffects>> {
    let published = engine.published();
    let part = published.get(&format!("scene/{name}"))?.parts.iter().find(|part| part.name == "effects")?;
    let mut effects: Value = serde_json::from_slice(&engine.store().get(&part.digest)?).ok()?;
    serde_json::from_value(effects["materials"].take()).ok()
}

/// Reads the scene once to learn which files it consists of and which effects it calls for. What is wrong
/// with it is said by the action, which reads the same files.
fn scan_scene(source: &str, tracker: &mut Tracker) -> (Value, Vec<Diagnostic>) {
    let Some(bytes) = tracker.read(source) else { return (json!(SceneScan::default()), Vec::new()) };
    let packed = kiln_scene::pack(source, &bytes, &mut |path| tracker.read(path));
    let is_sound = packed.glb.is_some() && !has_errors(&packed.diagnostics);
    (json!(SceneScan { materials: is_sound.then_some(packed.effects) }), Vec::new())
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
            "reads": material.reads,
        })
    });
    let effects = serde_json::to_vec_pretty(&json!({"materials": materials.collect::<Vec<_>>()}));
    let notes: Vec<&str> = packed.diagnostics.iter().map(|diagnostic| diagnostic.message.as_str()).collect();
    let meta = json!({"shared": {"notes": notes}});
    let outputs = vec![("glb".to_owned(), glb), ("effects".to_owned(), effects.unwrap_or_default())];
    ActionOutput { outputs, meta, diagnostics: packed.diagnostics }
}
