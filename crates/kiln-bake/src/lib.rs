//! Recipes of image-based lighting: an environment and a quality in, maps with their error out.
//!
//! Start at [`analyse`], which turns a panorama into an [`Analysis`] once; [`specular_level`], [`irradiance`]
//! and [`sh`] read it. [`skybox`] and [`table`] need no analysis. [`encode_level`] makes texel bytes.
//!
//! A prefiltered map is the environment convolved with its lobe (N = V = R), done on spherical harmonics with
//! texels as constant patches; the brightest texels are convolved directly, so a sun cannot ring. There are no
//! samples and therefore no noise. Every map states a bound of its own error.
//!
//! Conventions: those of `kiln-sphere` (right-handed, +Y up, KTX2 cubes); linear relative radiance; irradiance
//! maps hold E/π; `f64` inside, `f32` in results. Panoramas are expected to be finite and not negative:
//! `kiln_image` checks and repairs texels. Equal inputs give equal bytes for any number of threads.
//!
//! [`split_sum_radiance`] and [`PathTracer`] tell what the shading model costs that reads the maps.
//!
//! Every step takes a [`Cancel`] last: soon after it is set the step returns [`Cancelled`]. [`memory`] says what the
//! steps need.
//!
//! Not here: image files and containers (`kiln-image`), when to bake what (`kiln-project`), sampled estimators
//! (`kiln-accuracy`).

mod analysis;
mod bright;
mod bytes;
pub mod cost;
mod dering;
mod encode;
mod law;
mod measure;
pub mod memory;
mod model;
mod overlap;
mod panorama;
mod patch;
mod prefilter;
mod reference;
mod sh;
mod skybox;
mod sun;
mod tables;
#[cfg(test)]
mod tests;

pub use kiln_brdf::{Masking, SheenVisibility, fit_error, fit_karis_mobile, fit_lazarov};
pub use kiln_sphere::{Bulk, Cancel, Cancelled, Lobe};

pub use analysis::{Analysis, AnalysisRequest, BAND_LIMIT_MAX, BRIGHT_MAX, Forecast, analyse, forecast};
pub use bytes::BakeError;
pub use dering::{Deringed, dering};
pub use encode::{EncodedLevel, TexelFormat, decode_level, encode_level, scale_log2};
pub use law::{LawError, RoughnessLaw, roughness_of_level};
pub use measure::{BruteForce, Measured};
pub use model::{PathTracer, Surface, Traced, split_sum, split_sum_radiance};
pub use panorama::panorama_of_cube;
pub use prefilter::{ALPHA_MIN, Accuracy, Prefiltered, irradiance, sheen_level, specular_level};
pub use reference::reference_radiance;
pub use sh::{ShCoefficients, irradiance_sh, sh};
pub use skybox::{skybox, skybox_of_cube};
pub use sun::{FluxAccount, NoSun, Sun, SunExtraction, SunRequest, extract_sun};
pub use tables::{TABLE_SIZE, Table, TableAxes, dfg_table, table, table_error};
