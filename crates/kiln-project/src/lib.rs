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

pub use build::{Built, build};
pub use config::{EnvConfig, Project, Range, Role, SceneConfig, ShaderConfig, parse_project};
pub use output::{Manifest, ManifestTarget, Written, write_outputs};
pub use plan::{Plan, TargetSpec, plan};

mod blob;
mod build;
mod config;
mod environment;
mod output;
mod plan;
mod reader;
mod scene;
mod shader;
#[cfg(test)]
mod tests;

/// Name of the project file.
pub const PROJECT_FILE: &str = "kiln.toml";
