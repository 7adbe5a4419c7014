//! Actions of `[scene.NAME]`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use kiln_build::{Action, ActionOutput, Engine, Error, Input, Tracker, little_memory};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_scene::{
    BUILT_IN, EffectSet, MaterialEffects, PackOptions, Packed, SpecularGlossinessAs, built_in, pack_with,
    variant_name,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::config::leaves_project;
use crate::demand::overridden;
use crate::environment::{command, failure};
use crate::plan::{PartSpec, Planner, no_content, rank, unreadable};
use crate::shader::Variants;
use crate::{Project, Role, SceneConfig, SceneDemand};

/// What a scan of a scene tells the planner.
#[derive(Default, Serialize, Deserialize)]
struct SceneScan {
    /// `None` if the scene cannot be drawn.
    materials: Option<Vec<MaterialEffects>>,
}

/// Version of the code behind both the scan and the action.
const PACK_RECIPE: u32 = 8;

/// What the source of a scene begins with that is one of [`BUILT_IN`].
const SHAPE: &str = "shape:";

/// What is shown of a project without scenes: every built-in shape in its first environment. What they call for decides nothing
/// of that environment, which is baked as if nothing were known of what it lights.
pub(crate) fn shapes(project: &Project) -> BTreeMap<String, SceneConfig> {
    let is_material = |name: &&String| project.shaders[*name].role == Role::Material;
    let pbr = "pbr".to_owned();
    let shader = project.shaders.keys().find(|name| **name == pbr).filter(is_material);
    let shader = shader.or_else(|| project.shaders.keys().find(is_material));
    let (Some(shader), Some(env), true) = (shader, project.envs.keys().next(), project.scenes.is_empty())
    else {
        return BTreeMap::new();
    };
    let scene = |name: &&str| SceneConfig {
        source: format!("{SHAPE}{name}"),
        env: env.clone(),
        shader: shader.clone(),
        specular_glossiness: SpecularGlossinessAs::default(),
    };
    BUILT_IN.iter().map(|name| ((*name).to_owned(), scene(name))).collect()
}

/// The file of a built-in shape.
fn shape(source: &str) -> Option<Arc<[u8]>> {
    built_in(source.strip_prefix(SHAPE)?).map(Arc::from)
}

/// Adds the actions and targets of one scene and notes the shader variants that it calls for.
pub(crate) fn plan_scene(
    planner: &mut Planner,
    engine: &Engine,
    project: &Project,
    name: &str,
    config: &SceneConfig,
    variants: &mut Variants,
) -> Result<SceneDemand, Error> {
    let options = PackOptions {
        allowed_folders: project.allowed_folders.clone(),
        specular_glossiness: config.specular_glossiness,
    };
    let kind = format!("scene {}", json!(options));
    let scan = engine
        .scan(&kind, PACK_RECIPE, &config.source, |tracker| scan_scene(&options, &config.source, tracker))?;
    // Where links lead is no content, so no scan can remember it.
    let references = scan.looked_at.iter().map(|(path, _)| path).filter(|path| **path != config.source);
    let astray: Vec<String> = references
        .filter(|path| is_astray(engine.folder(), &options.allowed_folders, path))
        .cloned()
        .collect();
    let found = SceneScan::deserialize(&scan.found).unwrap_or_default();
    // While a scene cannot be read, what it last called for stays.
    let materials = found.materials.filter(|_| astray.is_empty()).or_else(|| last_materials(engine, name));
    let is_known = materials.is_some();
    let mut materials: Vec<MaterialEffects> =
        materials.iter().flatten().map(|material| overridden(&project.effects, material)).collect();
    ask_variants(&mut materials, project, config, variants);
    let inputs =
        scan.looked_at.iter().map(|(path, digest)| Input::Source { path: path.clone(), digest: *digest });
    let (source, files) = (config.source.clone(), scan.clone());
    let unreadable = unreadable(engine, &source);
    // Which folders are allowed shows in what was looked at; absolute ones have no place in a manifest.
    let mut params = json!({
        "source": source, "unreadable": unreadable, "specular_glossiness": config.specular_glossiness,
    });
    if !astray.is_empty() {
        params["astray"] = json!(astray);
    }
    let pack = planner.graph.add(Action {
        name: format!("pack scene/{name}"),
        command: command("pack", PACK_RECIPE, params, &["glb", "effects"]),
        inputs: inputs.collect(),
        rank: rank::SCENE,
        memory: little_memory(),
        perform: Arc::new(move |inputs| {
            let mut contents = BTreeMap::new();
            for (index, (path, _)) in files.looked_at.iter().enumerate() {
                contents.insert(path.as_str(), inputs.bytes(index)?);
            }
            if !astray.is_empty() {
                let diagnostics = astray.iter().map(|path| led_astray(path)).collect();
                return Ok(ActionOutput { diagnostics, ..ActionOutput::default() });
            }
            let mut read = |path: &str| contents.get(path).cloned().flatten();
            Ok(match shape(&source).or_else(|| read(&source)) {
                Some(bytes) => pack_scene(pack_with(&options, &source, &bytes, &mut read)),
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

/// Asks for the variants that the scene is drawn with in its own environment, which `materials` then have, and for those that it
/// is drawn with if somebody looks at it in another one whose sun is a light.
fn ask_variants(
    materials: &mut [MaterialEffects],
    project: &Project,
    config: &SceneConfig,
    variants: &mut Variants,
) {
    let mut ask = |effects: &EffectSet| {
        variants.ask(&config.shader, effects.iter().map(|effect| effect.name().to_owned()).collect());
    };
    let has_sun = project.envs.get(&config.env).is_some_and(|env| env.is_sun_extracted);
    let has_any_sun = project.envs.values().any(|env| env.is_sun_extracted);
    for material in materials {
        let in_sun = project.effects.under_sun(&material.effects);
        if has_sun {
            material.effects = in_sun;
        } else if has_any_sun {
            ask(&in_sun);
        }
        ask(&material.effects);
    }
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
fn scan_scene(options: &PackOptions, source: &str, tracker: &mut Tracker) -> (Value, Vec<Diagnostic>) {
    let Some(bytes) = shape(source).or_else(|| tracker.read(source)) else {
        return (json!(SceneScan::default()), Vec::new());
    };
    let packed = pack_with(options, source, &bytes, &mut |path| tracker.read(path));
    let is_sound = packed.glb.is_some() && !has_errors(&packed.diagnostics);
    (json!(SceneScan { materials: is_sound.then_some(packed.effects) }), Vec::new())
}

/// Whether a path outside the project that may be referred to leads on, through a link, to a place that may not. Links
/// in the project are its owner's, who may link whatever there is.
fn is_astray(folder: &Path, allowed_folders: &[String], path: &str) -> bool {
    let Some(place) = leaves_project(path).then(|| folder.join(path).canonicalize().ok()).flatten() else {
        return false;
    };
    let mut folders = allowed_folders.iter().filter_map(|allowed| folder.join(allowed).canonicalize().ok());
    !place.starts_with(folder) && !folders.any(|allowed| place.starts_with(allowed))
}

fn led_astray(path: &str) -> Diagnostic {
    Diagnostic::error(format!("`{path}` is a link that leads out of the folders that the project allows"))
        .with_help("copy the file to where the link is, or allow the folder it leads to in `allow_folders` of [project]")
}

fn pack_scene(packed: Packed) -> ActionOutput {
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
