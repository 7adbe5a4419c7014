//! `kiln render`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use super::inspect::InspectArgs;
use super::{BuildArgs, parse_rate, parse_size};

#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  kiln render look                                          the first scene under its own light
  kiln render look --scene all --env all --sheet sheet.png  every scene under every light, on one picture too
  kiln render look --vary tone_mapper --sheet curves.png    one picture for each choice of a shader's parameter
  kiln render look --camera Front --frames 36 --turn 10 --exr

Exit codes: 0 drawn, 1 something in the project is wrong (what can be drawn is), 2 the tool failed.")]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) build: BuildArgs,
    /// Scene to draw, may be given more than once; `all` draws every one [default: the project's first]
    #[arg(long)]
    pub(crate) scene: Vec<String>,
    /// Environment to draw it in, may be given more than once; `all` takes every one [default: the scene's own]
    #[arg(long)]
    pub(crate) env: Vec<String>,
    /// Camera of the glTF file to draw through [default: its first, else one that shows the whole scene]
    #[arg(long)]
    pub(crate) camera: Option<String>,
    /// Variant of the glTF file's materials (KHR_materials_variants) [default: none]
    #[arg(long, value_name = "NAME")]
    pub(crate) material_variant: Option<String>,
    /// Animation of the glTF file to draw a moment of, by name or number from 0 [default: none, the rest pose]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
    /// Time of the first frame in the animation, in seconds
    #[arg(long, default_value_t = 0.0, requires = "animation", value_name = "SECONDS")]
    pub(crate) time: f64,
    /// Frames a second of the animation
    #[arg(long, default_value_t = 30.0, requires = "animation", value_parser = parse_rate)]
    pub(crate) fps: f64,
    /// Picture size in pixels [default: 1280x720, or that of `--look`]
    #[arg(long, value_parser = parse_size)]
    pub(crate) size: Option<[u32; 2]>,
    /// One sample a pixel, as the window draws while slow pictures move: fast, with jagged edges
    #[arg(long, conflicts_with_all = ["probe", "mark_faults"])]
    pub(crate) single_sample: bool,
    /// Number of frames of each
    #[arg(long, default_value_t = 1)]
    pub(crate) frames: usize,
    /// Turn the environment by this much from frame to frame, in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) turn: f32,
    /// Exposure in stops
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) exposure: f32,
    /// What is behind the scene: environment, checker, or a colour as #rrggbb (sRGB; exposure leaves it, the tone mapper does not)
    #[arg(long, default_value = "environment", value_name = "WHAT")]
    pub(crate) background: kiln_preview::Background,
    /// What is below the scene: none, grid, shadow (that of the extracted sun) or grid+shadow
    #[arg(long, default_value = "none", value_name = "WHAT")]
    pub(crate) ground: kiln_preview::Ground,
    /// What diffuse light is read from: the baked map, or the harmonics, to see what engines show that read these
    #[arg(long, value_enum, default_value_t = Diffuse::Map)]
    pub(crate) diffuse: Diffuse,
    /// Set a parameter that a shader's author offers: wetness=0.5, tonemap.tint=1,0.9,0.8, tone_mapper=agx
    #[arg(long, value_name = "[SHADER.]NAME=VALUE")]
    pub(crate) param: Vec<kiln_preview::Assignment>,
    /// Draw one picture for each choice of this parameter
    #[arg(long, value_name = "[SHADER.]NAME")]
    pub(crate) vary: Option<String>,
    /// Folder for SCENE-ENV.png …
    #[arg(long, default_value = "frames")]
    pub(crate) out: PathBuf,
    /// Write the radiance before exposure and tone mapping besides, as OpenEXR
    #[arg(long)]
    pub(crate) exr: bool,
    /// Draw what a parameter sheet says, which the window saves beside a screenshot
    #[arg(
        long,
        value_name = "SHEET.json",
        conflicts_with_all = ["scene", "env", "camera", "material_variant", "animation", "exposure", "vary", "diffuse", "background", "ground"]
    )]
    pub(crate) look: Option<PathBuf>,
    /// Lay all pictures out on one, a row for each scene under each light
    #[arg(long, value_name = "FILE.png")]
    pub(crate) sheet: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) inspect: InspectArgs,
}

/// What diffuse light is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Diffuse {
    /// The baked irradiance map.
    Map,
    /// The spherical harmonics.
    Harmonics,
}
