//! Writes a compiled shader in the languages of graphics interfaces, with where each resource is bound.
//!
//! Start at [`emit`]: canonical WGSL in, files out. What is written means what the WGSL means, with these
//! conventions; what a program that loads a file must do itself also stands in its [`Emitted::notes`].
//!
//! | language | clip space | resources | entry points |
//! |---|---|---|---|
//! | `wgsl` | y up, depth 0 … 1 | `@group`, `@binding` | as they are |
//! | `spirv` 1.3, for Vulkan 1.1 | as WGSL: set a viewport of negative height, for Vulkan has y down | set = group, binding = binding | as they are |
//! | `glsl` 4.50 core | y flipped and depth mapped to −1 … 1, see below | per namespace of OpenGL, counted in the order of (group, binding) | one file each, `main` |
//! | `glsl-es` 3.00 | as `glsl` | by name; the index is a proposal | one file each, `main` |
//! | `hlsl`, shader model 6.0 | as WGSL, which is Direct3D's | register = binding, space = group | renamed if reserved |
//! | `msl` 2.4 | as WGSL, which is Metal's | buffers, textures and samplers, each counted in the order of (group, binding) | renamed if reserved |
//!
//! OpenGL's clip space and its framebuffers differ from WebGPU's. The vertex stage therefore ends with
//! `gl_Position.yz = vec2(-gl_Position.y, gl_Position.z * 2.0 - gl_Position.w)`. So depths, clipping,
//! `@builtin(position)`, `dpdy` and the rows of rendered textures are all WGSL's, with OpenGL's default
//! `glClipControl`. In return row 0 of a framebuffer is the top of the picture: a program that draws into the
//! window flips it there, and says `glFrontFace(GL_CW)` for what is counter-clockwise in WGSL.
//!
//! Indices into arrays are clamped as WGSL has it in `spirv`, `hlsl` and `msl`; texel loads out of range give
//! zero there and in `glsl`. In GLSL other indices, and in `glsl-es` texel loads too, are left to the driver.
//! Point lists need a point size, which WGSL does not know and no file here writes. Overrides have become
//! constants with their default values.
//!
//! Not here: whether a driver takes the result. Tests check SPIR-V with `spirv-val` and GLSL with
//! `glslangValidator`, which reads most of HLSL too. The compilers of Direct3D and Metal were not at hand: MSL
//! is known to be complete and balanced only.

use std::fmt;

use kiln_diagnostic::Diagnostic;
use naga::back::pipeline_constants::{PipelineConstantError, process_overrides};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::ModuleInfo;
use naga::{Module, ShaderStage};
use serde::{Deserialize, Serialize};

use crate::{Stage, front};
pub use bindings::*;

mod bindings;
mod gaps;
mod glsl;
mod hlsl;
mod msl;
mod spirv;

/// A language that shaders are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Language {
    /// WGSL, as Kiln stores it.
    Wgsl,
    /// SPIR-V 1.3, for Vulkan 1.1; little-endian words, with names.
    #[serde(rename = "spirv")]
    SpirV,
    /// GLSL 4.50 core.
    Glsl,
    /// GLSL ES 3.00, which WebGL 2 takes.
    GlslEs,
    /// HLSL for shader model 6.0.
    Hlsl,
    /// Metal shading language 2.4.
    Msl,
}

impl Language {
    /// All languages.
    pub const ALL: [Language; 6] =
        [Language::Wgsl, Language::SpirV, Language::Glsl, Language::GlslEs, Language::Hlsl, Language::Msl];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Language::Wgsl => "wgsl",
            Language::SpirV => "spirv",
            Language::Glsl => "glsl",
            Language::GlslEs => "glsl-es",
            Language::Hlsl => "hlsl",
            Language::Msl => "msl",
        }
    }

    /// The language of that name.
    pub fn parse(name: &str) -> Option<Language> {
        Language::ALL.into_iter().find(|language| language.name() == name)
    }

    /// End of the name of a file that holds `stage`: `.vert.glsl`, or `.spv` where stages share a file.
    pub fn file_suffix(self, stage: Stage) -> &'static str {
        match (self, stage) {
            (Language::Wgsl, _) => ".wgsl",
            (Language::SpirV, _) => ".spv",
            (Language::Glsl, Stage::Vertex) => ".vert.glsl",
            (Language::Glsl, Stage::Fragment) => ".frag.glsl",
            (Language::Glsl, Stage::Compute) => ".comp.glsl",
            (Language::GlslEs, Stage::Vertex) => ".es.vert.glsl",
            (Language::GlslEs, Stage::Fragment) => ".es.frag.glsl",
            (Language::GlslEs, Stage::Compute) => ".es.comp.glsl",
            (Language::Hlsl, _) => ".hlsl",
            (Language::Msl, _) => ".metal",
        }
    }
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Emitted {
    /// What its name ends with. All files of one [`emit`] differ in it: where several entry points have the
    /// same stage, it begins with `.` and the entry point's name.
    pub file_suffix: String,
    /// Its content.
    pub bytes: Vec<u8>,
    /// What a program that loads it must do, a sentence each.
    pub notes: Vec<String>,
    /// Where things are in it.
    pub bindings: BindingMap,
}

