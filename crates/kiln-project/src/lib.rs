//! A project folder: what kiln.toml says, the actions that follow from it, and the files that come out.
//!
//! Start at [`build()`]: it plans, runs and returns every target with its state. [`Project`] is kiln.toml as
//! data, [`plan()`] turns it into a graph, [`write_outputs`] puts KTX2 files and `manifest.json` in a folder.
//!
//! Conventions: paths are relative to the project with `/`; a section of kiln.toml with an error is left
//! out and its targets keep their last good content; a target goes away only when a project without
//! errors no longer asks for it.
//!
//! Not here: how maps are computed (`kiln-bake`), caching (`kiln-build`), watching (`kiln-daemon`).

pub use add::{Added, add_files};
pub use build::{Built, Early, HEALING_TRIES_MAX, build, build_apart, build_wanted_first, build_with};
pub use export::{CONVENTIONS_FILE, ExportFailure, Exported, export, wished};
// The limits of an environment are those of its recipe.
pub use check::{Difference, DifferenceKind, differences};
pub use config::{
    OwnTexture, Project, Role, SceneConfig, ShaderConfig, parse_define, parse_project, parse_variant,
    variant_name,
};
pub use demand::{EnvDemand, Reason, Reasons, SceneDemand};
pub use env_config::{EnvConfig, FORMATS, Range, format_name};
pub use kiln_bake::{BAND_LIMIT_MAX, RoughnessLaw, TexelFormat, decode_level, panorama_of_cube};
pub use kiln_export::{ExportFile, Preset};
pub use kiln_image::{FACE_NAMES, Layout, TexelPolicy};
pub use kiln_scene::{Effect, EffectOverrides, EffectSet, LightReads, MaterialEffects};
pub use lock::{LOCK_FILE, Lock, LockedEnv};
pub use lut_config::{LutConfig, TABLES, table_name};
pub use output::{
    MANIFEST_FILE, Manifest, ManifestFile, ManifestTarget, Written, lock_folder, manifest_of, write_outputs,
};
pub use plan::{PartSpec, Plan, TargetSpec, Wishes, plan, plan_with};
pub use profile::PROFILE_NAMES;
pub use reader::{parse_bytes, suggest};
pub use settle::{Choice, settle};
pub use skipped::{Skipped, made, skipped};
pub use verify::{Mismatch, Verified, VerifyError, verify};
pub use why::{ActionWhy, CutOff, last_build, why, with_values};
pub use write_back::{
    ParameterValue, WrittenSource, describe_written, parse_parameter_value, write_parameters,
};

mod add;
mod blob;
mod build;
mod check;
mod config;
mod demand;
mod env_config;
mod environment;
mod export;
mod lock;
mod lut;
mod lut_config;
mod output;
mod plan;
mod profile;
mod reader;
mod replace;
mod scene;
mod settle;
mod shader;
mod skipped;
#[cfg(test)]
mod tests;
mod verify;
mod why;
mod write_back;

/// Name of the project file.
pub const PROJECT_FILE: &str = "kiln.toml";
