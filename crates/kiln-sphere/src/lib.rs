//! Numbers on the sphere: directions of texels, spherical-harmonic transforms of panoramas, spectra of
//! the lobes that environments are prefiltered with.
//!
//! Start at [`analyse`]: texels in, [`Harmonics`] out. [`synthesise_cube`] multiplies them with a [`Kernel`]'s
//! spectrum and evaluates the result at the texel centres of a cube map.
//! [`direction`] holds the layouts (equirectangular panorama, KTX2 cube) that all crates share.
//!
//! Conventions: right-handed, +Y up, unit directions; a panorama's centre column looks along −Z, its right
//! half towards +X, its top is +Y. Angles in radians, `f64` throughout. Harmonics use the polar axis +Y and
//! the longitude λ = 2πu of the panorama. Equal inputs give equal bits for any number of threads: work is
//! split over independent outputs only, sums have a fixed order, transcendental functions come from `libm`,
//! FFTs from rustfft's scalar plan.
//!
//! What can take long takes a [`Cancel`] last and returns [`Cancelled`] soon after it is set.
//!
//! Not here: image files and texel formats (`kiln-image`), reflectance (`kiln-brdf`), which bands and lobes
//! an artefact needs (`kiln-bake`).

mod analysis;
mod cancel;
pub mod direction;
mod fft;
mod harmonics;
pub mod kernel;
mod legendre;
mod lobe;
pub mod quadrature;
pub mod simd;
mod spread;
mod synthesis;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod world;

pub use analysis::{analyse, analyse_bytes, analyse_rows};
pub use cancel::{Bulk, Cancel, Cancelled};

pub use direction::{
    CubeSolidAngles, cube_direction, cube_face_st, cube_texel_solid_angle_sr, panorama_direction, panorama_uv,
};
pub use harmonics::{Harmonics, coefficient_count};
pub use kernel::{Kernel, ggx_kernel_at, kernel_charlie, kernel_ggx, kernel_lambert};
pub use lobe::{CharlieProfile, GgxProfile, Lobe, Profile, ZonalKernel};
pub use synthesis::{Interpolation, evaluate, synthesise_cube, synthesise_cube_bytes};
pub use world::{real_harmonics, world_coefficients};
