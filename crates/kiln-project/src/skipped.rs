//! What a plan makes for whom, and what it leaves out, with what that saves.

use kiln_build::Engine;

use crate::{EnvConfig, EnvDemand, Plan, Reasons};

/// A map or level that nothing calls for.
#[derive(Clone, Debug, PartialEq)]
pub struct Skipped {
    /// As `env/sky/specular mip 5`.
    pub what: String,
    /// Who would have to be there to read it.
    pub because: String,
    /// What it would take.
    pub bytes: u64,
    /// What it would take to bake, at the rate of the levels of this environment that were baked last; `None` if none was.
    pub about_ms: Option<f64>,
}

/// Each map and level of the environments that is made, and why.
pub fn made(plan: &Plan) -> Vec<(String, &Reasons)> {
    let mut made = Vec::new();
    for (name, demand) in &plan.envs {
        made.push((format!("env/{name}/irradiance"), &demand.light));
        for (map, chain) in [("specular", &demand.specular), ("sheen", &demand.sheen)] {
            let levels = chain.iter().enumerate();
            made.extend(levels.map(|(level, reasons)| (format!("env/{name}/{map} mip {level}"), reasons)));
        }
    }
    made.retain(|(_, reasons)| !reasons.is_empty());
    made
}

/// What is not made.
pub fn skipped(engine: &Engine, plan: &Plan) -> Vec<Skipped> {
    let mut skipped = Vec::new();
    for (name, demand) in &plan.envs {
        let env = &plan.project.envs[name];
        let rate = ms_per_byte(engine, name, env);
        let mut skip = |what: String, because: String, size: usize| {
            let bytes = level_bytes(env, size);
            skipped.push(Skipped { what, because, bytes, about_ms: rate.map(|rate| rate * bytes as f64) });
        };
        if demand.light.is_empty() {
            let because = "no material of its scenes is lit".to_owned();
            skip(format!("env/{name}/irradiance"), because, env.irradiance_size);
        }
        let has_sheen = demand.is_sheen_read();
        for (map, chain) in [("specular", &demand.specular), ("sheen", &demand.sheen)] {
            let read = EnvDemand::levels(chain);
            let reader = if map == "sheen" { "cloth" } else { "material" };
            for (level, _) in chain.iter().enumerate().filter(|(_, reasons)| reasons.is_empty()) {
                let because = match map {
                    "sheen" if !has_sheen => "no material of its scenes has sheen".to_owned(),
                    _ if read.is_empty() => "no material of its scenes is lit".to_owned(),
                    _ if level < read.start => format!("no {reader} of its scenes is as smooth"),
                    _ => format!("no {reader} of its scenes is as rough"),
                };
                skip(format!("env/{name}/{map} mip {level}"), because, env.face_size(level));
            }
        }
    }
    skipped
}

fn level_bytes(env: &EnvConfig, size: usize) -> u64 {
    let bytes = env.format.ktx2().level_bytes(size, size, 6, 0);
    bytes.and_then(|bytes| u64::try_from(bytes).ok()).unwrap_or(u64::MAX)
}

/// What the levels that were baked last took for each byte.
fn ms_per_byte(engine: &Engine, name: &str, env: &EnvConfig) -> Option<f64> {
    let (mut ms, mut bytes) = (0.0, 0);
    for level in 0..env.level_count() {
        if let Some((record, _)) = engine.history(&format!("prefilter env/{name}/specular mip {level}")) {
            ms += record.result.wall_ms;
            bytes += level_bytes(env, env.face_size(level));
        }
    }
    (bytes > 0).then(|| ms / bytes as f64)
}
