//! Tables that do not depend on an environment.

use kiln_sphere::{Cancel, Cancelled};
use rayon::prelude::*;

/// Split-sum table of GGX: `size`² pairs (scale, bias), reflectance = F0 · scale + bias.
///
/// Column x is n·v = (x + ½)/size, row y is perceptual roughness (y + ½)/size; row 0 first. Within 1e-6 of the
/// integral (`kiln_brdf::dfg_ggx`) before rounding to `f32`.
///
/// # Errors
/// [`Cancelled`] within an entry's work.
pub fn dfg_table(size: usize, cancel: Cancel) -> Result<Vec<[f32; 2]>, Cancelled> {
    let centre = |index: usize| (index as f64 + 0.5) / size as f64;
    (0..size * size)
        .into_par_iter()
        .map(|index| {
            cancel.check()?;
            let entry = kiln_brdf::dfg_ggx_table_entry(centre(index % size), centre(index / size));
            Ok(entry.map(|value| value as f32))
        })
        .collect()
}
