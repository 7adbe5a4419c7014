//! Commands that change a project's sources.

use std::path::PathBuf;

use clap::Args as ClapArgs;

#[derive(Debug, ClapArgs)]
pub(crate) struct AddArgs {
    /// Panoramas or cubes (.hdr .exr .ktx .ktx2 .dds), scenes (.gltf .glb); what lies in the project is not copied
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// The project's folder
    #[arg(long, default_value = ".")]
    pub(crate) dir: PathBuf,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct SetArgs {
    /// Shader, parameter and value, as pbr.wetness=0.5 or tonemap.tint=1,0.9,0.8; all are written or none
    #[arg(required = true, value_name = "SHADER.NAME=VALUE")]
    pub(crate) values: Vec<String>,
    /// The project's folder
    #[arg(long, default_value = ".")]
    pub(crate) dir: PathBuf,
}
