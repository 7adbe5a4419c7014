//! What the scenes of a project call for, and which maps and levels of each environment follow from it.
//!
//! A level is made if something reads it, and every level that something reads is made: the interval of roughness that a
//! material's values and textures give, widened by what the shipped shaders add when they filter normals, plus the
//! neighbours that a trilinear lookup touches, without gaps. Base size and law never depend on it.

use std::collections::BTreeMap;
use std::fmt;

use kiln_bake::RoughnessLaw;
use kiln_scene::{Effect, EffectOverrides, LightReads, MaterialEffects};

use crate::{EnvConfig, Project};

/// What one scene calls for.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDemand {
    /// Its name.
    pub name: String,
    /// The environment that lights it.
    pub env: String,
    /// The shader that draws it.
    pub shader: String,
    /// Its materials in the light of `env`, after `[effects]`.
    pub materials: Vec<MaterialEffects>,
    /// Whether they are known: a scene that could never be read may need anything.
    pub is_known: bool,
}

/// Something that wants a map or a level made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reason {
    /// A material is lit by it.
    Material {
        /// The scene.
        scene: String,
        /// The material.
        material: String,
        /// What of its values decides.
        values: String,
    },
    /// kiln.toml says so, or what else a sentence says.
    Said(String),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Material { scene, material, values } => write!(f, "scene/{scene}: {material}, {values}"),
            Reason::Said(sentence) => f.write_str(sentence),
        }
    }
}

/// Why something is made; empty if nothing reads it.
pub type Reasons = Vec<Reason>;

/// Which maps of an environment are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvDemand {
    /// Irradiance and its harmonics.
    pub light: Reasons,
    /// Each level of the GGX chain.
    pub specular: Vec<Reasons>,
    /// Each level of the Charlie chain.
    pub sheen: Vec<Reasons>,
}

/// Widest that the shipped shaders make a lobe to cover how a normal turns within a pixel, added to α² (`alpha2_filtered`
/// of shaders/lib/brdf.wgsl; Tokuyoshi and Kaplanyan 2019).
const FILTERING_ALPHA2: f64 = 0.18;

/// A level that is read by less than this much of a level is not: roughness factors are decimal fractions in binary.
const LEVEL_SLACK: f64 = 1e-4;

/// A material as the overrides leave it, with what it reads. What is forced has no values to go by: all of its lobe is read.
pub(crate) fn overridden(overrides: &EffectOverrides, material: &MaterialEffects) -> MaterialEffects {
    let effects = overrides.apply(&material.effects);
    let LightReads { mut ggx, mut charlie } = material.reads;
    if overrides.force.contains(&Effect::Sheen) && charlie.is_none() {
        charlie = Some([0.0, 1.0]);
    }
    if overrides.forbid.contains(&Effect::Unlit) && ggx.is_none() {
        ggx = Some([0.0, 1.0]);
    }
    if effects.contains(&Effect::Unlit) {
        (ggx, charlie) = (None, None);
    }
    if !effects.contains(&Effect::Sheen) {
        charlie = None;
    }
    MaterialEffects { effects, reads: LightReads { ggx, charlie }, ..material.clone() }
}

/// What each environment of a project is asked for.
pub(crate) fn env_demands(project: &Project, scenes: &[SceneDemand]) -> BTreeMap<String, EnvDemand> {
    let demand = |(name, env): (&String, &EnvConfig)| (name.clone(), env_demand(project, name, env, scenes));
    project.envs.iter().map(demand).collect()
}

