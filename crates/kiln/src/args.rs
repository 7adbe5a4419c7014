//! The command line.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};

mod accuracy;
mod check;
#[cfg(feature = "preview")]
mod inspect;
#[cfg(feature = "preview")]
mod render;
mod shader;
mod sources;

pub(crate) use accuracy::*;
pub(crate) use check::*;
#[cfg(feature = "preview")]
pub(crate) use render::*;
pub(crate) use shader::*;
pub(crate) use sources::*;

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
Artefacts are cached in $KILN_CACHE, or in your cache folder, up to $KILN_CACHE_MAX (as 20GiB; 16GiB if unset).")]
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
    /// Bake one environment or many without a project: files in, maps out
    Env(EnvArgs),
    /// Write a project's environments as an engine wants them
    Export(ExportArgs),
    /// Measure error, time and size of every way to bake an environment, and say what is worth paying for
    Accuracy(AccuracyArgs),
    /// Examine environments, maps and shaders: ranges, seams, energy, a white furnace; for people and for CI
    Check(HealthArgs),
    /// Check, reflect and emit shaders, of a project or of none
    #[command(subcommand)]
    Shader(ShaderCommand),
    /// Say what scenes call for, what is made of it and what is left out, and what a bake would run, without running it
    Plan(PlanArgs),
    /// Explain a target: what changed when, with old and new values, and why the rest was left alone
    Why(WhyArgs),
    /// Draw sources, actions and targets as DOT or SVG
    Graph(GraphArgs),
    /// Build a sample of the targets again in a fresh folder and compare the bytes
    Verify(VerifyArgs),
    /// Free cache space: what was not used for longest goes first, what is published stays
    Gc(GcArgs),
    /// Examine the cache, this machine's graphics adapters, and the limits
    Doctor(DoctorArgs),
    /// Add environments and scenes to a project: copies files, with what they refer to, and names them in kiln.toml
    Add(AddArgs),
    /// Write values of parameters into the shaders that declare them, and leave all else as it is
    Set(SetArgs),
    /// Bake, then follow every edit and publish it to connected previews
    Watch(WatchArgs),
    /// Say whether a project is watched, what is published and building, and what its clients show; exit code 1 if it is not
    Status(StatusArgs),
    /// End the `kiln watch` of a project and wait until it is gone; exit code 0 too if there is none
    Stop(StopArgs),
    /// Show what a watching kiln publishes, in a window or as PNG files
    #[cfg(feature = "preview")]
    Preview(PreviewArgs),
    /// Build a project and draw it into PNG or EXR files: no daemon, no window, the pixels of the preview
    #[cfg(feature = "preview")]
    Render(RenderArgs),
    /// Compare pictures: numbers, what the eye makes of them, a heat map; for people and for CI
    Diff(DiffArgs),
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
    /// What the actions at work may take together, as 4GiB [default: three quarters of what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub(crate) memory: Option<u64>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

/// An engine preset by its name.
fn parse_preset(text: &str) -> Result<kiln_project::Preset, String> {
    text.parse().map_err(|error: kiln_export::UnknownPreset| error.to_string())
}

