//! What scenes call for and what follows from it, as text and JSON.

use std::collections::{BTreeMap, BTreeSet};

use kiln_build::Engine;
use kiln_project::{Effect, EffectSet, MaterialEffects, Plan, Reasons, SceneDemand, Skipped, made, skipped};
use serde_json::{Value, json};

use crate::out::say;
use crate::report;

/// Prints scene → effects → artefacts, variants and passes.
pub(crate) fn print(engine: &Engine, plan: &Plan) {
    for scene in &plan.scenes {
        print_scene(scene);
    }
    for (shader, variants) in variants(plan) {
        let count = report::count(variants.len(), "variant");
        say!("shader/{shader}: {count}, of those that materials have and no other: {}", listed(&variants));
    }
    say!("");
    for (what, reasons) in merged(made(plan)) {
        say!("needed   {what:<36} {}", reasons_text(reasons));
    }
    for Group { what, because, bytes, about_ms } in groups(skipped(engine, plan)) {
        let time = about_ms.map_or_else(String::new, |ms| format!(" and about {}", report::duration(ms)));
        say!("skipped  {what:<36} {because}; saves {}{time}", report::size(bytes));
    }
    for pass in passes(plan) {
        say!("{}  {:<36} {}", if pass.is_run() { "needed " } else { "skipped" }, pass.name, pass.reason());
    }
    say!("");
}

/// The same for machines.
pub(crate) fn to_json(engine: &Engine, plan: &Plan) -> Value {
    let material = |material: &MaterialEffects| {
        let effects: Vec<&str> = material.effects.iter().map(|effect| effect.name()).collect();
        json!({"material": material.material, "effects": effects, "reads": material.reads})
    };
    let scene = |scene: &SceneDemand| {
        let materials: Vec<Value> = scene.materials.iter().map(material).collect();
        json!({"scene": scene.name, "env": scene.env, "shader": scene.shader, "materials": materials})
    };
    let made: Vec<Value> = made(plan)
        .into_iter()
        .map(|(what, reasons)| {
            json!({"what": what, "because": reasons.iter().map(ToString::to_string).collect::<Vec<_>>()})
        })
        .collect();
    let skipped: Vec<Value> = skipped(engine, plan)
        .into_iter()
        .map(|it| json!({"what": it.what, "because": it.because, "bytes": it.bytes, "about_ms": it.about_ms}))
        .collect();
    let passes: Vec<Value> = passes(plan)
        .into_iter()
        .map(|pass| json!({"pass": pass.name, "because": pass.reason(), "is_run": pass.is_run()}))
        .collect();
    json!({
        "scenes": plan.scenes.iter().map(scene).collect::<Vec<_>>(),
        "variants": variants(plan),
        "needed": made,
        "skipped": skipped,
        "passes": passes,
    })
}

fn print_scene(scene: &SceneDemand) {
    say!("scene/{}, lit by env/{}, drawn with shader/{}", scene.name, scene.env, scene.shader);
    for material in &scene.materials {
        let interval = |name: &str, reads: Option<[f32; 2]>| match reads {
            Some([low, high]) if low < high => format!("  {name} {low:.2} to {high:.2}"),
            Some([low, _]) => format!("  {name} {low:.2}"),
            None => String::new(),
        };
        let reads = interval("roughness", material.reads.ggx) + &interval("sheen", material.reads.charlie);
        say!("  {:<24} {:<40}{reads}", material.material, material.variant_name());
    }
}

/// The variants that materials ask for, by shader.
fn variants(plan: &Plan) -> BTreeMap<&str, BTreeSet<String>> {
    let mut variants: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for scene in &plan.scenes {
        let of_scene = scene.materials.iter().map(|material| material.variant_name());
        variants.entry(&scene.shader).or_default().extend(of_scene);
    }
    variants
}

