//! Which stage a file is for.

use crate::Stage;

/// What files of stages are called: by extension (`a.vert`, also before `.glsl`) or by the end of the stem
/// (`a_vs.glsl`).
const NAMES: [(&str, Option<Stage>); 18] = [
    ("vert", Some(Stage::Vertex)),
    ("vs", Some(Stage::Vertex)),
    ("vsh", Some(Stage::Vertex)),
    ("vertex", Some(Stage::Vertex)),
    ("frag", Some(Stage::Fragment)),
    ("fs", Some(Stage::Fragment)),
    ("fsh", Some(Stage::Fragment)),
    ("fragment", Some(Stage::Fragment)),
    ("comp", Some(Stage::Compute)),
    ("cs", Some(Stage::Compute)),
    ("compute", Some(Stage::Compute)),
    ("geom", None),
    ("gs", None),
    ("tesc", None),
    ("tese", None),
    ("mesh", None),
    ("rgen", None),
    ("rchit", None),
];

/// What a file's name says of its stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// One that compiles.
    Stage(Stage),
    /// One that WGSL does not have.
    Refused(&'static str),
    /// Nothing.
    Unknown,
}

/// What the name of `path` says of its stage.
pub fn of_path(path: &str) -> Named {
    let file = path.rsplit('/').next().unwrap_or(path);
    let file = file.strip_suffix(".glsl").unwrap_or(file);
    let last = file.rsplit(['.', '_', '-']).next().unwrap_or(file);
    named(last)
}

/// What `#pragma shader_stage(word)` says.
pub fn named(word: &str) -> Named {
    match NAMES.iter().find(|(name, _)| *name == word) {
        Some((_, Some(stage))) => Named::Stage(*stage),
        Some((name, None)) => Named::Refused(name),
        None => Named::Unknown,
    }
}

/// Whether `path` is a GLSL file by its extension.
pub fn is_glsl(path: &str) -> bool {
    let file = path.rsplit('/').next().unwrap_or(path);
    let Some((_, extension)) = file.rsplit_once('.') else { return false };
    extension == "glsl" || named(extension) != Named::Unknown
}

/// The name of a stage's entry point in the WGSL that comes out.
pub fn entry_point(stage: Stage) -> &'static str {
    match stage {
        Stage::Vertex => "vs_main",
        Stage::Fragment => "fs_main",
        Stage::Compute => "cs_main",
    }
}

/// naga's word for a stage.
pub fn for_naga(stage: Stage) -> naga::ShaderStage {
    match stage {
        Stage::Vertex => naga::ShaderStage::Vertex,
        Stage::Fragment => naga::ShaderStage::Fragment,
        Stage::Compute => naga::ShaderStage::Compute,
    }
}

/// Order of stages in a program.
pub fn entry_order(stage: Stage) -> u8 {
    match stage {
        Stage::Vertex => 0,
        Stage::Fragment => 1,
        Stage::Compute => 2,
    }
}

/// What a stage's names end with if they clash with those of another.
pub fn ending(stage: Stage) -> &'static str {
    match stage {
        Stage::Vertex => "vs",
        Stage::Fragment => "fs",
        Stage::Compute => "cs",
    }
}