fn env_demand(project: &Project, name: &str, env: &EnvConfig, scenes: &[SceneDemand]) -> EnvDemand {
    let count = env.level_count();
    let mut demand =
        EnvDemand { light: Vec::new(), specular: vec![Vec::new(); count], sheen: vec![Vec::new(); count] };
    let every_level = |levels: &mut Vec<Reasons>, reason: &str| {
        levels.iter_mut().for_each(|level| level.push(said(reason)));
    };
    if env.has_sheen {
        every_level(&mut demand.sheen, "`sheen = true`");
    }
    let is_used = project.scenes.values().any(|scene| scene.env == name);
    let unknown = scenes.iter().find(|scene| scene.env == name && !scene.is_known);
    let all = match (env.bakes_all, is_used, unknown) {
        (true, ..) => Some("`bake = \"all\"`".to_owned()),
        (_, false, _) => Some("no scene is lit by it, so none says what it needs".to_owned()),
        (.., Some(scene)) => Some(format!("what scene/{} needs is not known", scene.name)),
        (false, true, None) => None,
    };
    if let Some(reason) = all {
        demand.light.push(said(&reason));
        every_level(&mut demand.specular, &reason);
    }
    if env.background_blur > 0.0 {
        let reason = said(&format!("`background_blur = {}`", env.background_blur));
        for level in read_levels(env, [0.0, env.background_blur]) {
            demand.specular[level].push(reason.clone());
        }
    }
    // One that no scene names is there to be chosen in the preview, for any of them.
    for scene in scenes.iter().filter(|scene| scene.env == name || !is_used) {
        for material in &scene.materials {
            let reason = |values: String| Reason::Material {
                scene: scene.name.clone(),
                material: material.material.clone(),
                values,
            };
            if let Some([low, high]) = material.reads.ggx.map(|interval| interval.map(f64::from)) {
                push_new(&mut demand.light, reason("lit".to_owned()));
                let widest = filtered(high);
                let values = format!("{}, filtered up to {widest:.2}", interval_text("roughness", low, high));
                for level in read_levels(env, [low, widest]) {
                    push_new(&mut demand.specular[level], reason(values.clone()));
                }
            }
            if let Some([low, high]) = material.reads.charlie.map(|interval| interval.map(f64::from)) {
                let values = interval_text("sheen roughness", low, high);
                for level in read_levels(env, [low, high]) {
                    push_new(&mut demand.sheen[level], reason(values.clone()));
                }
            }
        }
    }
    [&mut demand.specular, &mut demand.sheen].into_iter().for_each(|chain| close_gaps(chain));
    demand
}

/// A material that is drawn with several kinds of geometry reads the environment once.
fn push_new(reasons: &mut Reasons, reason: Reason) {
    if reasons.last() != Some(&reason) {
        reasons.push(reason);
    }
}

/// Textures and their files have no gaps between levels.
fn close_gaps(chain: &mut [Reasons]) {
    let is_read = |reasons: &Reasons| !reasons.is_empty();
    let (Some(first), Some(last)) = (chain.iter().position(is_read), chain.iter().rposition(is_read)) else {
        return;
    };
    for level in &mut chain[first..=last] {
        if level.is_empty() {
            level.push(said("it lies between levels that are read"));
        }
    }
}

fn said(sentence: &str) -> Reason {
    Reason::Said(sentence.to_owned())
}

fn interval_text(what: &str, low: f64, high: f64) -> String {
    if (high - low).abs() < 1e-6 {
        format!("{what} {low:.2}")
    } else {
        format!("{what} {low:.2} to {high:.2}")
    }
}

/// The roughness that filtering of normals makes of a roughness at most.
fn filtered(roughness: f64) -> f64 {
    (roughness.powi(4) + FILTERING_ALPHA2).min(1.0).sqrt().sqrt()
}

/// The levels that trilinear lookups of an interval of roughness touch: by the chain's law, and by the linear one of the
/// preview's shaders.
fn read_levels(env: &EnvConfig, [low, high]: [f64; 2]) -> std::ops::RangeInclusive<usize> {
    let count = env.level_count();
    let level = |law: &RoughnessLaw, roughness: f64| law.level(roughness, count);
    let laws = [&env.law, &RoughnessLaw::Linear];
    let first = laws.map(|law| level(law, low) + LEVEL_SLACK).into_iter().fold(f64::INFINITY, f64::min);
    let last = laws.map(|law| level(law, high) - LEVEL_SLACK).into_iter().fold(0.0, f64::max);
    let (first, last) = (first.floor() as usize, last.ceil().max(0.0) as usize);
    first.min(count - 1)..=last.max(first).min(count - 1)
}

impl EnvDemand {
    /// Whether anything but the skybox is read.
    pub fn is_light_read(&self) -> bool {
        [&self.specular, &self.sheen].into_iter().flatten().any(|level| !level.is_empty())
            || !self.light.is_empty()
    }

    /// Whether any level of the Charlie chain is read.
    pub fn is_sheen_read(&self) -> bool {
        self.sheen.iter().any(|level| !level.is_empty())
    }

    /// The levels of a chain that are read: a range.
    pub fn levels(chain: &[Reasons]) -> std::ops::Range<usize> {
        let is_read = |reasons: &Reasons| !reasons.is_empty();
        let first = chain.iter().position(is_read).unwrap_or(0);
        first..chain.iter().rposition(is_read).map_or(first, |last| last + 1)
    }
}
