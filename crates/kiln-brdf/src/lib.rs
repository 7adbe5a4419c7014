//! Lobes in closed form, and the integrals that renderers tabulate.
//!
//! Start at [`dfg_ggx`], the split-sum integral of the specular lobe, or at [`d_ggx`] for the lobe itself.
//!
//! Conventions: α = perceptual roughness²; cosines are named for their vectors (`n_dot_v`, `n_dot_l`, `n_dot_h`,
//! `v_dot_h`) and lie in [0, 1]; V is the visibility G / (4 n·l n·v), so a lobe is D · V · F. All values are `f64`,
//! transcendental functions come from `libm`, so that results have the same bits on every machine.
//!
//! Not here: sampling estimators (`kiln-sample`), prefiltering (`kiln-bake`), WGSL (`shaders/`).

mod dfg;
mod lobes;
mod quadrature;

pub use dfg::{dfg_ggx, dfg_ggx_table_entry, sheen_albedo};
pub use lobes::{d_charlie, d_ggx, f_schlick, v_ashikhmin, v_smith_ggx_correlated};
