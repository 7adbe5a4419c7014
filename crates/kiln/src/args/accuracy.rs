//! `kiln accuracy` on the command line.

use std::path::PathBuf;

use clap::Args as ClapArgs;

#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  kiln accuracy studio.hdr                      measure, write accuracy/accuracy.html and accuracy.json
  kiln accuracy look                            every environment of a project, as its kiln.toml bakes it
  kiln accuracy studio.hdr --estimators convolution,khronos --lobes ggx,lambert,charlie
  kiln accuracy studio.hdr --against specular.ktx2 --law filament
                                                rate a chain that another tool baked from the same panorama
  kiln accuracy look --estimators convolution --max-error 1e-3 --baseline accuracy.json
                                                for CI: exit 1 where an error or the counted work grew

What the columns mean: `knob` is what an estimator lets you turn (the error asked for, samples a texel, radians between
directions). RMS is over the sphere, relative to the exact map. `largest` looks where errors hide: the sun, its 90° circle and
its opposite, the poles, the wrap column, a cube's edges and corners. Seconds are of one core of this machine; operations are
counted and equal everywhere, so a baseline made on one machine holds on another.

Estimators: convolution, importance, importance-mips, filtered, eevee, vulkan, khronos, visible, grid, cosine.
Lobes: ggx, lambert, charlie. Laws of roughness: linear, filament, eevee, eevee-probe (before Blender 4), or a list as 0,0.25,1.
docs/accuracy.md explains the ladder of errors, which says what is worth paying for.")]
pub(crate) struct AccuracyArgs {
    /// A project's folder, or a panorama or cube: .hdr .exr .ktx .ktx2 .dds .png .jpg
    #[arg(default_value = ".", value_name = "DIR|FILE")]
    pub(crate) source: PathBuf,
    /// Folder of accuracy.json and accuracy.html
    #[arg(short, long, default_value = "accuracy", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Only these environments of the project
    #[arg(long = "env", value_name = "NAME")]
    pub(crate) envs: Vec<String>,
    /// Only these estimators [default: all that make maps of the lobe]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    pub(crate) estimators: Vec<String>,
    /// Which lobes [default: ggx,lambert, and charlie where kiln.toml asks for sheen]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    pub(crate) lobes: Vec<String>,
    /// Edge of the chain's first level, a power of two from 8 to 1024 [default: kiln.toml's, else 256]
    #[arg(long)]
    pub(crate) size: Option<usize>,
    /// Roughness of the levels [default: kiln.toml's, else linear]
    #[arg(long)]
    pub(crate) law: Option<String>,
    /// Error that Kiln is asked for [default: kiln.toml's, else 1e-3]
    #[arg(long)]
    pub(crate) error: Option<f64>,
    /// Texels that Kiln bakes: rgba16f, rgba32f, rgb9e5, r11g11b10f or bc6h [default: kiln.toml's, else rgba16f]
    #[arg(long)]
    pub(crate) format: Option<String>,
    /// Directions a level that are compared [default: as many as keep a report within a minute]
    #[arg(long)]
    pub(crate) probes: Option<usize>,
    /// Rate this map instead: a KTX2 chain, another cube (its first level), or a folder with a cube file for each level, in
    /// the order of their names
    #[arg(long, value_name = "FILE|DIR")]
    pub(crate) against: Option<PathBuf>,
    /// Exit with 1 where a level's RMS error at the error asked for is above this
    #[arg(long, value_name = "ERROR")]
    pub(crate) max_error: Option<f64>,
    /// Exit with 1 where an error or the counted work grew since this accuracy.json
    #[arg(long, value_name = "FILE")]
    pub(crate) baseline: Option<PathBuf>,
    /// Print accuracy.json instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}
