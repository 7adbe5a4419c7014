//! The error of all maps of an environment, as stored, against brute force.

use kiln_bake::{BruteForce, Lobe, Measured};
use kiln_build::{Action, ActionId, ActionOutput, Input};
use serde_json::{Map, Value, json};

use super::{LEVEL, Steps, cancel, command, damaged, ended, needs, output, panorama, report, sheen_alpha};
use crate::blob::environment_size;
use crate::environment::encode::Encode;

/// One map that is measured.
struct Subject {
    /// Target.
    map: &'static str,
    lobe: Lobe,
    face_size: usize,
}

impl Steps<'_> {
    /// Measures the irradiance and every prefiltered level. Its facts are `facts.MAP`, a list as long as the map has such
    /// levels.
    pub(super) fn measure(
        &self,
        decode: ActionId,
        irradiance: ActionId,
        specular: &[ActionId],
        sheen: &[ActionId],
    ) -> Action {
        let env = self.env.clone();
        let mut subjects =
            vec![Subject { map: "irradiance", lobe: Lobe::Lambert, face_size: env.irradiance_size }];
        for (map, actions) in [("specular", specular), ("sheen", sheen)] {
            let first = env.level_count() - actions.len();
            for level in first..env.level_count() {
                let roughness = env.roughness(level);
                let lobe = match map {
                    "specular" => Lobe::Ggx { alpha: roughness * roughness },
                    _ => Lobe::Charlie { alpha: sheen_alpha(roughness) },
                };
                subjects.push(Subject { map, lobe, face_size: env.face_size(level) });
            }
        }
        let levels = [irradiance].into_iter().chain(specular.iter().copied()).chain(sheen.iter().copied());
        let mut inputs: Vec<Input> = vec![output(decode, "environment"), output(decode, "report")];
        inputs.extend(levels.map(|level| output(level, LEVEL)));
        let lobes: Vec<String> =
            subjects.iter().map(|subject| format!("{:?} {}", subject.lobe, subject.face_size)).collect();
        let mut params = self.encoding();
        params["maps"] = json!(lobes);
        let action = self.action("", command("measure", 1, params, &["json"]), inputs, move |inputs| {
            let cancel = cancel(inputs);
            let truth = BruteForce::new(&*panorama(inputs, 0, env.texels)?, cancel).map_err(ended)?;
            let encode = Encode::new(&env, &report(inputs, 1)?);
            let mut facts: Map<String, Value> = Map::new();
            for (index, subject) in subjects.iter().enumerate() {
                let bytes = inputs.required(2 + index)?;
                let cube = encode
                    .decode(subject.face_size, &bytes)
                    .ok_or_else(|| damaged("a map level", &"its length is wrong"))?;
                let measured = truth.measure(&cube, subject.lobe, cancel).map_err(ended)?;
                let list = facts.entry(subject.map).or_insert_with(|| json!([]));
                list.as_array_mut().into_iter().for_each(|list| list.push(measured_facts(&measured)));
            }
            let mut text = serde_json::to_vec_pretty(&facts).unwrap_or_default();
            text.push(b'\n');
            Ok(ActionOutput {
                outputs: vec![("json".to_owned(), text)],
                meta: json!({"facts": facts}),
                diagnostics: Vec::new(),
            })
        });
        let memory = |lengths: &[usize]| {
            let (width, height) = environment_size(lengths[0]);
            // The environment stored, decoded, and in planes; a level stored and decoded.
            3 * 16 * width * height + 8 * lengths.iter().skip(2).max().copied().unwrap_or(0)
        };
        Action { memory: needs(memory), ..action }
    }
}

fn measured_facts(measured: &Measured) -> Value {
    json!({
        "probes": measured.probes,
        "rms": measured.rms,
        "largest": measured.largest,
        "worst": measured.worst,
    })
}
