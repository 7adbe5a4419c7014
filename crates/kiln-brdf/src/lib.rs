//! Lobes in closed form, and the integrals that renderers tabulate.
//!
//! Start at [`dfg`], the split-sum integral of the specular lobe, or at [`d_ggx`] for the lobe itself. [`sheen_albedo`]
//! is the sheen lobe's, [`albedo_average`] what multiple scattering needs besides, [`fit_error`] says what a
//! closed-form fit costs. [`sampling`] draws from the lobes, [`invert`] undoes it.
//!
//! Conventions: α = perceptual roughness²; cosines are named for their vectors (`n_dot_v`, `n_dot_l`, `n_dot_h`,
//! `v_dot_h`) and lie in [0, 1]; V is the visibility G / (4 n·l n·v), so a lobe is D · V · F. All values are `f64`,
//! transcendental functions come from `libm`, so that results have the same bits on every machine.
//!
//! Not here: prefiltering and tables (`kiln-bake`), WGSL (`shaders/`).

mod circles;
mod dfg;
mod fits;
pub mod invert;
mod lobes;
mod quadrature;
pub mod sampling;
mod sheen;
#[cfg(test)]
mod tests;

pub use dfg::{Precision, albedo_average, dfg, dfg_ggx, dfg_multiscatter};
pub use fits::{ErrorNorms, FitError, fit_error, fit_karis_mobile, fit_lazarov};
pub use lobes::{Masking, d_charlie, d_ggx, f_schlick, v_ashikhmin, v_smith_ggx_correlated};
pub use sheen::{SheenVisibility, sheen_albedo};
