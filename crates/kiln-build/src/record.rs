//! What is remembered of an action: the one list of inputs feeds both its key and every explanation.

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::Digest;
use crate::digest::FieldHasher;

/// Version of the key's definition; part of every key.
const KEY_VERSION: u32 = 1;

/// One thing an action read, by the name under which a person knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// A source path, or `action name/output`.
    pub name: String,
    /// Digest of its bytes; `None` when the source is missing.
    pub digest: Option<Digest>,
}

/// One thing an action made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputRecord {
    /// As `mip3`.
    pub name: String,
    /// Digest of its bytes.
    pub digest: Digest,
    /// Its length.
    pub bytes: u64,
}

/// An action with everything that decided its result, and the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionRecord {
    /// As `prefilter env/sky/specular mip 3`; not part of the key.
    pub name: String,
    /// What kind of step it is.
    pub kind: String,
    /// Version of the code that performs it.
    pub recipe: u32,
    /// Canonical parameters (JSON with sorted keys).
    pub params: serde_json::Value,
    /// Everything it read.
    pub inputs: Vec<InputRecord>,
    /// Everything it made; empty when the input is at fault.
    pub outputs: Vec<OutputRecord>,
    /// Facts about the outputs: sizes, errors, scales.
    pub meta: serde_json::Value,
    /// What it said.
    pub diagnostics: Vec<Diagnostic>,
    /// What it cost when it ran, in wall-clock milliseconds.
    pub wall_ms: f64,
}

impl ActionRecord {
    /// The digest of everything that can change the result: kind, recipe, parameters, inputs.
    pub fn key(&self) -> Digest {
        let mut hasher = FieldHasher::default();
        self.list_deciding_fields(&mut |name, value| hasher.field(name, value.as_bytes()));
        hasher.finish()
    }

    /// The one list behind [`ActionRecord::key`] and [`crate::explain`].
    pub(crate) fn list_deciding_fields(&self, sink: &mut dyn FnMut(&str, &str)) {
        sink("key version", &KEY_VERSION.to_string());
        sink("kind", &self.kind);
        sink("recipe version", &self.recipe.to_string());
        match &self.params {
            serde_json::Value::Object(params) => {
                for (name, value) in params {
                    sink(&format!("parameter {name}"), &value.to_string());
                }
            }
            other => sink("parameters", &other.to_string()),
        }
        for input in &self.inputs {
            let digest = input.digest.map_or_else(|| "missing".to_owned(), |digest| digest.to_string());
            sink(&format!("input {}", input.name), &digest);
        }
    }
}
