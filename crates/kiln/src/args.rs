//! The command line.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};

/// Look-dev without the wait: bakes image-based lighting without noise, checks shaders, and shows every edit
/// in a live preview.
#[derive(Debug, Parser)]
#[command(version, about, long_about = None, after_help = "\
A first look:
  kiln demo                a sample project, baked, shown and edited before your eyes
  kiln init look           the same sample as a project of your own
  kiln watch look          bake, then follow every edit
  kiln preview look        the window (in a second terminal)

Exit codes: 0 done, 1 the input is wrong (a diagnostic says what and where), 2 the tool failed.
Artefacts are cached in $KILN_CACHE, or in your cache folder.")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a project that runs as it is: environments, a material-ball scene, shaders, kiln.toml
    Init(InitArgs),
    /// Run every action that is out of date and no other; write KTX2 files and manifest.json
    Bake(BakeArgs),
    /// Bake, then follow every edit and publish it to connected previews
    Watch(WatchArgs),
    /// Show what a watching kiln publishes, in a window or as PNG files
    #[cfg(feature = "preview")]
    Preview(PreviewArgs),
    /// Make a sample project, bake it, show it, and edit it before your eyes
    Demo(DemoArgs),
}

#[derive(Debug, ClapArgs)]
pub(crate) struct InitArgs {
    /// Folder of the new project
    pub(crate) dir: PathBuf,
    #[command(flatten)]
    pub(crate) sample: SampleArgs,
}

#[derive(Clone, Debug, ClapArgs)]
pub(crate) struct SampleArgs {
    /// Width of the generated panoramas in texels
    #[arg(long, default_value_t = 2048, value_parser = clap::value_parser!(u32).range(16..=16384))]
    pub(crate) panorama_width: u32,
    /// Height of the generated sun above the horizon, in degrees
    #[arg(long, default_value_t = 38.0, allow_negative_numbers = true)]
    pub(crate) sun_elevation: f64,
    /// Where the generated sun stands, in degrees from straight ahead (-Z) towards the right (+X)
    #[arg(long, default_value_t = 150.0, allow_negative_numbers = true)]
    pub(crate) sun_azimuth: f64,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct BuildArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Actions at once [default: the number of cores]
    #[arg(short, long)]
    pub(crate) jobs: Option<usize>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct BakeArgs {
    #[command(flatten)]
    pub(crate) build: BuildArgs,
    /// Also print the time of every action that ran
    #[arg(long)]
    pub(crate) timings: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(crate) build: BuildArgs,
    /// Do not write baked files, only publish to previews
    #[arg(long)]
    pub(crate) no_output: bool,
}

#[cfg(feature = "preview")]
#[derive(Debug, ClapArgs)]
pub(crate) struct PreviewArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Write PNG files instead of opening a window
    #[arg(long)]
    pub(crate) headless: bool,
    /// Number of frames to write
    #[arg(long, default_value_t = 1, requires = "headless")]
    pub(crate) frames: usize,
    /// Go on: write revision_0001.png … for every revision until ended, through daemons that come and go
    #[arg(long, requires = "headless", conflicts_with_all = ["frames", "turn", "json"])]
    pub(crate) follow: bool,
    /// Folder for frame_0001.png … and report.json
    #[arg(long, default_value = "frames", requires = "headless")]
    pub(crate) out: PathBuf,
    /// Picture size in pixels
    #[arg(long, default_value = "1280x720", value_parser = parse_size, requires = "headless")]
    pub(crate) size: [u32; 2],
    /// Turn the environment by this much from frame to frame, in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, requires = "headless")]
    pub(crate) turn: f32,
    /// Wait for this revision or a later one
    #[arg(long, default_value_t = 1, requires = "headless")]
    pub(crate) wait_revision: u64,
    /// Give up after this many seconds
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=86_400), requires = "headless")]
    pub(crate) timeout_s: u64,
    /// Scene to show [default: the project's first]
    #[arg(long)]
    pub(crate) scene: Option<String>,
    /// Environment to show it in [default: the scene's own]
    #[arg(long)]
    pub(crate) env: Option<String>,
    /// Exposure in stops
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) exposure: f32,
    /// Print JSON instead of text
    #[arg(long, requires = "headless")]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct DemoArgs {
    /// Folder of the sample project; made, or made afresh if it is one of an earlier demo
    #[arg(default_value = "kiln-demo")]
    pub(crate) dir: PathBuf,
    #[command(flatten)]
    pub(crate) sample: SampleArgs,
    /// Do not open a window even if there is a display
    #[arg(long)]
    pub(crate) no_window: bool,
    /// Picture size in pixels
    #[arg(long, default_value = "640x360", value_parser = parse_size)]
    pub(crate) size: [u32; 2],
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is no size; write it as 1280x720, each side from 1 to 8192");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=8192).contains(side)).ok_or_else(wrong);
    Ok([side(width)?, side(height)?])
}