/// Why a shader has no form in a language.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EmitError {
    /// The input is not valid WGSL.
    #[error("this is not valid WGSL: {0}")]
    Invalid(String),
    /// The language lacks something.
    #[error("{language} cannot express {what}, which `{entry_point}` needs")]
    Unsupported {
        /// The language.
        language: Language,
        /// The entry point that needs it.
        entry_point: String,
        /// What it needs.
        what: String,
        /// What to do.
        help: String,
    },
    /// Only WGSL leaves values open until a pipeline is made.
    #[error("{language} has no overrides, and `{name}` has no default value")]
    OverrideWithoutDefault {
        /// The language.
        language: Language,
        /// The override.
        name: String,
    },
    /// More resources than the language has places for.
    #[error("{language} has places for {limit} {what}, this shader has more")]
    TooMany {
        /// The language.
        language: Language,
        /// What of.
        what: &'static str,
        /// How many there can be.
        limit: u32,
    },
    /// A fault of the shader compiler.
    #[error("the shader compiler failed: {0}")]
    Internal(String),
}

impl EmitError {
    /// As a message; the caller knows which shader it is about.
    pub fn diagnostic(&self) -> Diagnostic {
        let diagnostic = Diagnostic::error(self.to_string());
        match self {
            EmitError::Unsupported { help, .. } => diagnostic.with_help(help),
            EmitError::OverrideWithoutDefault { name, .. } => {
                diagnostic.with_help(format!("write `override {name}: … = …;`"))
            }
            EmitError::TooMany { .. } => diagnostic.with_help("use fewer, or put textures into arrays"),
            EmitError::Invalid(_) | EmitError::Internal(_) => diagnostic,
        }
    }
}

/// Writes `wgsl`, the text of a [`crate::Compiled`], in `language`. Equal inputs give equal bytes.
///
/// GLSL has one file for each entry point, in their order; the other languages have one file.
///
/// # Errors
///
/// Never half of the files: what the language cannot express is an [`EmitError::Unsupported`] that names the
/// entry point.
pub fn emit(wgsl: &str, language: Language) -> Result<Vec<Emitted>, EmitError> {
    front::on_deep_stack(EmitError::Internal, || {
        let module = naga::front::wgsl::parse_str(wgsl)
            .map_err(|error| EmitError::Invalid(error.message().to_owned()))?;
        let info = front::validate(&module).map_err(|error| EmitError::Invalid(error.to_string()))?;
        if language == Language::Wgsl {
            return Ok(vec![as_wgsl(wgsl, &module)?]);
        }
        let (module, info) =
            process_overrides(&module, &info, None, &naga::back::PipelineConstants::default())
                .map_err(|error| override_error(language, error))?;
        let input = Input { module: &module, info: &info, resources: resources(&module)? };
        match language {
            Language::Wgsl => Ok(Vec::new()),
            Language::SpirV => Ok(vec![spirv::write(&input)?]),
            Language::Glsl | Language::GlslEs => glsl::write(&input, language),
            Language::Hlsl => Ok(vec![hlsl::write(&input)?]),
            Language::Msl => Ok(vec![msl::write(&input)?]),
        }
    })
}

/// A valid module without overrides.
struct Input<'a> {
    module: &'a Module,
    info: &'a ModuleInfo,
    resources: Vec<Resource>,
}

fn as_wgsl(wgsl: &str, module: &Module) -> Result<Emitted, EmitError> {
    let bindings = BindingMap {
        entry_points: entry_points(module, |_, name| Ok(name.to_owned()))?,
        resources: in_sets(&resources(module)?),
        buffer_sizes: None,
    };
    Ok(Emitted { file_suffix: ".wgsl".to_owned(), bytes: wgsl.into(), notes: Vec::new(), bindings })
}

fn override_error(language: Language, error: PipelineConstantError) -> EmitError {
    match error {
        PipelineConstantError::MissingValue(name) => EmitError::OverrideWithoutDefault { language, name },
        error => EmitError::Internal(format!("overrides: {error}")),
    }
}

/// Indices as WGSL has them; what is out of range of a texture reads as zero.
const WGSL_BOUNDS: BoundsCheckPolicies = BoundsCheckPolicies {
    index: BoundsCheckPolicy::Restrict,
    buffer: BoundsCheckPolicy::Restrict,
    image_load: BoundsCheckPolicy::ReadZeroSkipWrite,
    binding_array: BoundsCheckPolicy::Restrict,
};

/// Entry points with the names that `emitted` gives them, by their index and name.
fn entry_points(
    module: &Module,
    emitted: impl Fn(usize, &str) -> Result<String, EmitError>,
) -> Result<Vec<EmittedEntryPoint>, EmitError> {
    let entries = module.entry_points.iter().enumerate();
    entries
        .map(|(index, entry)| {
            let (name, stage) = (entry.name.clone(), stage(entry.stage)?);
            Ok(EmittedEntryPoint { stage, emitted_name: emitted(index, &name)?, name })
        })
        .collect()
}

fn stage(stage: ShaderStage) -> Result<Stage, EmitError> {
    crate::interface::stage(stage).map_err(EmitError::Internal)
}

fn has_stage(module: &Module, stage: ShaderStage) -> bool {
    module.entry_points.iter().any(|entry| entry.stage == stage)
}

/// Whether a vertex entry point takes `built_in`.
fn takes_built_in(module: &Module, entry: &naga::EntryPoint, built_in: naga::BuiltIn) -> bool {
    let wanted = Some(naga::Binding::BuiltIn(built_in));
    entry.stage == ShaderStage::Vertex
        && entry.function.arguments.iter().any(|argument| match &module.types[argument.ty].inner {
            naga::TypeInner::Struct { members, .. } => members.iter().any(|member| member.binding == wanted),
            _ => argument.binding == wanted,
        })
}
