//! What is remembered of an action: the one list of inputs feeds both its key and every explanation.
//!
//! The parts are those of Bazel's Remote Execution API, so that a shared remote cache can stand behind them:
//!
//! | here | there |
//! |---|---|
//! | [`Command::kind`], [`Command::recipe`], [`Command::params`] | `Command.arguments` |
//! | [`Command::outputs`] | `Command.output_paths`: a file, or a folder of files |
//! | [`ActionRecord::inputs`] | the input root's tree, names as paths; a missing source is an argument |
//! | [`ActionRecord::key`] | the action's digest |
//! | [`ActionResult::outputs`] | `ActionResult.output_files` |
//! | [`ActionResult::meta`], [`ActionResult::diagnostics`] | `ActionResult.stdout_raw`; no outputs is `exit_code` 1 |
//! | [`ActionResult::wall_ms`] | `ActionResult.execution_metadata` |

use kiln_diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};

use crate::Digest;
use crate::digest::FieldHasher;

/// Version of the key's definition; part of every key.
const KEY_VERSION: u32 = 2;

/// What is done to the inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// What kind of step it is.
    pub kind: String,
    /// Version of the code that performs it.
    pub recipe: u32,
    /// Canonical parameters (JSON with sorted keys).
    pub params: serde_json::Value,
    /// What it makes: an output of this name, or any number below it (`levels` stands for `levels/mip0` …).
    pub outputs: Vec<String>,
}

/// One thing an action read, by the name under which a person knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputRecord {
    /// A source path, or `action name/output`.
    pub name: String,
    /// Digest of its bytes; `None` when the source is missing.
    pub digest: Option<Digest>,
    /// Its length; follows from the digest.
    pub bytes: u64,
    /// The output's name, if an action made it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_as: Option<String>,
}

/// One thing an action made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputRecord {
    /// As `panorama` or `levels/mip3`.
    pub name: String,
    /// Digest of its bytes.
    pub digest: Digest,
    /// Its length.
    pub bytes: u64,
}

/// What came of an action.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionResult {
    /// Everything it made; empty when the input is at fault.
    pub outputs: Vec<OutputRecord>,
    /// Facts about the outputs: sizes, errors, scales.
    pub meta: serde_json::Value,
    /// What it said.
    pub diagnostics: Vec<Diagnostic>,
    /// What it cost when it ran, in wall-clock milliseconds.
    pub wall_ms: f64,
}

/// An action with everything that decided its result, and the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionRecord {
    /// As `prefilter env/sky/specular mip 3`; not part of the key.
    pub name: String,
    /// What was done.
    pub command: Command,
    /// Everything it read, in the order in which the command takes it.
    pub inputs: Vec<InputRecord>,
    /// What came of it.
    pub result: ActionResult,
}

impl ActionRecord {
    /// The digest of everything that can change the result: kind, recipe, parameters, declared outputs, inputs. Contents
    /// made by actions count by their place and the output's name, so that equal work has one key whatever the actions
    /// before it are called; sources by their path, which may stand in what is made of them.
    pub fn key(&self) -> Digest {
        let mut hasher = FieldHasher::default();
        self.list_deciding_fields(&mut |field| hasher.field(&field.key, field.value.as_bytes()));
        hasher.finish()
    }

    /// The one list behind [`ActionRecord::key`] and [`crate::Reason`].
    pub(crate) fn list_deciding_fields(&self, sink: &mut dyn FnMut(DecidingField)) {
        let Command { kind, recipe, params, outputs } = &self.command;
        let mut field = |name: &str, value: String| {
            sink(DecidingField { key: name.to_owned(), shown: name.to_owned(), value });
        };
        field("key version", KEY_VERSION.to_string());
        field("kind", kind.clone());
        field("recipe version", recipe.to_string());
        match params {
            serde_json::Value::Object(params) => {
                params
                    .iter()
                    .for_each(|(name, value)| field(&format!("parameter {name}"), value.to_string()));
            }
            other => field("parameters", other.to_string()),
        }
        field("declared outputs", outputs.join(", "));
        for (index, input) in self.inputs.iter().enumerate() {
            let digest = input.digest.map_or_else(|| "missing".to_owned(), |digest| digest.to_string());
            let key = format!("input {index} {}", input.made_as.as_ref().unwrap_or(&input.name));
            sink(DecidingField { key, shown: format!("input {}", input.name), value: digest });
        }
    }
}

/// One thing that decides an action's result.
pub(crate) struct DecidingField {
    /// Its name in the key.
    pub(crate) key: String,
    /// Its name for people.
    pub(crate) shown: String,
    pub(crate) value: String,
}