fn listed(names: &BTreeSet<String>) -> String {
    names.iter().map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Levels with the same readers on one line.
pub(crate) fn merged(made: Vec<(String, &Reasons)>) -> Vec<(String, &Reasons)> {
    let mut merged: Vec<(String, &Reasons)> = Vec::new();
    for (what, reasons) in made {
        match merged.last_mut() {
            Some((last, known)) if *known == reasons && is_next_level(last, &what) => {
                extend_levels(last, &what);
            }
            _ => merged.push((what, reasons)),
        }
    }
    merged
}

fn is_next_level(last: &str, what: &str) -> bool {
    let map = |name: &str| name.split_once(" mip ").map(|(map, _)| map.to_owned());
    map(last).is_some() && map(last) == map(what)
}

/// `mip 2` and `mip 3` are `mip 2 to 3`.
fn extend_levels(last: &mut String, what: &str) {
    let level = what.rsplit(' ').next().unwrap_or_default();
    let until = last.find(" to ").unwrap_or(last.len());
    last.truncate(until);
    *last += &format!(" to {level}");
}

/// Skipped levels that are skipped for one reason.
pub(crate) struct Group {
    pub(crate) what: String,
    pub(crate) because: String,
    pub(crate) bytes: u64,
    about_ms: Option<f64>,
}

pub(crate) fn groups(skipped: Vec<Skipped>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for Skipped { what, because, bytes, about_ms } in skipped {
        match groups.last_mut() {
            Some(group) if is_next_level(&group.what, &what) && group.because == because => {
                extend_levels(&mut group.what, &what);
                group.bytes += bytes;
                group.about_ms = group.about_ms.zip(about_ms).map(|(sum, ms)| sum + ms);
            }
            _ => groups.push(Group { what, because, bytes, about_ms }),
        }
    }
    groups
}

/// The first reader, and how many more there are.
fn reasons_text(reasons: &Reasons) -> String {
    match reasons.as_slice() {
        [] => String::new(),
        [only] => only.to_string(),
        [first, rest @ ..] => format!("{first}, and {} more", rest.len()),
    }
}

/// Something that the preview does in a frame only where a material calls for it.
pub(crate) struct Pass {
    pub(crate) name: &'static str,
    /// Scenes and materials that call for it.
    pub(crate) users: Vec<(String, String)>,
    /// What is so if nothing does.
    nothing: &'static str,
}

impl Pass {
    pub(crate) fn is_run(&self) -> bool {
        !self.users.is_empty()
    }

    /// The first that calls for it and how many more do, or why it is left out.
    pub(crate) fn reason(&self) -> String {
        let named = |(scene, material): &(String, String)| format!("scene/{scene}: {material}");
        match self.users.as_slice() {
            [] => self.nothing.to_owned(),
            [only] => named(only),
            [first, rest @ ..] => format!("{}, and {} more", named(first), rest.len()),
        }
    }
}

pub(crate) fn passes(plan: &Plan) -> Vec<Pass> {
    let pass = |name: &'static str, nothing: &'static str, wanted: &dyn Fn(&EffectSet) -> bool| {
        let materials = |scene: &SceneDemand| {
            let wanting = scene.materials.iter().filter(|material| wanted(&material.effects));
            wanting.map(|material| (scene.name.clone(), material.material.clone())).collect::<Vec<_>>()
        };
        let mut users: Vec<(String, String)> = plan.scenes.iter().flat_map(materials).collect();
        // A material is listed once for each kind of geometry that has it.
        users.dedup();
        Pass { name, users, nothing }
    };
    let has = |effect: Effect| move |effects: &EffectSet| effects.contains(&effect);
    let glass = |effects: &EffectSet| has(Effect::Transmission)(effects) && !has(Effect::Unlit)(effects);
    let bends = [Effect::NormalMap, Effect::Anisotropy, Effect::Clearcoat];
    vec![
        pass("pass opaque", "every material is blended", &|effects| !has(Effect::AlphaBlend)(effects)),
        pass("picture of what stands behind glass", "no material transmits light", &glass),
        pass("pass blended, sorted by depth", "no material is transparent", &has(Effect::AlphaBlend)),
        pass("light loops", "no lit scene has lights of its own", &has(Effect::PunctualLights)),
        pass("shadow map of the sun", "no scene is lit by an extracted sun", &has(Effect::Sun)),
        pass("tangents", "no material bends normals or is brushed", &|effects| {
            bends.iter().any(|effect| effects.contains(effect))
        }),
        pass("skin uploads", "no animation moves what vertices hang on", &has(Effect::Skin)),
        pass("morph uploads", "no animation changes a morph target's weight", &has(Effect::Morph)),
        pass("instancing", "nothing is drawn in copies", &has(Effect::Instancing)),
    ]
}
