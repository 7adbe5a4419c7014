//! The error of an environment's maps, as stored, against brute force.

use kiln_bake::{BruteForce, Lobe, Measured};
use kiln_build::{Action, ActionId, Input};
use serde_json::{Value, json};

use super::{LEVEL, Steps, cancel, command, damaged, ended, needs, output, panorama, report, success};
use crate::blob::environment_size;
use crate::environment::encode::Encode;

/// A level that is measured.
pub(super) struct Subject {
    /// The action that makes it.
    pub(super) level: ActionId,
    pub(super) lobe: Lobe,
    pub(super) face_size: usize,
}

impl Steps<'_> {
    /// Measures the levels of one target. The result is a list as long as `subjects`, as text and among the facts.
    pub(super) fn measure(&self, map: &str, decode: ActionId, subjects: Vec<Subject>) -> Action {
        let env = self.env.clone();
        let mut inputs: Vec<Input> = vec![self.light(decode), output(decode, "report")];
        inputs.extend(subjects.iter().map(|subject| output(subject.level, LEVEL)));
        let lobes: Vec<String> =
            subjects.iter().map(|subject| format!("{:?} {}", subject.lobe, subject.face_size)).collect();
        let mut params = self.encoding();
        params["levels"] = json!(lobes);
        let command = command("measure", 1, params, &["json"]);
        let action = self.action(&format!("/{map}"), command, inputs, move |inputs| {
            let cancel = cancel(inputs);
            let panorama = panorama(inputs, 0)?;
            let truth = BruteForce::new(&panorama, cancel).map_err(ended)?;
            let encode = Encode::new(&env, &report(inputs, 1)?);
            let mut facts: Vec<Value> = Vec::new();
            for (index, subject) in subjects.iter().enumerate() {
                let bytes = inputs.required(2 + index)?;
                let cube = encode
                    .decode(subject.face_size, &bytes)
                    .ok_or_else(|| damaged("a map level", &"its length is wrong"))?;
                let measured = truth.measure(&cube, subject.lobe, cancel).map_err(ended)?;
                facts.push(measured_facts(&measured));
            }
            let mut text = serde_json::to_vec_pretty(&facts).unwrap_or_default();
            text.push(b'\n');
            Ok(success("json", text, json!({"facts": facts})))
        });
        let memory = |lengths: &[usize]| {
            let (width, height) = environment_size(lengths[0]);
            // The environment stored and decoded, perhaps from a cube; a level stored and decoded.
            3 * 12 * width * height + 8 * lengths.iter().skip(2).max().copied().unwrap_or(0)
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