/// Actions at once and their memory, for commands without a project.
#[derive(Debug, ClapArgs)]
pub(crate) struct RunArgs {
    /// Actions at once [default: the number of cores]
    #[arg(short, long)]
    pub(crate) jobs: Option<usize>,
    /// What the actions at work may take together, as 4GiB [default: three quarters of what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub(crate) memory: Option<u64>,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  kiln env studio.hdr --out maps                 KTX2 cubes, harmonics and manifest.json in maps/studio
  kiln env *.hdr --out maps --for bevy           Bevy's files for each panorama
  kiln env px.png nx.png py.png ny.png pz.png nz.png --faces --out maps
  kiln env sun.exr --out maps --sun extract --error 1e-4 --format rgba32f

You say which error may remain, not how many samples to take: there are none. What was chosen, the bounds and the
error measured against brute force stand in manifest.json.")]
pub(crate) struct EnvArgs {
    /// Panoramas, cubes, crosses, strips or octahedral maps: .hdr .exr .ktx .ktx2 .dds .png .jpg
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Folder of the maps; each environment gets a folder in it
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The files are six faces of one cube: +X -X +Y -Y +Z -Z
    #[arg(long)]
    pub(crate) faces: bool,
    /// Name of the environment [default: the file's name]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Write an engine's files in its conventions instead of Kiln's: bevy, three, filament, khronos or raw
    #[arg(long = "for", value_name = "ENGINE", value_parser = parse_preset)]
    pub(crate) preset: Option<kiln_project::Preset>,
    /// Edge of the specular chain's first level, a power of two
    #[arg(long, default_value_t = 256)]
    pub(crate) size: usize,
    /// Relative RMS error that may remain, encoding included
    #[arg(long, default_value_t = 1e-3)]
    pub(crate) error: f64,
    /// Texels: rgba16f, rgba32f, rgb9e5, r11g11b10f or bc6h [default: rgba16f, or what the engine likes best]
    #[arg(long)]
    pub(crate) format: Option<String>,
    /// How the files are laid out: auto, equirect, cube-strip, cube-cross, octahedral, exr-cube or cube
    #[arg(long, default_value = "auto")]
    pub(crate) layout: String,
    /// Levels of the specular chain [default: down to faces of 4 texels]
    #[arg(long)]
    pub(crate) levels: Option<usize>,
    /// Roughness of the levels: linear, filament, eevee, or a list as 0,0.25,1
    #[arg(long, default_value = "linear")]
    pub(crate) law: String,
    /// Edge of the skybox [default: follows the file]
    #[arg(long)]
    pub(crate) skybox_size: Option<usize>,
    /// Edge of the irradiance cube
    #[arg(long, default_value_t = 64)]
    pub(crate) irradiance_size: usize,
    /// Also a Charlie chain, for cloth
    #[arg(long)]
    pub(crate) sheen: bool,
    /// Highest degree of the spherical harmonics, 0 to 8
    #[arg(long, default_value_t = 2)]
    pub(crate) sh_order: usize,
    /// Window the irradiance's harmonics until they are nowhere negative
    #[arg(long)]
    pub(crate) dering: bool,
    /// Values above 65504: scale (by a recorded power of two) or f32 (32-bit texels)
    #[arg(long, default_value = "scale")]
    pub(crate) range: String,
    /// The dominant small light: keep it, or extract it as a directional light
    #[arg(long, default_value = "keep")]
    pub(crate) sun: String,
    /// NaN, infinite and negative texels: repair, error, or keep (in the skybox alone)
    #[arg(long, default_value = "repair")]
    pub(crate) texels: String,
    /// Cut radiance above this; what is lost is printed
    #[arg(long)]
    pub(crate) max_radiance: Option<f64>,
    /// Also write the skybox as a picture: cross, cross-tall, strip, strip-tall, faces, octahedral or equirect, and
    /// .exr, .hdr or .png, as cross.exr
    #[arg(long, value_name = "LAYOUT.TYPE")]
    pub(crate) picture: Option<crate::commands::cube_picture::Picture>,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ExportArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Whose conventions: bevy, three, filament, khronos or raw
    #[arg(long = "for", value_name = "ENGINE", value_parser = parse_preset)]
    pub(crate) preset: kiln_project::Preset,
    /// Folder of the files; each environment gets a folder in it
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Only these environments
    #[arg(long = "env", value_name = "NAME")]
    pub(crate) envs: Vec<String>,
    /// Texels of cubes [default: what the engine likes best]
    #[arg(long)]
    pub(crate) format: Option<String>,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct PlanArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
    /// Also draw materials, effects and what is made of them to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
}

/// For commands that only read.
#[derive(Debug, ClapArgs)]
pub(crate) struct ReadArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct WhyArgs {
    /// A target, as env/sky/specular, or an action, as "decode env/sky"; without one the last builds are listed
    pub(crate) target: Option<String>,
    /// The project's folder
    #[arg(long, default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct GraphArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Only this target or action and what it depends on
    #[arg(long)]
    pub(crate) target: Option<String>,
    /// The form of the picture [default: by the file's extension, else dot]
    #[arg(long)]
    pub(crate) format: Option<GraphFormat>,
    /// Write to this file instead of standard output
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum GraphFormat {
    /// For Graphviz and its relatives
    Dot,
    /// A picture for browsers
    Svg,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct VerifyArgs {
    #[command(flatten)]
    pub(crate) build: BuildArgs,
    /// Verify these targets instead of a sample
    #[arg(long = "target", value_name = "TARGET", conflicts_with_all = ["sample", "all"])]
    pub(crate) targets: Vec<String>,
    /// Number of targets in the sample
    #[arg(long, default_value_t = 4)]
    pub(crate) sample: usize,
    /// Another seed takes another sample
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Verify every target
    #[arg(long)]
    pub(crate) all: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct GcArgs {
    /// Keep at most this much besides what is published, as 2GiB [default: $KILN_CACHE_MAX, else 16GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub(crate) max_size: Option<u64>,
    /// Only say what would go
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct DoctorArgs {
    /// Read every cached file and drop those that are damaged
    #[arg(long)]
    pub(crate) deep: bool,
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
    /// Go on after an action whose input is at fault, as far as possible
    #[arg(short, long)]
    pub(crate) keep_going: bool,
    /// Write nothing; exit with 1 if the manifest would change, and name what
    #[arg(long)]
    pub(crate) check: bool,
    /// The manifest to check against [default: manifest.json in the project's output folder]
    #[arg(long, value_name = "FILE", requires = "check")]
    pub(crate) manifest: Option<PathBuf>,
    /// Choose nothing where kiln.toml asks for a time: exit with 1 unless kiln.lock says what to bake
    #[arg(long)]
    pub(crate) locked: bool,
    /// Write a JUnit report, a test case for each target
    #[arg(long, value_name = "FILE")]
    pub(crate) junit: Option<PathBuf>,
    /// Print diagnostics so that this CI host shows them at the line
    #[arg(long, value_name = "HOST")]
    pub(crate) annotate: Option<CiHost>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum CiHost {
    /// GitHub Actions and its relatives (Forgejo, Gitea)
    Github,
    /// Azure Pipelines
    Azure,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(crate) build: BuildArgs,
    /// Do not write baked files, only publish to previews
    #[arg(long)]
    pub(crate) no_output: bool,
    /// Also look at the files themselves this often, as 500ms or 2s: for file systems that tell of no change (a network's)
    #[arg(long, value_name = "TIME", value_parser = parse_poll)]
    pub(crate) poll: Option<std::time::Duration>,
    /// Also write what happens inside to standard error: off, error, warn, info, debug or trace, for all or for one of
    /// watch, build, wire and request, as info,wire=debug [default: $KILN_LOG]
    #[arg(long, value_name = "[TARGET=]LEVEL,…")]
    pub(crate) log: Option<crate::log::LogFilter>,
    /// Listen at this address of this machine too, as 127.0.0.1:7788 (port 0: any free one); clients show the token that is said
    #[arg(long, value_name = "HOST:PORT", value_parser = parse_loopback)]
    pub(crate) listen: Option<std::net::SocketAddr>,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct StatusArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct StopArgs {
    /// The project's folder
    #[arg(default_value = ".")]
    pub(crate) dir: PathBuf,
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
    /// Where the daemon listens, as `kiln watch --listen` says it [default: the project's socket]
    #[arg(long, value_name = "HOST:PORT", value_parser = parse_address, requires = "token_file")]
    pub(crate) connect: Option<std::net::SocketAddr>,
    /// The file with the token that this daemon wants to see
    #[arg(long, value_name = "FILE", requires = "connect")]
    pub(crate) token_file: Option<PathBuf>,
    /// Number of frames to write
    #[arg(long, default_value_t = 1, requires = "headless")]
    pub(crate) frames: usize,
    /// Go on: write revision_0001.png … for every revision until ended, through daemons that come and go
    #[arg(long, requires = "headless", conflicts_with_all = ["frames", "turn", "json", "param"])]
    pub(crate) follow: bool,
    /// Folder for pictures: frame_0001.png … and report.json, or the window's screenshots [default: frames; of a window the one in the project]
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Do not remember how the window was, and open it as at first
    #[arg(long, conflicts_with = "headless")]
    pub(crate) fresh: bool,
    /// Lose the graphics device on purpose after so many frames, to see the window survive it
    #[arg(long, hide = true, value_name = "FRAMES", conflicts_with = "headless")]
    pub(crate) lose_device_after_frames: Option<u32>,
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
    /// Set a parameter that a shader's author offers: wetness=0.5, tonemap.tint=1,0.9,0.8, is_lit=false, mode=smooth
    #[arg(long, value_name = "[SHADER.]NAME=VALUE", requires = "headless")]
    pub(crate) param: Vec<kiln_preview::Assignment>,
    /// Print JSON instead of text
    #[arg(long, requires = "headless")]
    pub(crate) json: bool,
}

#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  kiln diff golden/frame.png frames/frame.png --out differences
  kiln diff golden frames --flip 0.01                       every picture of a folder with the one of its name
  kiln diff a.exr b.exr                                     radiance, tone-mapped with Khronos PBR Neutral

FLIP says what an observer notices who flips between the two on a screen 70 cm away: 0 nothing, 1 all.
Exit codes: 0 within the limits, 1 not (or a picture is missing), 2 the tool failed.")]
pub(crate) struct DiffArgs {
    /// What it should be: a picture (.png .jpg .exr .hdr) or a folder of them
    pub(crate) reference: PathBuf,
    /// What it is: the same
    pub(crate) test: PathBuf,
    /// Largest mean FLIP that passes
    #[arg(long, value_name = "MEAN", default_value_t = 0.005)]
    pub(crate) flip: f64,
    /// Largest difference of any channel of any pixel that passes, in 1/255
    #[arg(long, value_name = "STEPS")]
    pub(crate) steps: Option<u8>,
    /// Write reference, heat map and test side by side into this folder, for pictures that differ
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
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

fn parse_bytes(text: &str) -> Result<u64, String> {
    kiln_project::parse_bytes(text).ok_or_else(|| format!("`{text}` is no size; write it as 2GiB or 500MB"))
}

fn parse_poll(text: &str) -> Result<std::time::Duration, String> {
    let wrong = || format!("`{text}` is no time to poll at; write it as 500ms or 2s, from 50ms to 1h");
    let (number, unit_ms) = match text.strip_suffix("ms") {
        Some(number) => (number, 1),
        None => (text.strip_suffix('s').ok_or_else(wrong)?, 1000),
    };
    let ms = number.parse::<u64>().ok().and_then(|number| number.checked_mul(unit_ms)).ok_or_else(wrong)?;
    (50..=3_600_000).contains(&ms).then(|| std::time::Duration::from_millis(ms)).ok_or_else(wrong)
}

/// An address that no other machine reaches.
fn parse_loopback(text: &str) -> Result<std::net::SocketAddr, String> {
    let address = parse_address(text)?;
    let why = "can be reached from other machines; only 127.0.0.1 and [::1] are allowed: forward the port with `ssh -L`";
    if address.ip().is_loopback() { Ok(address) } else { Err(format!("{} {why}", address.ip())) }
}

/// An address and a port.
fn parse_address(text: &str) -> Result<std::net::SocketAddr, String> {
    let text =
        text.strip_prefix("localhost:").map_or_else(|| text.to_owned(), |port| format!("127.0.0.1:{port}"));
    text.parse().map_err(|_| format!("`{text}` is no address with a port; write it as 127.0.0.1:7788"))
}

/// A number of frames a second.
#[cfg(feature = "preview")]
fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
    rate.ok_or_else(|| format!("`{text}` is no number above 0"))
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is no size; write it as 1280x720, each side from 1 to 8192");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=8192).contains(side)).ok_or_else(wrong);
    Ok([side(width)?, side(height)?])
}
