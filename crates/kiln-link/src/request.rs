//! What a client asks the daemon to do to the project, and what it hears of it.

use kiln_diagnostic::{Diagnostic, has_errors};
use serde::{Deserialize, Serialize};

/// Requests of a client that are not yet answered.
pub const REQUESTS_MAX: usize = 16;
/// Parameters in one request.
pub const PARAMETERS_MAX: usize = 1000;
/// Components of a parameter's value.
pub const COMPONENTS_MAX: usize = 4;
/// Files in one request.
pub const PATHS_MAX: usize = 64;
/// Bytes of a path: as many as systems take.
pub const PATH_BYTES_MAX: usize = 4096;
/// The most exact that an environment may be asked for, as in kiln.toml.
pub const ERROR_MIN: f64 = 1e-7;
/// The least exact.
pub const ERROR_MAX: f64 = 1.0;
/// Characters of a shader's, parameter's or environment's name.
pub const NAME_CHARS_MAX: usize = 256;

/// A request; each is answered by one [`Answer`], in any order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// The client's choice; the answer has it too.
    pub id: u64,
    /// What is asked.
    #[serde(flatten)]
    pub ask: Ask,
}

/// What a client may ask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case")]
pub enum Ask {
    /// Write values into the sources of shaders that declare them: all of these or none.
    WriteParameters {
        /// Which, with what.
        parameters: Vec<ParameterWrite>,
    },
    /// Add environments and scenes to the project.
    AddFiles {
        /// Absolute paths on the machine that both are on.
        paths: Vec<String>,
    },
    /// Bake an environment at another error than its sources say, until the client goes; the most exact that any client asks for
    /// counts. No source is changed, and no baked file. Only for clients that follow revisions.
    BakeAtError {
        /// The environment's name in kiln.toml.
        env: String,
        /// Relative RMS error that may remain, in [`ERROR_MIN`] … [`ERROR_MAX`]; `None` ends it.
        error: Option<f64>,
    },
    /// Something that this side does not know.
    #[serde(other)]
    Unknown,
}

/// A value to write into a shader's source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterWrite {
    /// The shader's name in kiln.toml.
    pub shader: String,
    /// The parameter's name there.
    pub name: String,
    /// Its value, component by component; a colour has three, a truth value is 0 or 1.
    pub value: Vec<f64>,
}

/// What became of a request. It was done unless there is an error among the diagnostics.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The request's.
    pub id: u64,
    /// What was done, in a sentence; empty if nothing was.
    #[serde(default)]
    pub message: String,
    /// What is wrong or worth knowing.
    #[serde(default)]
    pub diagnostics: Vec<Diagnostic>,
    /// Groups of targets that the project has for it now or soon: `env/sky`.
    #[serde(default)]
    pub targets: Vec<String>,
    /// Of [`Ask::BakeAtError`]: the first revision that has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<u64>,
}

impl Answer {
    /// A request that was not done, and why.
    pub fn refused(id: u64, reason: Diagnostic) -> Answer {
        Answer { id, diagnostics: vec![reason], ..Answer::default() }
    }

    /// Whether what was asked is done.
    pub fn is_done(&self) -> bool {
        !has_errors(&self.diagnostics)
    }
}

impl Ask {
    /// Whether it is within the limits; else what is not.
    pub(crate) fn check(&self) -> Result<(), String> {
        match self {
            Ask::WriteParameters { parameters } => check_parameters(parameters),
            Ask::AddFiles { paths } if paths.len() > PATHS_MAX => {
                Err(format!("{} files at once; {PATHS_MAX} are allowed", paths.len()))
            }
            Ask::AddFiles { paths } if paths.iter().any(|path| path.len() > PATH_BYTES_MAX) => {
                Err(format!("a path of more than {PATH_BYTES_MAX} bytes"))
            }
            Ask::BakeAtError { env, .. } if env.chars().count() > NAME_CHARS_MAX => {
                Err(format!("a name of more than {NAME_CHARS_MAX} characters"))
            }
            Ask::BakeAtError { error: Some(error), .. } if !(ERROR_MIN..=ERROR_MAX).contains(error) => {
                Err(format!("an error of {error}; {ERROR_MIN} to {ERROR_MAX} are allowed"))
            }
            Ask::AddFiles { .. } | Ask::BakeAtError { .. } | Ask::Unknown => Ok(()),
        }
    }
}

fn check_parameters(parameters: &[ParameterWrite]) -> Result<(), String> {
    if parameters.len() > PARAMETERS_MAX {
        return Err(format!("{} parameters at once; {PARAMETERS_MAX} are allowed", parameters.len()));
    }
    let is_long = |name: &String| name.chars().count() > NAME_CHARS_MAX;
    if parameters.iter().any(|parameter| is_long(&parameter.shader) || is_long(&parameter.name)) {
        return Err(format!("a name of more than {NAME_CHARS_MAX} characters"));
    }
    if parameters.iter().any(|parameter| parameter.value.len() > COMPONENTS_MAX) {
        return Err(format!("a value of more than {COMPONENTS_MAX} components"));
    }
    Ok(())
}
